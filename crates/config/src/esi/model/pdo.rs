//! PDOs of devices and modules.

use super::names::Names;

/// An index that shifts with the slot (protocol ES-64).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct SlotIndex {
    /// The index in slot 0.
    pub index: u16,
    /// It shifts with the slot.
    pub by_slot: bool,
    /// It shifts with the slot group.
    pub by_group: bool,
}

/// `RxPdo` or `TxPdo`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Pdo {
    /// Line in the file.
    pub line: u32,
    /// Index of the mapping object.
    pub index: SlotIndex,
    /// Name.
    pub name: Names,
    /// SyncManager to which it is assigned by default.
    pub sync_manager: Option<u8>,
    /// Its entries cannot be changed.
    pub is_fixed: bool,
    /// It has to be assigned.
    pub is_mandatory: bool,
    /// It has no object in the device: information for tools.
    pub is_virtual: bool,
    /// A module may bring a PDO of the same index, which replaces it.
    pub overwritten_by_module: bool,
    /// PDOs that exclude it.
    pub excludes: Vec<SlotIndex>,
    /// SyncManagers to which it must not be assigned.
    pub excluded_sync_managers: Vec<u8>,
    /// Sync unit.
    pub sync_unit: Option<u8>,
    /// Oversampling: default factor, smallest, largest, distance of the indices of copies.
    pub oversampling: Option<[u32; 4]>,
    /// Number of the safety connection.
    pub safety_connection: Option<u32>,
    /// Its entries.
    pub entries: Vec<PdoEntry>,
}

impl Pdo {
    /// Sum of the entries in bits.
    pub fn bit_length(&self) -> u32 {
        self.entries.iter().fold(0, |bits: u32, entry| bits.saturating_add(entry.bit_length.into()))
    }
}

/// An entry of a PDO; index 0 is a gap.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PdoEntry {
    /// Index of the object, 0 for a gap.
    pub index: SlotIndex,
    /// Subindex of the object.
    pub sub_index: u8,
    /// Number of bits.
    pub bit_length: u16,
    /// Name.
    pub name: Names,
    /// Data type as written; empty for most gaps.
    pub data_type: String,
    /// The entry cannot be removed.
    pub is_fixed: bool,
}
