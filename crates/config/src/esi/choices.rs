//! What a user chooses for a device of a description.

use super::model::Transition;

/// Choices for a device; the default leaves everything as the description has it by default.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Choices {
    /// Operation mode of the clock by its name, its description, or its number as in "#3"; `None`: that of its
    /// modules, else the first.
    pub mode: Option<String>,
    /// The module of each slot, as for [`place_modules`](super::place_modules).
    pub modules: Vec<Option<String>>,
    /// PDOs that are assigned besides those by default.
    pub with: Vec<PdoChoice>,
    /// PDOs that are not assigned although they are by default.
    pub without: Vec<u16>,
    /// Entries of PDOs in place of those of the description.
    pub mappings: Vec<MappingChoice>,
    /// Oversampling factors of PDOs.
    pub samples: Vec<SamplesChoice>,
    /// Values of objects that are written at start-up.
    pub parameters: Vec<Parameter>,
    /// Language of names, an LcId.
    pub language: u32,
}

/// A PDO that is assigned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct PdoChoice {
    /// Its index.
    pub index: u16,
    /// The SyncManager; `None`: that of the description, else the only one of its direction.
    pub sync_manager: Option<u8>,
}

/// Entries of a PDO.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct MappingChoice {
    /// Index of the PDO.
    pub index: u16,
    /// Its entries in order.
    pub entries: Vec<EntryChoice>,
}

/// An entry of a PDO.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct EntryChoice {
    /// Index of the object; 0 is a gap.
    pub index: u16,
    /// Subindex of the object.
    pub sub_index: u8,
    /// Bits; `None`: those of the object in the dictionary.
    pub bits: Option<u8>,
}

/// The oversampling factor of a PDO.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct SamplesChoice {
    /// Index of the PDO.
    pub index: u16,
    /// Samples in a cycle.
    pub factor: u32,
}

/// A value that is written at start-up.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Parameter {
    /// When it is written.
    pub transition: Transition,
    /// Index of the object.
    pub index: u16,
    /// Its subindex.
    pub sub_index: u8,
    /// The value, little-endian.
    pub data: Vec<u8>,
}

impl Default for Choices {
    fn default() -> Choices {
        Choices {
            mode: None,
            modules: Vec::new(),
            with: Vec::new(),
            without: Vec::new(),
            mappings: Vec::new(),
            samples: Vec::new(),
            parameters: Vec::new(),
            language: 1033,
        }
    }
}

impl PdoChoice {
    /// A PDO in a SyncManager; `None` as in the description.
    pub const fn new(index: u16, sync_manager: Option<u8>) -> PdoChoice {
        PdoChoice { index, sync_manager }
    }
}

impl MappingChoice {
    /// Entries of a PDO.
    pub const fn new(index: u16, entries: Vec<EntryChoice>) -> MappingChoice {
        MappingChoice { index, entries }
    }
}

impl EntryChoice {
    /// An entry; without bits it has those of its object.
    pub const fn new(index: u16, sub_index: u8, bits: Option<u8>) -> EntryChoice {
        EntryChoice { index, sub_index, bits }
    }
}

impl SamplesChoice {
    /// A factor of a PDO.
    pub const fn new(index: u16, factor: u32) -> SamplesChoice {
        SamplesChoice { index, factor }
    }
}

impl Parameter {
    /// A value that is written from PREOP to SAFEOP.
    pub fn new(index: u16, sub_index: u8, data: impl Into<Vec<u8>>) -> Parameter {
        Parameter { transition: Transition::Ps, index, sub_index, data: data.into() }
    }

    /// Sets [`Parameter::transition`].
    #[must_use]
    pub const fn at(mut self, transition: Transition) -> Parameter {
        self.transition = transition;
        self
    }
}
