//! The object dictionary of a simulated SubDevice (protocol 6.3).
//!
//! Input: the device's description, which defines the standard objects, the PDO mappings (0x16xx, 0x1Axx), the PDO
//! assignments (0x1C10 + SyncManager) and the mapped objects; reads and writes by index and subindex. Output: bytes or
//! an abort code. `entry` defines entries, `history` the diagnosis history, `sync` the synchronisation parameters. The
//! SDO services are in [`coe`](super::coe), the process data of an assignment in [`process_data`](super::process_data).

mod diagnosis;
mod entry;
mod history;
mod object;
mod objects;
mod sync;

use ringcat_wire::al::AlState;
use ringcat_wire::mailbox::coe::AccessRights;
use ringcat_wire::mailbox::sdo::AbortCode;
use ringcat_wire::sii::PdoDirection;

use crate::description::DeviceDescription;
use history::check_acknowledge;

pub use entry::{Access, Entry, MAX_TRANSFER_BYTES};
pub use history::history;
pub use object::{ASSIGNMENT_BASE, MappedEntry, Object, ObjectRole};
pub use objects::type_name;
pub use sync::SyncParameters;

/// All objects of a device, indices ascending.
#[derive(Clone, Debug, Default)]
pub struct Dictionary {
    objects: Vec<Object>,
    /// Number of unacknowledged messages of the diagnosis history.
    unacknowledged: u8,
    /// Counter of value changes.
    revision: u32,
    /// Objects that no MainDevice can access.
    hidden: Vec<u16>,
}

impl Dictionary {
    /// The dictionary of a description; it has PDO lists also for devices without CoE.
    pub fn new(description: &DeviceDescription) -> Dictionary {
        let (objects, hidden) = (objects::build(description), description.left_out.clone());
        Dictionary { objects, unacknowledged: 0, revision: 0, hidden }
    }

    /// All objects, indices ascending.
    pub fn objects(&self) -> &[Object] {
        &self.objects
    }

    /// Finds an object.
    pub fn object(&self, index: u16) -> Option<&Object> {
        self.objects.binary_search_by_key(&index, |object| object.index).ok().map(|place| &self.objects[place])
    }

    /// Finds an object that a MainDevice accesses.
    fn visible(&self, index: u16) -> Result<&Object, AbortCode> {
        let object = self.object(index).filter(|_| !self.hidden.contains(&index));
        object.ok_or(AbortCode::OBJECT_DOES_NOT_EXIST)
    }

    /// Counter of value changes: equal counters mean equal values.
    pub const fn revision(&self) -> u32 {
        self.revision
    }

    /// Index, subindex and value of all entries of these objects, numbers sign-extended.
    pub fn numbers(&self, indices: core::ops::RangeInclusive<u16>) -> impl Iterator<Item = (u16, u8, u64)> {
        let objects = self.objects.iter().filter(move |object| indices.contains(&object.index));
        objects.flat_map(|object| {
            object.entries.iter().map(|entry| (object.index, entry.sub_index, entry.number(&entry.value) as u64))
        })
    }

    /// An object to be changed.
    fn object_mut(&mut self, index: u16) -> Option<&mut Object> {
        self.revision = self.revision.wrapping_add(1);
        let place = self.objects.binary_search_by_key(&index, |object| object.index).ok()?;
        self.objects.get_mut(place)
    }

    /// The value of one entry.
    pub fn read(&self, index: u16, sub_index: u8) -> Result<&[u8], AbortCode> {
        let object = self.visible(index)?;
        let entry = object.entry(sub_index).ok_or(AbortCode::SUB_INDEX_DOES_NOT_EXIST)?;
        if entry.access == Access::WriteOnly { Err(AbortCode::WRITE_ONLY) } else { Ok(&entry.value) }
    }

    /// All entries from subindex 0 (padded to 16 bits) or 1 on, packed (protocol 6.3, complete access).
    pub fn read_complete(&self, index: u16, from: u8) -> Result<Vec<u8>, AbortCode> {
        let object = self.visible(index)?;
        let mut bytes = Vec::new();
        if from == 0 {
            bytes.push(object.entry(0).and_then(|entry| entry.value.first().copied()).unwrap_or(0));
            bytes.push(0);
        }
        for entry in object.listed() {
            if entry.access == Access::WriteOnly {
                return Err(AbortCode::WRITE_ONLY);
            }
            bytes.extend_from_slice(&entry.value);
        }
        Ok(bytes)
    }

