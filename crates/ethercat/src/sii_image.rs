//! The image of an SII: its categories, and what is wrong with it.

use ringcat_wire::sii::checksum;

/// Words before the categories.
pub const HEAD_WORDS: usize = 64;
/// Words that an image has at least.
pub const FEWEST_WORDS: usize = 40;
/// Type of the end of the categories.
const END: u16 = 0xFFFF;

/// A category: type and data.
pub type Category<'a> = (u16, &'a [u8]);

/// Name of a category.
pub fn category_name(category: u16) -> &'static str {
    match category {
        0x000A => "STRINGS",
        0x0014 => "DataTypes",
        0x001E => "General",
        0x0028 => "FMMU",
        0x0029 => "SyncM",
        0x0032 => "TXPDO",
        0x0033 => "RXPDO",
        0x003C => "DC",
        _ => "unknown",
    }
}

/// The categories of an image; `None` if they do not end within it.
pub fn categories(image: &[u8]) -> Option<Vec<Category<'_>>> {
    let mut rest = image.get(2 * HEAD_WORDS..)?;
    let mut categories = Vec::new();
    loop {
        let ([low, high], behind) = rest.split_first_chunk()?;
        let category = u16::from_le_bytes([*low, *high]);
        if category == END {
            return Some(categories);
        }
        let ([low, high], behind) = behind.split_first_chunk()?;
        let (data, behind) = behind.split_at_checked(2 * usize::from(u16::from_le_bytes([*low, *high])))?;
        categories.push((category, data));
        rest = behind;
    }
}

/// The checksum that an image should have, if it has another one.
pub fn wrong_checksum(image: &[u8]) -> Option<u8> {
    let wanted = checksum(image.first_chunk()?);
    (image.get(14) != Some(&wanted)).then_some(wanted)
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: daemon
    #[test]
    fn categories_end_within_the_image_or_it_is_corrupted() {
        let mut image = vec![0; 128];
        image.extend([0x0A, 0, 1, 0, 1, 2, 0xFF, 0xFF]);
        assert_eq!(categories(&image), Some(vec![(0x000A, &[1, 2][..])]));
        for length in [0, 127, 128, 129, 131, 133, 135] {
            assert_eq!(categories(&image[..length]), None, "{length}");
        }
        assert_eq!(categories(&[0xFF; 130]), Some(Vec::new()));
    }
}
