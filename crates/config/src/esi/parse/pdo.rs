//! PDOs of devices and modules (protocol ES-47).

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use crate::esi::element::Element;
use crate::esi::error::EsiError;
use crate::esi::model::{Names, Pdo, PdoEntry, SlotIndex};

/// PDOs of one direction. A second one of the same index is not used (protocol ES-160).
pub(super) fn pdos(parent: Element<'_>, name: &str) -> Result<Vec<Pdo>, EsiError> {
    let mut pdos: Vec<Pdo> = Vec::new();
    let mut lines: HashMap<SlotIndex, u32> = HashMap::new();
    for element in parent.children(name) {
        let pdo = pdo(element)?;
        match lines.entry(pdo.index) {
            Entry::Occupied(first) => {
                let (index, line) = (pdo.index.index, first.get());
                element.note(format!("{name} {index:#06x} is defined in line {line} already: not used"));
            }
            Entry::Vacant(place) => {
                place.insert(pdo.line);
                pdos.push(pdo);
            }
        }
    }
    Ok(pdos)
}

/// An index with its dependence on the slot.
pub(super) fn slot_index(element: Element<'_>) -> Result<SlotIndex, EsiError> {
    Ok(SlotIndex {
        index: element.number()?,
        by_slot: element.is("DependOnSlot")?,
        by_group: element.is("DependOnSlotGroup")?,
    })
}

fn pdo(element: Element<'_>) -> Result<Pdo, EsiError> {
    let samples = |name| element.number_in::<u32>(name);
    let oversampling = match samples("OSFac")? {
        Some(factor) => Some([
            factor,
            samples("OSMin")?.unwrap_or(1),
            samples("OSMax")?.unwrap_or(factor),
            samples("OSIndexInc")?.unwrap_or(0),
        ]),
        None => None,
    };
    Ok(Pdo {
        line: element.line(),
        index: slot_index(element.required("Index")?)?,
        name: element.names("Name")?,
        sync_manager: element.number_in("Sm")?,
        is_fixed: element.is("Fixed")?,
        is_mandatory: element.is("Mandatory")?,
        is_virtual: element.is("Virtual")?,
        overwritten_by_module: element.is("OverwrittenByModule")?,
        excludes: element.children("Exclude").map(slot_index).collect::<Result<_, _>>()?,
        excluded_sync_managers: element.children("ExcludedSm").map(|it| it.number()).collect::<Result<_, _>>()?,
        sync_unit: element.number_in("Su")?,
        oversampling,
        safety_connection: element.number_in("SafetyConnNumber")?,
        entries: element.children("Entry").map(entry).collect::<Result<_, _>>()?,
    })
}

fn entry(element: Element<'_>) -> Result<PdoEntry, EsiError> {
    let index = match element.child("Index") {
        Some(index) => slot_index(index)?,
        None => {
            element.note("an Entry without Index is a gap");
            SlotIndex::default()
        }
    };
    let name = element.names("Name")?;
    let is_empty = name.all().iter().all(|(_, text)| text.is_empty());
    Ok(PdoEntry {
        index,
        sub_index: element.number_of("SubIndex")?.unwrap_or(0),
        bit_length: element.required_number("BitLen")?,
        name: if is_empty { Names::default() } else { name },
        data_type: element.child("DataType").map(|it| it.raw().trim().to_owned()).unwrap_or_default(),
        is_fixed: element.is("Fixed")?,
    })
}