    /// Writes one entry by SDO in `state`.
    pub fn write(&mut self, index: u16, sub_index: u8, data: &[u8], state: AlState) -> Result<(), AbortCode> {
        self.check_write(index, sub_index, data, state)?;
        let object = self.object_mut(index).ok_or(AbortCode::OBJECT_DOES_NOT_EXIST)?;
        let entry = object.entry_mut(sub_index).ok_or(AbortCode::SUB_INDEX_DOES_NOT_EXIST)?;
        entry.value.clear();
        entry.value.extend_from_slice(data);
        if object.role == ObjectRole::History {
            self.acknowledge(sub_index, data);
        }
        Ok(())
    }

    /// Writes a whole list by SDO: first the entries, then their number; an error changes nothing.
    pub fn write_complete(&mut self, index: u16, from: u8, data: &[u8], state: AlState) -> Result<(), AbortCode> {
        let before = self.visible(index)?.clone();
        let result = self.write_parts(&before, from, data, state);
        if result.is_err()
            && let Some(object) = self.object_mut(index)
        {
            *object = before;
        }
        result
    }

    fn write_parts(&mut self, object: &Object, from: u8, data: &[u8], state: AlState) -> Result<(), AbortCode> {
        let list = matches!(object.role, ObjectRole::Assignment(_) | ObjectRole::Mapping(_));
        let mut rest = data;
        let mut count = None;
        if from == 0 {
            let (head, tail) = rest.split_at_checked(2).ok_or(AbortCode::LENGTH_TOO_SHORT)?;
            count = Some(head[0]);
            rest = tail;
        }
        if list {
            self.write(object.index, 0, &[0], state)?;
        }
        let mut written = 0u8;
        for entry in object.entries.iter().filter(|entry| entry.sub_index != 0) {
            if rest.is_empty() {
                break;
            }
            let (value, tail) = rest.split_at_checked(entry.value.len()).ok_or(AbortCode::LENGTH_TOO_SHORT)?;
            // The unused tail of a list may be sent as zeros.
            if !list || count.is_none_or(|count| written < count) {
                self.write(object.index, entry.sub_index, value, state)?;
            }
            written += 1;
            rest = tail;
        }
        if !rest.is_empty() {
            return Err(AbortCode::LENGTH_TOO_LONG);
        }
        match (list, count) {
            (true, _) => self.write(object.index, 0, &[count.unwrap_or(written)], state),
            (false, _) => Ok(()),
        }
    }

    /// Whether an SDO may write this number of bytes to an entry in `state`, for any values.
    pub fn check_access(&self, index: u16, sub_index: u8, length: usize, state: AlState) -> Result<(), AbortCode> {
        let object = self.visible(index)?;
        let entry = object.entry(sub_index).ok_or(AbortCode::SUB_INDEX_DOES_NOT_EXIST)?;
        entry.check_access(length, state)
    }

    fn check_write(&self, index: u16, sub_index: u8, data: &[u8], state: AlState) -> Result<(), AbortCode> {
        let object = self.visible(index)?;
        let entry = object.entry(sub_index).ok_or(AbortCode::SUB_INDEX_DOES_NOT_EXIST)?;
        entry.check_access(data.len(), state)?;
        entry.check_value(data)?;
        match object.role {
            ObjectRole::Plain => Ok(()),
            ObjectRole::Assignment(_) | ObjectRole::Mapping(_) => self.check_list(object, sub_index, data),
            ObjectRole::History => check_acknowledge(object, sub_index, data),
        }
    }

