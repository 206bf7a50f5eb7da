//! `ProcessData` of a SubDevice, and `ProcessImage` with its variables.

use crate::eni::element::Element;
use crate::eni::error::{EniError, Problem};
use crate::eni::model::{
    BitRange, ImageSide, Pdo, PdoEntry, ProcessData, ProcessImage, SyncManagerKind, SyncManagerSettings, Variable,
};
use crate::xml::shown;

/// PDOs that can be assigned to a SyncManager: subindices of an object (protocol 6.3).
const ASSIGNED: usize = 255;
/// PDOs of a SubDevice: 0x1600 to 0x17FF and 0x1A00 to 0x1BFF (protocol 6.3).
const PDOS: usize = 1024;
/// SyncManagers of a SubDevice controller.
const SYNC_MANAGERS: u8 = 16;

/// `ProcessData`.
pub(super) fn process_data(element: Element<'_>) -> Result<ProcessData, EniError> {
    let mut found = ProcessData::default();
    for child in element.all() {
        match child.name() {
            "Send" => found.send.push(range(child)?),
            "Recv" | "Receive" => found.receive.push(range(child)?),
            "RxPdo" => found.pdos.push(pdo(child, true)?),
            "TxPdo" => found.pdos.push(pdo(child, false)?),
            name => match name.strip_prefix("Sm").and_then(|number| number.parse().ok()) {
                Some(index) if index < SYNC_MANAGERS => found.sync_managers.push(sync_manager(child, index)?),
                _ => child.note_unknown(),
            },
        }
    }
    if found.pdos.len() > PDOS {
        return Err(element.error(Problem::TooMuch { what: "PDOs of a SubDevice", limit: PDOS }));
    }
    found.sync_managers.sort_by_key(|sync_manager| sync_manager.index);
    Ok(found)
}

fn range(element: Element<'_>) -> Result<BitRange, EniError> {
    element.expects(&["BitStart", "BitLength"]);
    let start: u32 = element.required_number("BitStart")?;
    let length: u32 = element.required_number("BitLength")?;
    if start.checked_add(length).is_none() {
        let expected = "an end below 2^32 bits".to_owned();
        return Err(element.error(Problem::Value { expected, got: shown(&format!("{start} + {length}")) }));
    }
    Ok(BitRange { place: element.place(), start, length })
}

fn sync_manager(element: Element<'_>, index: u8) -> Result<SyncManagerSettings, EniError> {
    element.expects(&[
        "Type",
        "MinSize",
        "MaxSize",
        "DefaultSize",
        "StartAddress",
        "ControlByte",
        "Enable",
        "Virtual",
        "Watchdog",
        "Pdo",
    ]);
    let kind = match element.child("Type") {
        None => None,
        Some(kind) => match kind.text().to_lowercase().as_str() {
            "outputs" => Some(SyncManagerKind::Outputs),
            "inputs" => Some(SyncManagerKind::Inputs),
            "mboxout" | "mbxout" => Some(SyncManagerKind::MailboxOut),
            "mboxin" | "mbxin" => Some(SyncManagerKind::MailboxIn),
            "" | "unused" | "dynamic" => None,
            _ => return Err(kind.wrong("Outputs, Inputs, MBoxOut or MBoxIn")),
        },
    };
    if element.children("Pdo").nth(ASSIGNED).is_some() {
        return Err(element.error(Problem::TooMuch { what: "PDOs of a SyncManager", limit: ASSIGNED }));
    }
    Ok(SyncManagerSettings {
        place: element.place(),
        index,
        kind,
        default_size: element.number_of("DefaultSize")?,
        start: element.number_of("StartAddress")?,
        control: element.number_of("ControlByte")?,
        enable: element.child("Enable").map(|enable| enable.flag()).transpose()?,
        pdos: element.children("Pdo").map(|pdo| pdo.number()).collect::<Result<_, _>>()?,
    })
}

fn pdo(element: Element<'_>, outputs: bool) -> Result<Pdo, EniError> {
    element.expects(&["Index", "Name", "Exclude", "Entry", "ExcludedSm"]);
    let sync_manager = match element.attribute("Sm").map(str::trim) {
        None | Some("") => None,
        Some(text) => match text.parse().ok().filter(|index| *index < SYNC_MANAGERS) {
            Some(index) => Some(index),
            None => {
                let expected = format!("a SyncManager from 0 to {} in the attribute Sm", SYNC_MANAGERS - 1);
                return Err(element.error(Problem::Value { expected, got: shown(text) }));
            }
        },
    };
    Ok(Pdo {
        place: element.place(),
        outputs,
        index: element.required_number("Index")?,
        name: element.text_of("Name"),
        sync_manager,
        entries: element.children("Entry").map(entry).collect::<Result<_, _>>()?,
    })
}

fn entry(element: Element<'_>) -> Result<PdoEntry, EniError> {
    element.expects(&["Index", "SubIndex", "BitLen", "Name", "Comment", "DataType"]);
    Ok(PdoEntry {
        index: element.number_of("Index")?.unwrap_or_default(),
        sub_index: element.number_of("SubIndex")?.unwrap_or_default(),
        bit_length: element.required_number("BitLen")?,
        name: element.text_of("Name"),
        data_type: element.text_of("DataType"),
    })
}

/// `ProcessImage`.
pub(super) fn image(element: Element<'_>) -> Result<ProcessImage, EniError> {
    element.expects(&["Inputs", "Outputs"]);
    let side = |name| element.child(name).map(image_side).transpose().map(Option::unwrap_or_default);
    Ok(ProcessImage { inputs: side("Inputs")?, outputs: side("Outputs")? })
}

fn image_side(element: Element<'_>) -> Result<ImageSide, EniError> {
    element.expects(&["ByteSize", "Variable"]);
    let bytes: Option<u32> = element.number_of("ByteSize")?;
    if let Some(size) = element.child("ByteSize")
        && bytes.is_some_and(|bytes| bytes > u32::MAX / 8)
    {
        return Err(size.wrong("less than 2^29 bytes"));
    }
    Ok(ImageSide { bytes, variables: element.children("Variable").map(variable).collect::<Result<_, _>>()? })
}

/// A variable may lie beyond the end of the image, as TwinCAT's state information of devices does.
fn variable(element: Element<'_>) -> Result<Variable, EniError> {
    element.expects(&["Name", "Comment", "DataType", "BitSize", "BitOffs"]);
    let bits: u32 = element.required_number("BitSize")?;
    let bit_offset: u32 = element.required_number("BitOffs")?;
    if bit_offset.checked_add(bits).is_none() {
        let expected = "an end below 2^32 bits".to_owned();
        return Err(element.error(Problem::Value { expected, got: format!("{bit_offset} + {bits}") }));
    }
    Ok(Variable {
        place: element.place(),
        name: element.text_of("Name"),
        data_type: element.text_of("DataType"),
        bits,
        bit_offset,
    })
}
