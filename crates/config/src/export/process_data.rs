//! `ProcessData` of a SubDevice and `ProcessImage`.

use ringcat_engine::config::{DeclaredSyncManager, PdoMapping, SyncManagerRole};
use ringcat_engine::info::Direction;

use super::details::SubDeviceDetails;
use super::error::ExportError;
use crate::configuration::Configuration;
use crate::eni::{
    BitRange, ImageSide, Pdo, PdoEntry, Place, ProcessData, ProcessImage, SyncManagerKind, SyncManagerSettings,
    Variable,
};
use crate::xml::one_line;

pub(super) fn of_subdevice(
    whole: &Configuration,
    index: usize,
    details: &SubDeviceDetails,
) -> Result<Option<ProcessData>, ExportError> {
    let config = &whole.declaration.subdevices[index];
    let ranges = |direction| {
        let areas = whole.image.areas.iter().filter(|it| it.subdevice == index && it.direction == direction);
        let mut areas: Vec<_> = areas.collect();
        areas.sort_by_key(|area| (area.sync_manager, area.bit_offset));
        let range = |start, length| BitRange { place: Place::default(), start, length };
        areas.into_iter().map(|area| range(area.image_bit, area.bits)).collect()
    };
    let mut found =
        ProcessData { send: ranges(Direction::Outputs), receive: ranges(Direction::Inputs), ..ProcessData::default() };
    for of in config.declared.iter().flatten() {
        found.sync_managers.push(settings(of));
        let outputs = of.role == SyncManagerRole::Outputs;
        for mapping in &of.pdos {
            let pdo = pdo(mapping, outputs, of.index, details).ok_or_else(|| {
                let what = format!("PDO {:#06x}", mapping.index);
                ExportError::of(whole, index, what, "its entries are those of the EEPROM: an ENI has to state them")
            })?;
            found.pdos.push(pdo);
        }
    }
    if config.declared.is_none() {
        for of in config.pdos.iter().flatten() {
            let outputs = of.direction == Direction::Outputs;
            found.pdos.extend(of.pdos.iter().filter_map(|mapping| pdo(mapping, outputs, of.sync_manager, details)));
        }
    }
    Ok((found != ProcessData::default()).then_some(found))
}

fn settings(of: &DeclaredSyncManager) -> SyncManagerSettings {
    SyncManagerSettings {
        place: Place::default(),
        index: of.index,
        kind: Some(match of.role {
            SyncManagerRole::MailboxOut => SyncManagerKind::MailboxOut,
            SyncManagerRole::MailboxIn => SyncManagerKind::MailboxIn,
            SyncManagerRole::Outputs => SyncManagerKind::Outputs,
            SyncManagerRole::Inputs => SyncManagerKind::Inputs,
        }),
        default_size: Some(of.register.length),
        start: Some(of.register.start),
        control: Some(of.register.control.bits()),
        enable: Some(of.register.activate.enable),
        pdos: of.pdos.iter().map(|pdo| pdo.index).collect(),
    }
}

/// A PDO with the names of the details; `None`: its entries are not known.
fn pdo(of: &PdoMapping, outputs: bool, sync_manager: u8, details: &SubDeviceDetails) -> Option<Pdo> {
    let named = details.pdos.iter().find(|it| it.index == of.index && it.outputs == outputs);
    let entry = |entry: &ringcat_engine::config::PdoEntry| {
        let is_same = |it: &&PdoEntry| {
            (it.index, it.sub_index, it.bit_length) == (entry.index, entry.sub_index, entry.bit_length.into())
        };
        let named = named.filter(|_| entry.index != 0).and_then(|pdo| pdo.entries.iter().find(is_same));
        PdoEntry {
            index: entry.index,
            sub_index: entry.sub_index,
            bit_length: entry.bit_length.into(),
            name: named.map(|it| one_line(&it.name)).unwrap_or_default(),
            data_type: named.map(|it| one_line(&it.data_type)).unwrap_or_default(),
        }
    };
    Some(Pdo {
        place: Place::default(),
        outputs,
        index: of.index,
        name: named.map(|it| one_line(&it.name)).unwrap_or_default(),
        sync_manager: Some(sync_manager),
        entries: of.entries.as_ref()?.iter().map(entry).collect(),
    })
}

pub(super) fn image(whole: &Configuration) -> Result<ProcessImage, ExportError> {
    let side = |direction, bytes: usize| {
        let variables = whole.image.variables.iter().filter(|it| it.direction == direction).map(|it| Variable {
            place: Place::default(),
            name: it.name.clone(),
            data_type: it.data_type.clone(),
            bits: it.bits,
            bit_offset: it.image_bit,
        });
        let bytes = u32::try_from(bytes);
        let bytes = bytes.map_err(|_| ExportError::whole("process image", "it has more than 4 GiB"))?;
        Ok(ImageSide { bytes: Some(bytes), variables: variables.collect() })
    };
    Ok(ProcessImage {
        inputs: side(Direction::Inputs, whole.image.inputs_len)?,
        outputs: side(Direction::Outputs, whole.image.outputs_len)?,
    })
}