    fn check_list(&self, object: &Object, sub_index: u8, data: &[u8]) -> Result<(), AbortCode> {
        if sub_index == 0 {
            let count = usize::from(data[0]);
            if count >= object.entries.len() {
                return Err(AbortCode::VALUE_TOO_HIGH);
            }
            let filled =
                object.entries.iter().skip(1).take(count).all(|entry| entry.value.iter().any(|byte| *byte != 0));
            return if filled { Ok(()) } else { Err(AbortCode::VALUE_RANGE) };
        }
        if object.count() != 0 {
            return Err(AbortCode::SUB_INDEX_0_FIRST);
        }
        match object.role {
            ObjectRole::Assignment(direction) => {
                let pdo = data.first_chunk().map_or(0, |bytes| u16::from_le_bytes(*bytes));
                let known = self.object(pdo).is_some_and(|pdo| pdo.role == ObjectRole::Mapping(direction));
                if known { Ok(()) } else { Err(AbortCode::VALUE_RANGE) }
            }
            ObjectRole::Mapping(direction) => self.check_mapped(direction, data),
            ObjectRole::Plain | ObjectRole::History => Ok(()),
        }
    }

    /// Whether an entry may be mapped in this direction. Access rights without a direction permit both.
    fn check_mapped(&self, direction: PdoDirection, data: &[u8]) -> Result<(), AbortCode> {
        let mapped = MappedEntry::decode(data).ok_or(AbortCode::LENGTH_TOO_SHORT)?;
        if mapped.bit_length == 0 {
            return Err(AbortCode::CANNOT_BE_MAPPED);
        }
        if mapped.index == 0 {
            return Ok(());
        }
        let value = self.read(mapped.index, mapped.sub_index)?;
        let rights = self.object(mapped.index).and_then(|object| object.entry(mapped.sub_index)).map(Entry::rights);
        let may = |right| rights.is_some_and(|rights| rights.has(right));
        let (rx, tx) = (may(AccessRights::RX_MAPPABLE), may(AccessRights::TX_MAPPABLE));
        let directed = match direction {
            PdoDirection::Rx => rx || !tx,
            PdoDirection::Tx => tx || !rx,
        };
        let fits = usize::from(mapped.bit_length).div_ceil(8) == value.len();
        if mapped.index >= 0x2000 && fits && directed { Ok(()) } else { Err(AbortCode::CANNOT_BE_MAPPED) }
    }

    /// Sets a value from inside the device; a value of another length is truncated or filled with zeros.
    pub fn set(&mut self, index: u16, sub_index: u8, data: &[u8]) {
        if let Some(entry) = self.object_mut(index).and_then(|object| object.entry_mut(sub_index)) {
            for (place, byte) in entry.value.iter_mut().enumerate() {
                *byte = data.get(place).copied().unwrap_or(0);
            }
        }
    }

    /// Sets assignments and mappings back to those of power-on.
    pub(super) fn forget_pdos(&mut self, description: &DeviceDescription) {
        self.revision = self.revision.wrapping_add(1);
        let of_pdos = |object: &Object| matches!(object.role, ObjectRole::Assignment(_) | ObjectRole::Mapping(_));
        for object in objects::build(description).into_iter().filter(of_pdos) {
            self.objects.iter_mut().filter(|own| own.index == object.index).for_each(|own| own.clone_from(&object));
        }
    }

    /// Sets a value of any length from inside the device.
    pub fn replace(&mut self, index: u16, sub_index: u8, data: &[u8]) {
        if let Some(entry) = self.object_mut(index).and_then(|object| object.entry_mut(sub_index)) {
            entry.value = data.into();
        }
    }

    /// PDO indices that are currently assigned to a SyncManager.
    pub fn assigned(&self, sync_manager: u8) -> impl Iterator<Item = u16> {
        let object = self.object(ASSIGNMENT_BASE + u16::from(sync_manager));
        let entries = object.into_iter().flat_map(Object::listed);
        entries.filter_map(|entry| entry.value.first_chunk().map(|bytes| u16::from_le_bytes(*bytes)))
    }

    /// Entries currently mapped to a PDO.
    pub fn mapped(&self, pdo: u16) -> impl Iterator<Item = MappedEntry> {
        self.object(pdo).into_iter().flat_map(Object::listed).filter_map(|entry| MappedEntry::decode(&entry.value))
    }

    /// Sum of the PDOs assigned to a SyncManager, in bits.
    pub fn assigned_bits(&self, sync_manager: u8) -> u32 {
        self.assigned(sync_manager).flat_map(|pdo| self.mapped(pdo)).map(|entry| u32::from(entry.bit_length)).sum()
    }
}

#[cfg(test)]
mod tests;
