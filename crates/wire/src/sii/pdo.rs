//! Categories TXPDO and RXPDO: consecutive PDOs, each followed by its entries (protocol 4.5).

use super::category::CategoryKind;

/// Direction of a PDO, seen from the SubDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PdoDirection {
    /// From the SubDevice: inputs.
    Tx,
    /// To the SubDevice: outputs.
    Rx,
}

impl PdoDirection {
    /// The category of such PDOs.
    pub const fn category(self) -> CategoryKind {
        match self {
            PdoDirection::Tx => CategoryKind::TxPdo,
            PdoDirection::Rx => CategoryKind::RxPdo,
        }
    }
}

const NOT_ASSIGNED: u8 = 0xFF;

/// A PDO inside a category, borrowed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pdo<'a> {
    /// Index of the PDO mapping object.
    pub index: u16,
    /// Number of entries.
    pub entry_count: u8,
    /// SyncManager to which it is assigned by default.
    pub sync_manager: Option<u8>,
    /// Synchronisation byte.
    pub synchronisation: u8,
    /// String index of the name, 0 for none.
    pub name: u8,
    /// Flags.
    pub flags: u16,
    entries: &'a [u8],
}

impl<'a> Pdo<'a> {
    /// Bytes of a PDO without its entries.
    pub const HEADER_LEN: usize = 8;
    /// Bit of [`Pdo::flags`]: the PDO has to be assigned.
    pub const MANDATORY: u16 = 0x0001;
    /// Bit of [`Pdo::flags`]: the PDO has several samples of a cycle.
    pub const OVERSAMPLING: u16 = 0x0004;
    /// Bit of [`Pdo::flags`]: the entries of the PDO cannot be changed.
    pub const FIXED: u16 = 0x0010;
    /// Bit of [`Pdo::flags`]: the PDO is for tools, the SubDevice has no object for it.
    pub const VIRTUAL: u16 = 0x0020;
    /// Bit of [`Pdo::flags`]: the index depends on the slot.
    pub const BY_SLOT: u16 = 0x0200;
    /// Bit of [`Pdo::flags`]: the index depends on the group of the slot.
    pub const BY_SLOT_GROUP: u16 = 0x0400;
    /// Bit of [`Pdo::flags`]: modules replace the PDO.
    pub const OVERWRITTEN_BY_MODULE: u16 = 0x0800;

    /// Its entries in order.
    pub const fn entries(&self) -> PdoEntries<'a> {
        PdoEntries { data: self.entries }
    }

    /// Sum of the bit lengths of its entries, including gaps.
    pub fn bit_length(&self) -> u32 {
        self.entries().map(|entry| u32::from(entry.bit_length)).sum()
    }

    fn split(data: &'a [u8]) -> Option<(Pdo<'a>, &'a [u8])> {
        let (h, rest) = data.split_first_chunk::<{ Pdo::HEADER_LEN }>()?;
        let (entries, rest) = rest.split_at_checked(usize::from(h[2]) * PdoEntry::LEN)?;
        let pdo = Pdo {
            index: u16::from_le_bytes([h[0], h[1]]),
            entry_count: h[2],
            sync_manager: (h[3] != NOT_ASSIGNED).then_some(h[3]),
            synchronisation: h[4],
            name: h[5],
            flags: u16::from_le_bytes([h[6], h[7]]),
            entries,
        };
        Some((pdo, rest))
    }
}

/// One entry of a PDO.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct PdoEntry {
    /// Index of the object; 0 is a gap.
    pub index: u16,
    /// Subindex of the object.
    pub sub_index: u8,
    /// String index of the name, 0 for none.
    pub name: u8,
    /// CoE data type.
    pub data_type: u8,
    /// Number of bits.
    pub bit_length: u8,
    /// Flags.
    pub flags: u16,
}

impl PdoEntry {
    /// Bytes of an entry.
    pub const LEN: usize = 8;

    /// Decodes an entry; every pattern is valid.
    pub const fn decode(b: &[u8; Self::LEN]) -> PdoEntry {
        PdoEntry {
            index: u16::from_le_bytes([b[0], b[1]]),
            sub_index: b[2],
            name: b[3],
            data_type: b[4],
            bit_length: b[5],
            flags: u16::from_le_bytes([b[6], b[7]]),
        }
    }

    /// Encodes an entry.
    pub const fn encode(&self) -> [u8; Self::LEN] {
        let index = self.index.to_le_bytes();
        let flags = self.flags.to_le_bytes();
        [index[0], index[1], self.sub_index, self.name, self.data_type, self.bit_length, flags[0], flags[1]]
    }

    /// Whether its bytes are those of an erased EEPROM.
    pub fn is_erased(&self) -> bool {
        self.encode() == [0xFF; Self::LEN]
    }

    /// Whether the entry is a gap: bits without an object.
    pub const fn is_gap(&self) -> bool {
        self.index == 0
    }
}

/// Iterator over the PDOs of a category. Ends at a PDO that would extend beyond the category.
#[derive(Clone, Debug)]
pub struct Pdos<'a> {
    data: &'a [u8],
}

