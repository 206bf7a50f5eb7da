//! The checksum over the first seven words of the SII (protocol 4.1).

/// Value of word 7 with which a controller accepts any configuration area (for tests only).
pub const CHECKSUM_DISABLED: u16 = 0x88A4;

const POLYNOMIAL: u8 = 0x07;

/// CRC-8 with polynomial x^8+x^2+x+1, most significant bit first, start value 0xFF, over bytes 0..14 of an image.
pub const fn checksum(bytes: &[u8; 14]) -> u8 {
    let mut crc = 0xFF_u8;
    let mut at = 0;
    while at < bytes.len() {
        crc ^= bytes[at];
        let mut bit = 0;
        while bit < 8 {
            crc = if crc & 0x80 != 0 { crc << 1 ^ POLYNOMIAL } else { crc << 1 };
            bit += 1;
        }
        at += 1;
    }
    crc
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: codec-sii, ES-171
    #[test]
    fn the_images_of_real_devices_have_these_checksums() {
        // protocol 4.1; bytes that are not listed are zero.
        let vectors: [(&[u8], u8); 15] = [
            (&[0x00, 0x0D], 0x46),
            (&[0x04, 0x01, 0, 0, 0, 0, 0x0F], 0xD8),
            (&[0x80, 0x03], 0x52),
            (&[0x05, 0x0C, 0x01, 0x00, 0x64], 0x35),
            (&[0x80, 0x06, 0xE0, 0x88], 0x33),
            (&[0x82, 0x0E, 0x04, 0xCC, 0x88, 0x13, 0xFF, 0, 0, 0, 0x40, 0xC0], 0x60),
            (&[0x05, 0x0E, 0x03, 0x06, 0x10, 0x27], 0xD7),
            (&[0x80, 0x02], 0xC6),
            (&[0x80, 0x06, 0x81, 0x06], 0xCD),
            (&[0x80, 0x0E, 0xE0, 0x88], 0x8F),
            (&[0x80, 0x06, 0xE0, 0x88], 0x33),
            (&[0x80, 0x06, 0x00, 0x44, 0x64], 0xF3),
            (&[0x80, 0x02, 0x00, 0x6E, 0xFF, 0x00, 0xFF], 0xB6),
            (&[0x80, 0x02, 0x81], 0xD1),
            (&[0x80, 0x03, 0x00, 0x6E, 0xFF, 0x00, 0xFF], 0x22),
        ];
        for (start, crc) in vectors {
            let mut bytes = [0; 14];
            bytes[..start.len()].copy_from_slice(start);
            assert_eq!(checksum(&bytes), crc, "{start:02x?}");
        }
    }

    #[test]
    fn any_single_changed_bit_changes_the_checksum() {
        let bytes = [0x80, 0x06, 0x81, 0x06, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0];
        for bit in 0..14 * 8 {
            let mut changed = bytes;
            changed[bit / 8] ^= 1 << (bit % 8);
            assert_ne!(checksum(&changed), checksum(&bytes), "bit {bit}");
        }
    }
}
