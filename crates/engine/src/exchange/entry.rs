//! A PDO entry's place in a domain image, and typed access to it.

use crate::domain::DomainId;

/// Where a PDO entry lives. Bits are counted from bit 0 of byte 0 of the image, least significant first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry {
    /// The domain.
    pub domain: DomainId,
    /// First bit in the domain's image.
    pub bit_offset: u32,
    /// Number of bits, 1..=64 for typed access; longer entries are accessed through the image.
    pub bit_length: u16,
}

impl Entry {
    /// Byte of the image in which the entry begins.
    pub const fn byte_offset(&self) -> usize {
        (self.bit_offset / 8) as usize
    }

    /// Bit within that byte.
    pub const fn bit_position(&self) -> u8 {
        (self.bit_offset % 8) as u8
    }

    /// Reads up to 64 bits, zero-extended. Bits outside the image read as zero.
    pub fn read(&self, image: &[u8]) -> u64 {
        let mut bytes = [0; 9];
        let (start, span) = self.span();
        if let Some(source) = image.get(start..start + span) {
            bytes[..span].copy_from_slice(source);
        }
        let low = u128::from(u64::from_le_bytes([
            bytes[0], bytes[1], bytes[2], bytes[3], bytes[4], bytes[5], bytes[6], bytes[7],
        ]));
        let value = (low | u128::from(bytes[8]) << 64) >> self.bit_position();
        value as u64 & self.mask()
    }

    /// Reads a signed value of the entry's width.
    pub fn read_signed(&self, image: &[u8]) -> i64 {
        let unused = 64 - u32::from(self.bit_length.clamp(1, 64));
        ((self.read(image) << unused) as i64) >> unused
    }

    /// Whether any bit of the entry is set.
    pub fn read_bool(&self, image: &[u8]) -> bool {
        self.read(image) != 0
    }

    /// Reads a REAL32; the entry has 32 bits.
    pub fn read_f32(&self, image: &[u8]) -> f32 {
        f32::from_bits(self.read(image) as u32)
    }

    /// Reads a REAL64; the entry has 64 bits.
    pub fn read_f64(&self, image: &[u8]) -> f64 {
        f64::from_bits(self.read(image))
    }

    /// Writes a REAL32; the entry has 32 bits.
    pub fn write_f32(&self, image: &mut [u8], value: f32) {
        self.write(image, u64::from(value.to_bits()));
    }

    /// Writes a REAL64; the entry has 64 bits.
    pub fn write_f64(&self, image: &mut [u8], value: f64) {
        self.write(image, value.to_bits());
    }

    /// Writes a signed value; bits beyond the entry's width are cut off.
    pub fn write_signed(&self, image: &mut [u8], value: i64) {
        self.write(image, value as u64);
    }

    /// Writes the lower bits of `value`; the other bits of the image stay. Writes outside the image are ignored.
    pub fn write(&self, image: &mut [u8], value: u64) {
        let (start, span) = self.span();
        let Some(target) = image.get_mut(start..start + span) else { return };
        let shift = self.bit_position();
        let mask = (u128::from(self.mask()) << shift).to_le_bytes();
        let value = (u128::from(value & self.mask()) << shift).to_le_bytes();
        for ((byte, mask), value) in target.iter_mut().zip(mask).zip(value) {
            *byte = *byte & !mask | value;
        }
    }

    fn span(&self) -> (usize, usize) {
        let bits = usize::from(self.bit_position()) + usize::from(self.bit_length.min(64));
        (self.byte_offset(), bits.div_ceil(8))
    }

    const fn mask(&self) -> u64 {
        if self.bit_length >= 64 { u64::MAX } else { (1 << self.bit_length) - 1 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn entry(bit_offset: u32, bit_length: u16) -> Entry {
        Entry { domain: DomainId(0), bit_offset, bit_length }
    }

    #[test]
    fn a_bit_in_the_middle_of_a_byte() {
        let mut image = [0xFF, 0xFF];
        entry(10, 1).write(&mut image, 0);
        assert_eq!(image, [0xFF, 0xFB]);
        assert_eq!(entry(10, 1).read(&image), 0);
        assert_eq!(entry(11, 1).read(&image), 1);
    }

    // covers: domains
    #[test]
    fn signed_values_are_extended() {
        assert_eq!(entry(0, 16).read_signed(&[0xFE, 0xFF]), -2);
        assert_eq!(entry(0, 12).read_signed(&[0xFF, 0x07]), 0x7FF);
    }

    #[test]
    fn floats_and_negative_numbers_come_back() {
        let mut image = [0; 12];
        entry(8, 32).write_f32(&mut image, -1.5);
        assert_eq!(image[1..5], [0x00, 0x00, 0xC0, 0xBF]);
        assert_eq!(entry(8, 32).read_f32(&image), -1.5);
        entry(32, 64).write_f64(&mut image, 0.1);
        assert_eq!(entry(32, 64).read_f64(&image), 0.1);
        entry(3, 12).write_signed(&mut image, -2);
        assert_eq!(entry(3, 12).read_signed(&image), -2);
        assert!(entry(4, 1).read_bool(&image) && !entry(3, 1).read_bool(&image));
    }

    #[test]
    fn outside_the_image_nothing_happens() {
        let mut image = [1, 2];
        entry(8, 16).write(&mut image, 0xFFFF);
        assert_eq!(image, [1, 2]);
        assert_eq!(entry(800, 16).read(&image), 0);
    }

    proptest! {
        // covers: domains
        #[test]
        fn what_is_written_is_read_and_nothing_else_changes(
            before in any::<[u8; 16]>(), offset in 0u32..56, length in 1u16..=64, value: u64,
        ) {
            let entry = entry(offset, length);
            let mut image = before;
            entry.write(&mut image, value);
            prop_assert_eq!(entry.read(&image), value & entry.mask());
            entry.write(&mut image, entry.read(&before));
            prop_assert_eq!(image, before);
        }
    }
}