impl<'a> Pdos<'a> {
    /// Reads the data of a category.
    pub const fn new(data: &'a [u8]) -> Pdos<'a> {
        Pdos { data }
    }

    /// The bytes not read yet; empty after the last PDO of a valid category.
    pub const fn rest(&self) -> &'a [u8] {
        self.data
    }
}

impl<'a> Iterator for Pdos<'a> {
    type Item = Pdo<'a>;

    fn next(&mut self) -> Option<Pdo<'a>> {
        let (pdo, rest) = Pdo::split(self.data)?;
        self.data = rest;
        Some(pdo)
    }
}

/// Iterator over the entries of a PDO.
#[derive(Clone, Debug)]
pub struct PdoEntries<'a> {
    data: &'a [u8],
}

impl Iterator for PdoEntries<'_> {
    type Item = PdoEntry;

    fn next(&mut self) -> Option<PdoEntry> {
        let (entry, rest) = self.data.split_first_chunk()?;
        self.data = rest;
        Some(PdoEntry::decode(entry))
    }
}

/// A PDO to write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PdoDescription<'a> {
    /// Index of the PDO mapping object.
    pub index: u16,
    /// SyncManager to which it is assigned by default.
    pub sync_manager: Option<u8>,
    /// Synchronisation byte.
    pub synchronisation: u8,
    /// String index of the name, 0 for none.
    pub name: u8,
    /// Flags.
    pub flags: u16,
    /// Its entries, at most 255.
    pub entries: &'a [PdoEntry],
}

impl PdoDescription<'_> {
    /// The bytes before the entries; `None` if there are too many entries.
    pub(super) fn encode_header(&self) -> Option<[u8; Pdo::HEADER_LEN]> {
        let count = u8::try_from(self.entries.len()).ok()?;
        let index = self.index.to_le_bytes();
        let flags = self.flags.to_le_bytes();
        let sync_manager = self.sync_manager.unwrap_or(NOT_ASSIGNED);
        Some([index[0], index[1], count, sync_manager, self.synchronisation, self.name, flags[0], flags[1]])
    }

    /// Bytes of the PDO with its entries.
    pub(super) const fn len(&self) -> usize {
        Pdo::HEADER_LEN + self.entries.len() * PdoEntry::LEN
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    /// PDO 0x1A00 in SM 3 with a bit of 0x6000:01 and a gap of 15 bits, then PDO 0x1A01, not assigned, without entries.
    const LITERAL: [u8; 32] = [
        0x00, 0x1A, 0x02, 0x03, 0x00, 0x05, 0x11, 0x00, // PDO 0x1A00
        0x00, 0x60, 0x01, 0x06, 0x01, 0x01, 0x00, 0x00, // 0x6000:01 BOOL
        0x00, 0x00, 0x00, 0x00, 0x00, 0x0F, 0x00, 0x00, // gap
        0x01, 0x1A, 0x00, 0xFF, 0x02, 0x00, 0x00, 0x01, // PDO 0x1A01
    ];

    // covers: 4.5, codec-sii
    #[test]
    fn two_pdos_follow_each_other_in_one_category() {
        let mut pdos = Pdos::new(&LITERAL);
        let [first, second] = pdos.by_ref().collect::<Vec<_>>().try_into().unwrap();
        assert_eq!((first.index, first.entry_count, first.sync_manager), (0x1A00, 2, Some(3)));
        assert_eq!((first.synchronisation, first.name, first.flags), (0, 5, 0x0011));
        let entries: Vec<_> = first.entries().collect();
        let boolean = PdoEntry { index: 0x6000, sub_index: 1, name: 6, data_type: 1, bit_length: 1, flags: 0 };
        let gap = PdoEntry { bit_length: 15, ..PdoEntry::default() };
        assert_eq!(entries, [boolean, gap]);
        assert!(!boolean.is_gap() && gap.is_gap() && !gap.is_erased());
        assert!(PdoEntry::decode(&[0xFF; 8]).is_erased());
        assert_eq!(first.bit_length(), 16);
        assert_eq!((second.index, second.entry_count, second.sync_manager), (0x1A01, 0, None));
        assert_eq!((second.synchronisation, second.flags), (2, 0x0100));
        assert!(pdos.rest().is_empty());
    }

    #[test]
    fn a_pdo_with_entries_beyond_the_category_stays_in_the_rest() {
        let mut pdos = Pdos::new(&LITERAL[..20]);
        assert_eq!(pdos.next(), None);
        assert_eq!(pdos.rest().len(), 20);
    }

    proptest! {
        #[test]
        fn any_entry_round_trips(bytes in any::<[u8; PdoEntry::LEN]>()) {
            prop_assert_eq!(PdoEntry::decode(&bytes).encode(), bytes);
        }

        #[test]
        fn any_bytes_are_read_without_panic(data in proptest::collection::vec(any::<u8>(), 0..600)) {
            let mut pdos = Pdos::new(&data);
            let read: usize = pdos.by_ref().map(|pdo| 8 + 8 * pdo.entries().count()).sum();
            prop_assert_eq!(read + pdos.rest().len(), data.len());
        }
    }
}
