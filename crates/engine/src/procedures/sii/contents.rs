//! Contents of an SII: its fixed area, the categories of an extent, and the end of their chain.

use alloc::vec::Vec;

use ringcat_wire::sii::{Category, CategoryKind, SiiHeader};

use crate::info::SiiExtent;

/// Words before the categories.
pub(super) const HEADER_WORDS: u32 = (SiiHeader::LEN / 2) as u32;

/// Contents of an SII.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SiiContents {
    /// The fixed area; its reserved words from 0x24 on are not read and zero.
    pub header: SiiHeader,
    /// How much of the categories was read.
    pub extent: SiiExtent,
    /// The categories of the extent, each with the byte address of its header and its data.
    pub categories: Vec<(CategoryKind, usize, Vec<u8>)>,
    /// Whether the chain has categories of larger extents, which were not read.
    pub has_more: bool,
    /// The end of the chain of categories.
    pub end: ChainEnd,
}

/// The end of a chain of categories.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChainEnd {
    /// With the end marker at this byte, or with the last word of the EEPROM.
    Sound {
        /// The first byte behind the categories.
        at: usize,
    },
    /// With the end marker at this byte, behind the size given in the EEPROM.
    BehindSize {
        /// The end marker.
        at: usize,
    },
    /// No end marker was found.
    Open {
        /// The byte at which it was expected.
        at: usize,
    },
    /// With a category that is longer than the rest of the EEPROM.
    Beyond {
        /// Its type.
        kind: CategoryKind,
        /// The byte address of its header.
        at: usize,
        /// Bytes according to its header.
        announced: usize,
        /// Bytes until the end of the EEPROM.
        left: usize,
    },
    /// The EEPROM cannot be read at all.
    Unreadable,
}

impl SiiContents {
    /// For an EEPROM that cannot be read: as if it were erased.
    pub(in crate::procedures) fn unreadable() -> SiiContents {
        let header = SiiHeader::decode(&[0xFF; SiiHeader::LEN]);
        SiiContents {
            header,
            extent: SiiExtent::Complete,
            categories: Vec::new(),
            has_more: false,
            end: ChainEnd::Unreadable,
        }
    }

    /// The categories of the extent, in the order of the EEPROM.
    pub fn categories(&self) -> impl Iterator<Item = Category<'_>> {
        self.categories.iter().map(|(kind, offset, data)| Category { kind: *kind, offset: *offset, data })
    }
}
