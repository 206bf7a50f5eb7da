//! What was read of an SII: its fixed area, the categories that the engine uses, and how their chain ended.

use alloc::vec::Vec;

use ringcat_wire::sii::{Category, CategoryKind, SiiHeader};

/// What was read of an SII.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SiiContents {
    /// The fixed area; its reserved words from 0x24 on are not read and zero.
    pub header: SiiHeader,
    /// The categories that were wanted, each with the byte of its header and its data.
    pub categories: Vec<(CategoryKind, usize, Vec<u8>)>,
    /// How the chain of categories ended.
    pub end: ChainEnd,
}

/// How a chain of categories ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChainEnd {
    /// With the end marker at this byte, or with the last word of the EEPROM.
    Sound {
        /// The first byte that is no category.
        at: usize,
    },
    /// With the end marker at this byte, behind the end of the EEPROM by its own size word.
    BehindSize {
        /// The end marker.
        at: usize,
    },
    /// Without an end marker.
    Open {
        /// Where it was expected.
        at: usize,
    },
    /// With a category that is longer than what is left of the EEPROM.
    Beyond {
        /// What it would have held.
        kind: CategoryKind,
        /// Its header.
        at: usize,
        /// Bytes that it announces.
        announced: usize,
        /// Bytes that are left.
        left: usize,
    },
    /// The EEPROM cannot be read at all.
    Unreadable,
}

impl SiiContents {
    /// Of an EEPROM that cannot be read: as if it were erased.
    pub(in crate::procedures) fn unreadable() -> SiiContents {
        let header = SiiHeader::decode(&[0xFF; SiiHeader::LEN]);
        SiiContents { header, categories: Vec::new(), end: ChainEnd::Unreadable }
    }

    /// The categories that were wanted, as they lie in the EEPROM.
    pub fn categories(&self) -> impl Iterator<Item = Category<'_>> {
        self.categories.iter().map(|(kind, offset, data)| Category { kind: *kind, offset: *offset, data })
    }
}
