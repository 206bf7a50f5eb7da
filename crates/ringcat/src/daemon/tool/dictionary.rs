//! The dictionary of a SubDevice, object by object.

use ringcat_control::tool::{EntryLine, ObjectLine};

use super::service::subdevice;
use crate::error::Error;
use crate::subdevice::SubDeviceFailure;
use crate::supervisor_thread::SupervisorThread;
use ringcat_engine::mail::coe::information::{Entry, InformationError};

/// Indices of all objects; none without SDO information.
pub(super) fn objects(supervisor: &SupervisorThread, position: u16) -> Result<Vec<u16>, Error> {
    match subdevice(supervisor, position).info()? {
        Some(info) if info.coe.sdo_information() => subdevice(supervisor, position).sdo_info(),
        _ => Ok(Vec::new()),
    }
}

/// An object and its entries. Entries that the SubDevice refuses to describe are left out: subindices without an entry.
pub(super) fn object(supervisor: &SupervisorThread, position: u16, index: u16) -> Result<ObjectLine, Error> {
    let object = subdevice(supervisor, position).sdo_object(index)?;
    let mut entries = Vec::new();
    for sub_index in 0..=object.max_sub_index {
        match subdevice(supervisor, position).sdo_entry(index, sub_index) {
            Ok(entry) => entries.push(line(entry)),
            Err(error) if !is_refused(&error) => return Err(error),
            Err(_) => {}
        }
    }
    Ok(ObjectLine { index, name: object.name, entries })
}

fn is_refused(error: &Error) -> bool {
    let Error::SubDevice(error) = error else { return false };
    matches!(error.failure, SubDeviceFailure::Information(InformationError::Refused(_)))
}

/// An entry in the words of the tool.
pub(super) fn line(entry: Entry) -> EntryLine {
    EntryLine {
        sub_index: entry.sub_index,
        data_type: entry.data_type.0,
        bits: entry.bit_length,
        access: entry.access.0,
        name: entry.name,
    }
}
