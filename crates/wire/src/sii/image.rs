//! A whole SII image: the fixed area, then categories up to the end marker (protocol 4.1, 4.2).

use core::fmt;

use super::category::{Categories, Category, CategoryHeader, CategoryKind};
use super::dc::{DcMode, DcModes};
use super::fmmu::{FmmuUsage, FmmuUsages};
use super::general::General;
use super::header::SiiHeader;
use super::pdo::{Pdo, PdoDirection, Pdos};
use super::strings::Strings;
use super::sync_manager::{SiiSyncManager, SiiSyncManagers};

/// The reason for which bytes are not an SII image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SiiError {
    /// Shorter than the fixed area.
    Short {
        /// Bytes of the fixed area.
        expected: usize,
        /// Bytes available.
        got: usize,
    },
    /// The low byte of word 7 does not match the first seven words.
    Checksum {
        /// The checksum of the first seven words.
        expected: u8,
        /// Word 7.
        got: u16,
    },
    /// The image ends inside a category header.
    CategoryHeader {
        /// Byte offset of the header.
        offset: usize,
        /// Bytes available for it.
        got: usize,
    },
    /// A category extends beyond the image.
    Category {
        /// Kind of the category.
        kind: CategoryKind,
        /// Byte offset of its header.
        offset: usize,
        /// Bytes of data in its header.
        expected: usize,
        /// Bytes available for them.
        got: usize,
    },
}

impl fmt::Display for SiiError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            SiiError::Short { expected, got } => write!(f, "SII too short: expected {expected} bytes, got {got}"),
            SiiError::Checksum { expected, got } => {
                write!(f, "SII checksum: expected {expected:#04x}, word 7 is {got:#06x}")
            }
            SiiError::CategoryHeader { offset, got } => {
                write!(f, "SII ends inside the category header at byte {offset}: expected 4 bytes, got {got}")
            }
            SiiError::Category { kind, offset, expected, got } => {
                write!(f, "SII category {kind} at byte {offset} announces {expected} bytes, {got} are left")
            }
        }
    }
}

impl core::error::Error for SiiError {}

/// An SII image with a valid checksum and with all categories inside the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sii<'a> {
    image: &'a [u8],
    header: SiiHeader,
    used: usize,
    /// Whether the list of categories ended with the end marker, not with the end of the image.
    pub end_marker: bool,
}

impl<'a> Sii<'a> {
    /// Checks the checksum and the list of categories. The decoders check the content of the categories.
    pub fn parse(image: &'a [u8]) -> Result<Sii<'a>, SiiError> {
        let short = SiiError::Short { expected: SiiHeader::LEN, got: image.len() };
        let header = SiiHeader::decode(image.first_chunk().ok_or(short)?);
        if !header.checksum_ok() {
            return Err(SiiError::Checksum { expected: header.computed_checksum(), got: header.checksum });
        }
        let mut categories = Categories::new(image, SiiHeader::LEN);
        categories.by_ref().for_each(drop);
        let offset = categories.position();
        let rest = &image[offset..];
        if rest.is_empty() {
            return Ok(Sii { image, header, used: offset, end_marker: false });
        }
        // The end marker is one word; no data has to follow it.
        if rest.starts_with(&CategoryKind::End.code().to_le_bytes()) {
            return Ok(Sii { image, header, used: offset + 2, end_marker: true });
        }
        match rest.split_first_chunk() {
            None => Err(SiiError::CategoryHeader { offset, got: rest.len() }),
            Some((bytes, left)) => {
                let category = CategoryHeader::decode(bytes);
                let expected = category.data_len();
                Err(SiiError::Category { kind: category.kind, offset, expected, got: left.len() })
            }
        }
    }

    /// The fixed area.
    pub const fn header(&self) -> &SiiHeader {
        &self.header
    }

    /// Bytes from the start of the image to the end of the list, including the end marker.
    pub const fn used(&self) -> usize {
        self.used
    }

    /// All categories in order, including unknown and vendor-specific ones.
    pub const fn categories(&self) -> Categories<'a> {
        Categories::new(self.image, SiiHeader::LEN)
    }

    /// The data of every category of a kind.
    fn all(&self, kind: CategoryKind) -> impl Iterator<Item = &'a [u8]> + Clone + use<'a> {
        self.categories().filter(move |category: &Category<'_>| category.kind == kind).map(|category| category.data)
    }

    /// The strings; none if the image has no such category.
    pub fn strings(&self) -> Strings<'a> {
        Strings::new(self.all(CategoryKind::Strings).next().unwrap_or_default())
    }

    /// The general category.
    pub fn general(&self) -> Option<General> {
        General::decode(self.all(CategoryKind::General).next()?)
    }

    /// The usage of each FMMU, FMMU 0 first. A padding byte at the end of the category appears as an additional entry.
    pub fn fmmu_usages(&self) -> impl Iterator<Item = FmmuUsage> + Clone + use<'a> {
        self.all(CategoryKind::Fmmu).flat_map(FmmuUsages::new)
    }

    /// The SyncManagers, SM 0 first.
    pub fn sync_managers(&self) -> impl Iterator<Item = SiiSyncManager> + Clone + use<'a> {
        self.all(CategoryKind::SyncManager).flat_map(SiiSyncManagers::new)
    }

    /// The PDOs of one direction; several categories may contain them.
    pub fn pdos(&self, direction: PdoDirection) -> impl Iterator<Item = Pdo<'a>> + Clone + use<'a> {
        self.all(direction.category()).flat_map(Pdos::new)
    }

    /// The operation modes of the distributed clock.
    pub fn dc_modes(&self) -> impl Iterator<Item = DcMode> + Clone + use<'a> {
        self.all(CategoryKind::Dc).flat_map(DcModes::new)
    }
}
