//! Builds the objects of a dictionary from a device description (protocol 6.3, standard objects).

use std::collections::{BTreeMap, btree_map};

use ringcat_wire::mailbox::coe::AccessRights;
use ringcat_wire::sii::{Pdo, PdoDirection, SiiSyncManager, SyncManagerKind};

use super::entry::{Access, Entry};
use super::object::{ASSIGNMENT_BASE, MAX_MAPPED_ENTRIES, MappedEntry, Object, ObjectRole};
use crate::description::{DeviceDescription, PdoDescription, data_type};

/// All objects, indices ascending. An object of the description replaces a standard one.
pub(super) fn build(description: &DeviceDescription) -> Vec<Object> {
    let mut objects = BTreeMap::new();
    let mut add = |object: Object| {
        objects.insert(object.index, object);
    };
    identity(description).into_iter().for_each(&mut add);
    sync_managers(description).into_iter().for_each(&mut add);
    description.pdos.iter().map(|pdo| mapping(description, pdo)).for_each(&mut add);
    mapped_objects(description).into_iter().for_each(&mut add);
    for described in &description.described {
        match objects.entry(described.index) {
            btree_map::Entry::Occupied(mut derived) => derived.get_mut().named_by(described),
            btree_map::Entry::Vacant(free) => drop(free.insert(described.clone())),
        }
    }
    for object in &description.objects {
        objects.insert(object.index, object.clone());
    }
    objects.into_values().collect()
}

/// The order code of the device, not its name in the segment.
pub fn type_name(description: &DeviceDescription) -> &str {
    if description.order_code.is_empty() { &description.name } else { &description.order_code }
}

fn identity(description: &DeviceDescription) -> [Object; 6] {
    use data_type::{U8, U32, VISIBLE_STRING};
    let text =
        |index, name, value: &str| Object::variable(index, name, VISIBLE_STRING, Access::ReadOnly, value.as_bytes());
    let id = description.identity;
    let numbers = [id.vendor_id, id.product_code, id.revision, id.serial];
    let mut entries = vec![Entry::new(0, U8, Access::ReadOnly, &[4])];
    for (sub_index, number) in (1..).zip(numbers) {
        entries.push(Entry::new(sub_index, U32, Access::ReadOnly, &number.to_le_bytes()));
    }
    [
        Object::variable(0x1000, "Device type", U32, Access::ReadOnly, &0x0000_1389u32.to_le_bytes()),
        Object::variable(0x1001, "Error register", U8, Access::ReadOnly, &[0]),
        text(0x1008, "Device name", type_name(description)),
        text(0x1009, "Hardware version", "1.0"),
        text(0x100A, "Software version", "1.0"),
        Object { index: 0x1018, name: "Identity".into(), role: ObjectRole::Plain, entries },
    ]
}

fn sync_managers(description: &DeviceDescription) -> Vec<Object> {
    let mut types = vec![Entry::new(0, data_type::U8, Access::ReadOnly, &[0])];
    let mut objects = Vec::new();
    for (number, entry) in (0u8..).zip(&description.sync_managers) {
        types.push(Entry::new(number + 1, data_type::U8, Access::ReadOnly, &[entry.kind.code()]));
        types[0].value = vec![number + 1];
        match entry.kind {
            SyncManagerKind::Outputs => objects.push(assignment(description, number, PdoDirection::Rx)),
            SyncManagerKind::Inputs => objects.push(assignment(description, number, PdoDirection::Tx)),
            SyncManagerKind::Unused
            | SyncManagerKind::MailboxOut
            | SyncManagerKind::MailboxIn
            | SyncManagerKind::Other(_) => {}
        }
    }
    objects.push(Object { index: 0x1C00, name: "SyncManager types".into(), role: ObjectRole::Plain, entries: types });
    objects
}

