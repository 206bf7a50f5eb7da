//! Positions of mapped objects in the images of the process data.
//!
//! Input: the areas of a direction, and the dictionary with assignment and mapping. Output: the position of an object,
//! and its value in an image.

use super::dictionary::{Dictionary, MappedEntry};
use super::settings::Area;

/// A mapped entry and its position in the image of its direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlacedEntry {
    /// The entry.
    pub entry: MappedEntry,
    /// First bit.
    pub bit_offset: usize,
}

/// The entries of one direction.
#[derive(Clone, Debug, Default)]
pub struct Mapping(Vec<PlacedEntry>);

impl Mapping {
    pub(super) fn new(areas: &[Area], dictionary: &Dictionary) -> Mapping {
        let mut placed = Vec::new();
        let mut area_start = 0;
        for area in areas {
            let mut bit_offset = area_start * 8;
            for entry in dictionary.assigned(area.sync_manager).flat_map(|pdo| dictionary.mapped(pdo)) {
                placed.push(PlacedEntry { entry, bit_offset });
                bit_offset += usize::from(entry.bit_length);
            }
            area_start += usize::from(area.length);
        }
        Mapping(placed)
    }

    /// The entries, in order.
    pub fn entries(&self) -> impl Iterator<Item = MappedEntry> {
        self.0.iter().map(|placed| placed.entry)
    }

    /// Finds an object.
    pub fn find(&self, index: u16, sub_index: u8) -> Option<PlacedEntry> {
        self.0.iter().copied().find(|placed| placed.entry.index == index && placed.entry.sub_index == sub_index)
    }

    /// The value of an object of up to 64 bits in an image.
    pub fn value(&self, index: u16, sub_index: u8, image: &[u8]) -> Option<u64> {
        let placed = self.find(index, sub_index)?;
        (placed.entry.bit_length <= 64).then(|| {
            let bits = u128::from_le_bytes(placed.bytes(image)) >> (placed.bit_offset % 8);
            bits as u64 & placed.mask()
        })
    }

    /// Sets the value of an object of up to 64 bits in an image; no effect if it is not mapped.
    pub fn set_value(&self, index: u16, sub_index: u8, value: u64, image: &mut [u8]) {
        let Some(placed) = self.find(index, sub_index) else {
            return;
        };
        let (shift, mask) = (placed.bit_offset % 8, placed.mask());
        let old = u128::from_le_bytes(placed.bytes(image));
        let new = old & !(u128::from(mask) << shift) | u128::from(value & mask) << shift;
        let touched = (shift + usize::from(placed.entry.bit_length.min(64))).div_ceil(8);
        let start = placed.bit_offset / 8;
        for (to, from) in image.iter_mut().skip(start).take(touched).zip(new.to_le_bytes()) {
            *to = from;
        }
    }
}

impl PlacedEntry {
    /// The bytes from the byte of the first bit on, with zeros beyond the end of the image.
    fn bytes(&self, image: &[u8]) -> [u8; 16] {
        let rest = image.get(self.bit_offset / 8..).unwrap_or_default();
        rest.first_chunk().copied().unwrap_or_else(|| {
            let mut bytes = [0; 16];
            bytes.iter_mut().zip(rest).for_each(|(to, from)| *to = *from);
            bytes
        })
    }

    /// A mask with as many ones as the object has bits, at most 64.
    fn mask(&self) -> u64 {
        u64::MAX.checked_shr(64u32.saturating_sub(self.entry.bit_length.into())).unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_placed_bit_by_bit() {
        let entry = |index, bit_length| MappedEntry { index, sub_index: 1, bit_length };
        let placed = |index, bit_length, bit_offset| PlacedEntry { entry: entry(index, bit_length), bit_offset };
        let mapping = Mapping(vec![placed(0x6000, 3, 2), placed(0x6010, 16, 5)]);
        let mut image = [0xFF; 3];
        mapping.set_value(0x6000, 1, 0b010, &mut image);
        mapping.set_value(0x6010, 1, 0x1234, &mut image);
        assert_eq!((mapping.value(0x6000, 1, &image), mapping.value(0x6010, 1, &image)), (Some(2), Some(0x1234)));
        assert_eq!(image[0] & 0x03, 0x03);
        assert_eq!(image[2] & 0xE0, 0xE0);
        assert_eq!(mapping.value(0x6010, 2, &image), None);
    }
}
