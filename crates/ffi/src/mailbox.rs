//! Blocking transfers: objects and IDNs of a SubDevice by its position.

use ringcat::daemon::{Query, Refusal, ServiceFault};

use crate::code::{Code, report};
use crate::responder::{Responder, code_of};

/// A failed transfer: the code, and the abort code of the SubDevice if it aborted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Failed {
    /// Return code.
    pub code: Code,
    /// Abort code of an SDO, or error code of an IDN.
    pub reason: Option<u32>,
}

/// Reads an entry.
///
/// # Errors
/// No such SubDevice, it aborted, or did not answer.
pub fn upload(responder: &Responder, position: u16, index: u16, sub_index: u8) -> Result<Vec<u8>, Failed> {
    transfer(responder, Query::SdoUpload { position, index, sub_index: Some(sub_index) }, Vec::new())
}

/// Writes an entry; without a sub-index a whole object.
///
/// # Errors
/// As [`upload`]; no data.
pub fn download(responder: &Responder, position: u16, object: (u16, Option<u8>), data: Vec<u8>) -> Result<(), Failed> {
    let (index, sub_index) = object;
    write(responder, Query::SdoDownload { position, index, sub_index }, data)
}

/// Reads the value of an IDN.
///
/// # Errors
/// As [`upload`]; a drive above 7.
pub fn read_idn(responder: &Responder, position: u16, drive: u8, idn: u16) -> Result<Vec<u8>, Failed> {
    transfer(responder, Query::IdnRead { position, drive, idn }, Vec::new())
}

/// Writes the value of an IDN.
///
/// # Errors
/// As [`read_idn`]; no data.
pub fn write_idn(responder: &Responder, position: u16, drive: u8, idn: u16, data: Vec<u8>) -> Result<(), Failed> {
    write(responder, Query::IdnWrite { position, drive, idn }, data)
}

fn write(responder: &Responder, what: Query, data: Vec<u8>) -> Result<(), Failed> {
    if data.is_empty() {
        return Err(Failed { code: Code::INVALID, reason: None });
    }
    transfer(responder, what, data).map(|_| ())
}

fn transfer(responder: &Responder, what: Query, data: Vec<u8>) -> Result<Vec<u8>, Failed> {
    responder.ask(what, data).map(|(_, read)| read).map_err(|refusal| {
        report(format_args!("{refusal}"));
        let reason = match refusal {
            Refusal::Service { fault: ServiceFault::Aborted(code), .. } => Some(code),
            _ => None,
        };
        Failed { code: code_of(&refusal), reason }
    })
}
