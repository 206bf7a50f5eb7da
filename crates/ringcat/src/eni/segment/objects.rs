//! Objects and IDNs that accept the start-up commands of a file.

use std::collections::BTreeMap;

use ringcat_config::eni::SubDevice;
use ringcat_sim::application::dictionary::{ASSIGNMENT_BASE, Access, Entry, Object, ObjectRole};
use ringcat_sim::application::soe::idn::IdnObject;
use ringcat_sim::description::{PdoDescription, SyncManagerDescription, data_type};
use ringcat_wire::mailbox::coe::DataType;
use ringcat_wire::mailbox::coe::pdo_objects::is_mapping;
use ringcat_wire::mailbox::soe::Idn;
use ringcat_wire::sii::{PdoDirection, SyncManagerKind};

/// First index after the communication objects. Those (PDO assignment and mapping among them) follow from the rest of
/// the device.
const OF_PROFILE: u16 = 0x2000;
/// Drives that a device may have.
const MAX_DRIVES: u8 = 8;

/// A data type with this number of bits.
pub(super) const fn data_type(bits: u16) -> u8 {
    match bits {
        1 => data_type::BOOL,
        2..=8 => data_type::U8,
        9..=16 => data_type::U16,
        17..=32 => data_type::U32,
        _ => data_type::OCTET_STRING,
    }
}

/// PDOs that the commands of a file assign to a SyncManager, in order.
pub(super) fn assigned(subdevice: &SubDevice, sync_manager: u8) -> Vec<u16> {
    let mut places: BTreeMap<u8, u16> = BTreeMap::new();
    let object = ASSIGNMENT_BASE + u16::from(sync_manager);
    let commands = subdevice.mailbox.iter().flat_map(|mailbox| &mailbox.coe);
    for command in commands.filter(|command| command.index == object && !command.disabled) {
        let (first, data) = match (command.complete_access, command.sub_index) {
            (true, 0) => (1, command.data.get(2..).unwrap_or_default()),
            (true, _) => (1, &command.data[..]),
            (false, 0) => continue,
            (false, sub_index) => (sub_index, &command.data[..]),
        };
        let (pdos, _) = data.as_chunks::<2>();
        places.extend((first..=u8::MAX).zip(pdos).map(|(place, pdo)| (place, u16::from_le_bytes(*pdo))));
    }
    places.into_values().collect()
}

/// Objects that the commands write, in addition to the mapped ones.
pub(super) fn objects(
    subdevice: &SubDevice,
    pdos: &[PdoDescription],
    declared: &[SyncManagerDescription],
) -> Vec<Object> {
    let commands = subdevice.mailbox.iter().flat_map(|mailbox| &mailbox.coe);
    let mut written: BTreeMap<u16, BTreeMap<u8, Entry>> = BTreeMap::new();
    for command in
        commands.filter(|command| command.index >= OF_PROFILE || is_created_here(command.index, pdos, declared))
    {
        let entries = written.entry(command.index).or_default();
        if command.complete_access {
            let data = if command.sub_index == 0 { command.data.get(2..).unwrap_or_default() } else { &command.data };
            entries.insert(0, Entry::new(0, data_type::U8, Access::ReadWrite, &[1]));
            add(entries, 1, data);
        } else {
            add(entries, command.sub_index, &command.data);
        }
    }
    let objects = written.into_iter().filter_map(|(index, mut entries)| {
        let mapped = mapped(index, pdos);
        if entries.keys().all(|sub_index| mapped.iter().any(|entry| entry.sub_index == *sub_index)) {
            // The object exists already, and is writable if it is an output.
            let outputs = mapped.iter().all(|entry| entry.access == Access::ReadWrite);
            if outputs {
                return None;
            }
        }
        for mut entry in mapped {
            entry.access = Access::ReadWrite;
            entries.insert(entry.sub_index, entry);
        }
        let last = entries.keys().next_back().copied().unwrap_or(0);
        if last > 0 {
            entries.entry(0).or_insert_with(|| Entry::new(0, data_type::U8, Access::ReadWrite, &[last]));
        }
        let entries = entries.into_values().collect();
        Some(Object { index, name: String::new(), role: ObjectRole::Plain, entries })
    });
    objects.collect()
}

/// Communication objects that no other part of the device creates: neither assignment nor mapping of a known PDO nor
/// identity.
fn is_created_here(index: u16, pdos: &[PdoDescription], declared: &[SyncManagerDescription]) -> bool {
    let number = usize::from(index.saturating_sub(ASSIGNMENT_BASE));
    let exchanges = |sm: &SyncManagerDescription| matches!(sm.kind, SyncManagerKind::Outputs | SyncManagerKind::Inputs);
    let assignment = (ASSIGNMENT_BASE..ASSIGNMENT_BASE + 0x20).contains(&index);
    let of_sync_managers = index == 0x1C00 || (assignment && declared.get(number).is_some_and(exchanges));
    let standard = matches!(index, 0x1000 | 0x1001 | 0x1008..=0x100A | 0x1018);
    let mapping = is_mapping(index);
    let is_there = of_sync_managers || standard || (mapping && pdos.iter().any(|pdo| pdo.index == index));
    !is_there
}

/// Adds an entry for this value; an entry that is written with different lengths accepts any length.
fn add(entries: &mut BTreeMap<u8, Entry>, sub_index: u8, data: &[u8]) {
    let differs = entries.get(&sub_index).is_some_and(|known| known.value.len() != data.len());
    let bits = u16::try_from(8 * data.len()).unwrap_or(u16::MAX);
    let kind = if differs || data.is_empty() { DataType::DOMAIN.0 as u8 } else { data_type(bits) };
    let kind = if data.len() == 3 { data_type::OCTET_STRING } else { kind };
    entries.insert(sub_index, Entry::new(sub_index, kind, Access::ReadWrite, &vec![0; data.len()]));
}

/// Entries of an object that is mapped.
fn mapped(index: u16, pdos: &[PdoDescription]) -> Vec<Entry> {
    let mut found: Vec<Entry> = Vec::new();
    for pdo in pdos {
        let access = if pdo.direction == PdoDirection::Rx { Access::ReadWrite } else { Access::ReadOnly };
        for entry in pdo.entries.iter().filter(|entry| entry.index == index) {
            if !found.iter().any(|known| known.sub_index == entry.sub_index) {
                let zeros = vec![0; usize::from(entry.bit_length).div_ceil(8)];
                found.push(Entry::new(entry.sub_index, entry.data_type, access, &zeros).named(&entry.name));
            }
        }
    }
    found
}

/// Drives with the IDNs that are written.
pub(super) fn drives(subdevice: &SubDevice) -> Vec<Vec<IdnObject>> {
    let mut drives = vec![vec![IdnObject::number(Idn::standard(0, 11), "Class 1 diagnostic", 2, 0)]];
    for command in subdevice.mailbox.iter().flat_map(|mailbox| &mailbox.soe) {
        let drive = usize::from(command.drive.min(MAX_DRIVES - 1));
        drives.resize_with(drives.len().max(drive + 1), Vec::new);
        let idn = Idn(command.idn);
        if drives[drive].iter().any(|known| known.idn == idn) {
            continue;
        }
        let length = command.data.len();
        drives[drive].push(match length {
            1 | 2 | 4 | 8 => IdnObject::number(idn, "", length as u8, 0),
            _ => IdnObject::list(idn, "", 1, &[], length.max(64)),
        });
    }
    drives
}
