//! Objects of descriptions and dictionaries: a name, rules, entries (protocol 6.3).

pub use ringcat_wire::mailbox::coe::pdo_objects::ASSIGNMENT_BASE;
use ringcat_wire::mailbox::coe::{DataType, ObjectCode};
use ringcat_wire::sii::PdoDirection;

use super::entry::{Access, Entry};
use crate::data_type;

/// Maximum number of entries of a configurable mapping.
pub(super) const MAX_MAPPED_ENTRIES: usize = 32;

/// Rules in addition to the access rights of the entries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ObjectRole {
    /// None.
    Plain,
    /// A list of PDOs of this direction: subindex 0 must be 0 while the others are written.
    Assignment(PdoDirection),
    /// A list of mapped entries of this direction, with the same rule.
    Mapping(PdoDirection),
    /// The diagnosis history: a write to subindex 3 acknowledges or clears.
    History,
}

/// One object.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Object {
    /// Index.
    pub index: u16,
    /// Name.
    pub name: String,
    /// Extra rules.
    pub role: ObjectRole,
    /// Its entries, subindices ascending.
    pub entries: Vec<Entry>,
}

impl Object {
    /// An object with one value at subindex 0.
    pub fn variable(index: u16, name: &str, data_type: u8, access: Access, value: &[u8]) -> Object {
        let entries = vec![Entry::new(0, data_type, access, value)];
        Object { index, name: name.into(), role: ObjectRole::Plain, entries }
    }

    /// An array or record: subindex 0, the number of entries, is added; the entries follow from subindex 1.
    pub fn record(index: u16, name: &str, entries: Vec<Entry>) -> Object {
        let count = entries.last().map_or(0, |entry| entry.sub_index);
        let mut all = vec![Entry::new(0, data_type::U8, Access::ReadOnly, &[count])];
        all.extend(entries);
        Object { index, name: name.into(), role: ObjectRole::Plain, entries: all }
    }

    /// Its object code in SDO information: a single value is a variable, entries of one type an array.
    pub fn code(&self) -> ObjectCode {
        let mut values = self.entries.iter().filter(|entry| entry.sub_index != 0);
        let Some(first) = values.next() else {
            let domain = self.entries.first().is_some_and(|entry| entry.data_type() == DataType::DOMAIN);
            return if domain { ObjectCode::Domain } else { ObjectCode::Variable };
        };
        let alike = values.all(|entry| entry.data_type == first.data_type);
        if alike && !matches!(self.role, ObjectRole::Mapping(_)) { ObjectCode::Array } else { ObjectCode::Record }
    }

    /// Data type of the whole object: that of its entries if they are equal.
    pub fn data_type(&self) -> DataType {
        match (self.code(), self.role, self.index) {
            (_, ObjectRole::Mapping(_), _) => DataType::PDO_MAPPING,
            (_, _, 0x1018) => DataType::IDENTITY,
            (ObjectCode::Record, _, _) => DataType(0),
            _ => self.entries.last().map_or(DataType(0), Entry::data_type),
        }
    }

    /// Takes the names that the device description has for this object and its entries.
    pub fn named_by(&mut self, description: &Object) {
        if !description.name.is_empty() {
            self.name.clone_from(&description.name);
        }
        let is_single = description.entries.len() < 2;
        for entry in &mut self.entries {
            match description.entry(entry.sub_index) {
                Some(described) => entry.name.clone_from(&described.name),
                // The list of the description is shorter.
                None if !is_single => entry.name = format!("SubIndex {:03}", entry.sub_index),
                None => {}
            }
        }
    }

    /// Finds an entry.
    pub fn entry(&self, sub_index: u8) -> Option<&Entry> {
        self.entries.iter().find(|entry| entry.sub_index == sub_index)
    }

    pub(super) fn entry_mut(&mut self, sub_index: u8) -> Option<&mut Entry> {
        self.entries.iter_mut().find(|entry| entry.sub_index == sub_index)
    }

    /// Value of subindex 0 of a list.
    pub(super) fn count(&self) -> usize {
        self.entry(0).and_then(|entry| entry.value.first()).map_or(0, |count| usize::from(*count))
    }

    /// The valid entries of a list.
    pub(super) fn listed(&self) -> impl Iterator<Item = &Entry> {
        self.entries.iter().filter(|entry| entry.sub_index != 0).take(self.count())
    }
}

/// One mapped entry of a PDO.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MappedEntry {
    /// Object index, 0 for a gap.
    pub index: u16,
    /// Subindex.
    pub sub_index: u8,
    /// Length in bits.
    pub bit_length: u8,
}

impl MappedEntry {
    pub(super) fn decode(bytes: &[u8]) -> Option<MappedEntry> {
        let [bit_length, sub_index, low, high] = bytes.first_chunk().copied()?;
        Some(MappedEntry { index: u16::from_le_bytes([low, high]), sub_index, bit_length })
    }

    pub(super) fn encode(self) -> [u8; 4] {
        let [low, high] = self.index.to_le_bytes();
        [self.bit_length, self.sub_index, low, high]
    }
}
