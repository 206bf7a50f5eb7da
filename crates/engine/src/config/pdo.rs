//! PDOs that the application declares: assignments to SyncManagers, and mappings.

use alloc::vec::Vec;
use core::hash::{Hash, Hasher};

use crate::info::Direction;

/// An entry of a PDO mapping.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub struct PdoEntry {
    /// Index of the object; 0 is a gap.
    pub index: u16,
    /// Subindex of the object.
    pub sub_index: u8,
    /// Length in bits.
    pub bit_length: u8,
}

/// A PDO and its mapping.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct PdoMapping {
    /// Index of the PDO mapping object.
    pub index: u16,
    /// Its entries; `None` takes those of the SII.
    pub entries: Option<Vec<PdoEntry>>,
    /// The SubDevice does not permit other entries: its mapping object is never written.
    pub fixed: bool,
}

/// Without `fixed` the digest is the same as before this field existed.
impl Hash for PdoMapping {
    fn hash<H: Hasher>(&self, state: &mut H) {
        let PdoMapping { index, entries, fixed } = self;
        (index, entries).hash(state);
        if *fixed {
            fixed.hash(state);
        }
    }
}

/// The PDOs of one SyncManager.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub struct PdoAssignment {
    /// The SyncManager.
    pub sync_manager: u8,
    /// Its direction.
    pub direction: Direction,
    /// Its PDOs in order; an empty list disables it.
    pub pdos: Vec<PdoMapping>,
}

impl PdoAssignment {
    /// The PDOs of a SyncManager, in order.
    pub fn new(sync_manager: u8, direction: Direction, pdos: Vec<PdoMapping>) -> PdoAssignment {
        PdoAssignment { sync_manager, direction, pdos }
    }
}

impl PdoMapping {
    /// A PDO with the entries of the SII.
    pub fn from_sii(index: u16) -> PdoMapping {
        PdoMapping { index, entries: None, fixed: false }
    }

    /// A PDO with these entries.
    pub fn of(index: u16, entries: impl Into<Vec<PdoEntry>>) -> PdoMapping {
        PdoMapping { index, entries: Some(entries.into()), fixed: false }
    }

    /// Sets [`PdoMapping::fixed`].
    #[must_use]
    pub fn with_fixed(mut self, fixed: bool) -> PdoMapping {
        self.fixed = fixed;
        self
    }
}

impl PdoEntry {
    /// An entry of this length in bits.
    pub const fn new(index: u16, sub_index: u8, bit_length: u8) -> PdoEntry {
        PdoEntry { index, sub_index, bit_length }
    }
}