fn assignment(description: &DeviceDescription, number: u8, direction: PdoDirection) -> Object {
    let is_fixed = description.sync_managers[usize::from(number)].enable & SiiSyncManager::FIXED_CONTENT != 0;
    let writable = !is_fixed && description.mailbox.is_some_and(|mailbox| mailbox.coe_details.pdo_assign());
    let access = if writable { Access::ReadWritePreOp } else { Access::ReadOnly };
    let assigned: Vec<u16> =
        description.default_assignment(number).filter(|pdo| pdo.direction == direction).map(|pdo| pdo.index).collect();
    let room = description.pdos.iter().filter(|pdo| pdo.direction == direction).count();
    let slots = if writable { room } else { assigned.len() };
    let values = assigned.iter().map(|index| index.to_le_bytes().to_vec());
    let index = ASSIGNMENT_BASE + u16::from(number);
    list(index, "PDO assignment", ObjectRole::Assignment(direction), access, data_type::U16, slots, values)
}

fn mapping(description: &DeviceDescription, pdo: &PdoDescription) -> Object {
    let is_fixed = pdo.flags & Pdo::FIXED != 0;
    let writable = !is_fixed && description.mailbox.is_some_and(|mailbox| mailbox.coe_details.pdo_configuration());
    let access = if writable { Access::ReadWritePreOp } else { Access::ReadOnly };
    let slots = if writable { MAX_MAPPED_ENTRIES.max(pdo.entries.len()) } else { pdo.entries.len() };
    let values = pdo.entries.iter().map(|entry| {
        let mapped = MappedEntry { index: entry.index, sub_index: entry.sub_index, bit_length: entry.bit_length };
        mapped.encode().to_vec()
    });
    list(pdo.index, &pdo.name, ObjectRole::Mapping(pdo.direction), access, data_type::U32, slots, values)
}

/// A list object with `slots` entries; the first ones have values.
fn list(
    index: u16,
    name: &str,
    role: ObjectRole,
    access: Access,
    data_type: u8,
    slots: usize,
    values: impl Iterator<Item = Vec<u8>>,
) -> Object {
    let width = if data_type == data_type::U16 { 2 } else { 4 };
    let mut values = values.fuse();
    let mut count = 0;
    let mut entries = vec![Entry::new(0, data_type::U8, access, &[0])];
    for sub_index in (1..=u8::MAX).take(slots) {
        let value = values.next().inspect(|_| count = sub_index).unwrap_or_else(|| vec![0; width]);
        entries.push(Entry::new(sub_index, data_type, access, &value));
    }
    entries[0].value = vec![count];
    Object { index, name: name.into(), role, entries }
}

/// The objects of the mapped entries: outputs are writable, inputs read-only.
fn mapped_objects(description: &DeviceDescription) -> Vec<Object> {
    let mut found: BTreeMap<u16, BTreeMap<u8, Entry>> = BTreeMap::new();
    let mut names = BTreeMap::new();
    for pdo in &description.pdos {
        let (access, mappable) = match pdo.direction {
            PdoDirection::Rx => (Access::ReadWrite, AccessRights::RX_MAPPABLE),
            PdoDirection::Tx => (Access::ReadOnly, AccessRights::TX_MAPPABLE),
        };
        for entry in pdo.entries.iter().filter(|entry| entry.index != 0) {
            let zeros = vec![0; usize::from(entry.bit_length).div_ceil(8)];
            let value = Entry::new(entry.sub_index, entry.data_type, access, &zeros);
            let value = value.of_bits(entry.bit_length.into()).named(&entry.name).allow(mappable);
            found.entry(entry.index).or_default().entry(entry.sub_index).or_insert(value);
            // An object of several entries has the name of their PDO.
            let name = if entry.sub_index == 0 { &entry.name } else { &pdo.name };
            names.entry(entry.index).or_insert_with(|| name.clone());
        }
    }
    found
        .into_iter()
        .map(|(index, mut entries)| {
            let last = entries.keys().next_back().copied().unwrap_or(0);
            let record = last > 0;
            if record {
                entries.insert(0, Entry::new(0, data_type::U8, Access::ReadOnly, &[last]));
            }
            let name = names.remove(&index).unwrap_or_default();
            Object { index, name, role: ObjectRole::Plain, entries: entries.into_values().collect() }
        })
        .collect()
}
