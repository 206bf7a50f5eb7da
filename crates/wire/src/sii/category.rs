//! The list of categories after the fixed area (protocol 4.2).

use core::fmt;

/// Type of a category.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum CategoryKind {
    /// 0: no content, skipped.
    Nop,
    /// 10: [`super::Strings`].
    Strings,
    /// 20: data types.
    DataTypes,
    /// 30: [`super::General`].
    General,
    /// 40: [`super::FmmuUsages`].
    Fmmu,
    /// 41: [`super::SiiSyncManagers`].
    SyncManager,
    /// 50: [`super::Pdos`] sent by the SubDevice (TxPDO).
    TxPdo,
    /// 51: [`super::Pdos`] received by the SubDevice (RxPDO).
    RxPdo,
    /// 60: [`super::DcModes`].
    Dc,
    /// 0xFFFF: end of the list, without a length field.
    End,
    /// Any other code; vendor-specific if bit 15 is set.
    Other(u16),
}

impl CategoryKind {
    /// From the type word of a category.
    pub const fn from_code(code: u16) -> CategoryKind {
        match code {
            0 => CategoryKind::Nop,
            10 => CategoryKind::Strings,
            20 => CategoryKind::DataTypes,
            30 => CategoryKind::General,
            40 => CategoryKind::Fmmu,
            41 => CategoryKind::SyncManager,
            50 => CategoryKind::TxPdo,
            51 => CategoryKind::RxPdo,
            60 => CategoryKind::Dc,
            0xFFFF => CategoryKind::End,
            code => CategoryKind::Other(code),
        }
    }

    /// The type word.
    pub const fn code(self) -> u16 {
        match self {
            CategoryKind::Nop => 0,
            CategoryKind::Strings => 10,
            CategoryKind::DataTypes => 20,
            CategoryKind::General => 30,
            CategoryKind::Fmmu => 40,
            CategoryKind::SyncManager => 41,
            CategoryKind::TxPdo => 50,
            CategoryKind::RxPdo => 51,
            CategoryKind::Dc => 60,
            CategoryKind::End => 0xFFFF,
            CategoryKind::Other(code) => code,
        }
    }

    /// Whether the vendor defines the content of the category.
    pub const fn is_vendor_specific(self) -> bool {
        matches!(self, CategoryKind::Other(code) if code & 0x8000 != 0)
    }
}

impl fmt::Display for CategoryKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            CategoryKind::Nop => "NOP",
            CategoryKind::Strings => "STRINGS",
            CategoryKind::DataTypes => "DATATYPES",
            CategoryKind::General => "GENERAL",
            CategoryKind::Fmmu => "FMMU",
            CategoryKind::SyncManager => "SYNCM",
            CategoryKind::TxPdo => "TXPDO",
            CategoryKind::RxPdo => "RXPDO",
            CategoryKind::Dc => "DC",
            CategoryKind::End => "END",
            CategoryKind::Other(code) => return write!(f, "{code:#06x}"),
        })
    }
}

/// The two words before the data of a category.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct CategoryHeader {
    /// Type of the category.
    pub kind: CategoryKind,
    /// Words of data; not defined if the type is [`CategoryKind::End`].
    pub words: u16,
}

impl CategoryHeader {
    /// Bytes of the header.
    pub const LEN: usize = 4;

    /// Decodes two words.
    pub const fn decode(bytes: &[u8; Self::LEN]) -> CategoryHeader {
        CategoryHeader {
            kind: CategoryKind::from_code(u16::from_le_bytes([bytes[0], bytes[1]])),
            words: u16::from_le_bytes([bytes[2], bytes[3]]),
        }
    }

    /// Encodes into two words.
    pub const fn encode(&self) -> [u8; Self::LEN] {
        let kind = self.kind.code().to_le_bytes();
        let words = self.words.to_le_bytes();
        [kind[0], kind[1], words[0], words[1]]
    }

    /// Bytes of data after the header.
    pub const fn data_len(&self) -> usize {
        self.words as usize * 2
    }
}

/// A category inside an image, borrowed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Category<'a> {
    /// Type of the category.
    pub kind: CategoryKind,
    /// Byte offset of its header in the image.
    pub offset: usize,
    /// Its data, without the header.
    pub data: &'a [u8],
}

impl Category<'_> {
    /// Byte offset of its data in the image.
    pub const fn data_offset(&self) -> usize {
        self.offset + CategoryHeader::LEN
    }
}

/// Iterator over the categories of an image, in order, without the end marker.
#[derive(Clone, Debug)]
pub struct Categories<'a> {
    image: &'a [u8],
    at: usize,
}

impl<'a> Categories<'a> {
    /// Starts at the first category header, at byte `at` of the image.
    pub(super) const fn new(image: &'a [u8], at: usize) -> Categories<'a> {
        Categories { image, at }
    }

    /// The categories of an image, without a check of its fixed area; ends at invalid bytes.
    pub const fn of_image(image: &'a [u8]) -> Categories<'a> {
        Categories::new(image, super::SiiHeader::LEN)
    }

    /// Byte offset of the next category header, of the end marker, or of invalid bytes.
    pub(super) const fn position(&self) -> usize {
        self.at
    }
}

impl<'a> Iterator for Categories<'a> {
    type Item = Category<'a>;

    fn next(&mut self) -> Option<Category<'a>> {
        let offset = self.at;
        let rest = self.image.get(offset..)?;
        let (header, rest) = rest.split_first_chunk::<{ CategoryHeader::LEN }>()?;
        let header = CategoryHeader::decode(header);
        if header.kind == CategoryKind::End {
            return None;
        }
        let data = rest.get(..header.data_len())?;
        self.at = offset + CategoryHeader::LEN + data.len();
        Some(Category { kind: header.kind, offset, data })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_header_of_a_sync_manager_category_has_the_expected_bytes() {
        let header = CategoryHeader { kind: CategoryKind::SyncManager, words: 16 };
        assert_eq!(header.encode(), [41, 0, 16, 0]);
        assert_eq!(CategoryHeader::decode(&[41, 0, 16, 0]), header);
        assert_eq!(header.data_len(), 32);
    }

    // covers: 4.2, codec-sii
    #[test]
    fn only_unknown_kinds_with_bit_15_are_vendor_specific() {
        assert!(CategoryKind::from_code(0x8001).is_vendor_specific());
        assert!(!CategoryKind::from_code(3).is_vendor_specific());
        assert!(!CategoryKind::End.is_vendor_specific());
    }

    proptest! {
        #[test]
        fn any_kind_round_trips(code in any::<u16>()) {
            prop_assert_eq!(CategoryKind::from_code(code).code(), code);
        }

        #[test]
        fn any_header_round_trips(bytes in any::<[u8; CategoryHeader::LEN]>()) {
            prop_assert_eq!(CategoryHeader::decode(&bytes).encode(), bytes);
        }
    }
}
