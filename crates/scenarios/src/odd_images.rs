//! Inconsistent and damaged SII images: truncated, with bit errors, unusual SyncManagers, PDOs, sizes and checksums.
//!
//! A valid image and [`Dice`] go in; a changed image and its changes come out. The same seed gives the same image.

use std::fmt;

use ringcat_wire::sii::{CategoryHeader, CategoryKind, SiiHeader, SiiSyncManager};

use crate::dice::Dice;

/// Change of an image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Change {
    /// Everything from this byte on reads as erased or zero; `is_inside` says that a category lost a part.
    Cut {
        /// First lost byte.
        at: usize,
        /// Value that is read instead.
        padding: u8,
        /// A category that a MainDevice needs lost a part, or the fixed area is all there is.
        is_inside: bool,
    },
    /// The image itself is shorter.
    Shorter {
        /// Bytes left.
        at: usize,
    },
    /// These bits are inverted, the checksum is not corrected.
    Bits(Vec<usize>),
    /// These bits of the fixed area are inverted, with a correct checksum.
    SoundBits(Vec<usize>),
    /// The checksum is wrong, and the mailbox words are random.
    Garbage,
    /// A SyncManager is described in another way.
    SyncManager {
        /// Its number.
        number: usize,
        /// Byte of its entry.
        byte: usize,
        /// The value.
        value: u8,
    },
    /// The PDOs of a category are gone.
    WithoutPdos(CategoryKind),
    /// All entries of a category of PDOs have no bits.
    EmptyPdos(CategoryKind),
    /// A PDO belongs to another SyncManager.
    PdoMoved {
        /// The SyncManager, 0xFF for none.
        to: u8,
    },
    /// A word of the fixed area has another value; the checksum is correct.
    Word {
        /// Its address.
        word: usize,
        /// The value.
        value: u16,
    },
    /// A category says that it has another length.
    CategoryLength {
        /// Which.
        kind: CategoryKind,
        /// Words.
        words: u16,
    },
    /// A category comes a second time, with the data of the first one or erased.
    Repeated(CategoryKind),
    /// The categories are in another order, with a vendor specific one among them.
    Reordered,
}

impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self:?}")
    }
}

/// A changed image.
#[derive(Clone, Debug)]
pub struct Variant {
    /// Its bytes.
    pub image: Vec<u8>,
    /// The change.
    pub change: Change,
}

/// Number of kinds of changes, which are used in turn.
pub const KINDS: u64 = 12;

/// The variant `number` of an image.
pub fn variant(image: &[u8], number: u64, dice: &mut Dice) -> Variant {
    let mut dice = Dice::new(dice.roll() ^ number);
    let mut image = image.to_vec();
    image.resize(image.len().max(SiiHeader::LEN + 2), 0xFF);
    let found = categories(&image);
    let used = found.last().map_or(SiiHeader::LEN, |(at, header)| at + CategoryHeader::LEN + header.data_len());
    let change = match number % KINDS {
        0 => cut(&mut image, &found, used, &mut dice),
        1 => {
            let at = dice.below(used as u64) as usize & !1;
            image.truncate(at);
            Change::Shorter { at }
        }
        2 => Change::Bits(flip(&mut image, used, &mut dice)),
        3 => {
            let bits = flip(&mut image, SiiHeader::LEN, &mut dice);
            mend_checksum(&mut image);
            Change::SoundBits(bits)
        }
        4 => {
            (0x28..0x38).for_each(|at| image[at] = dice.roll() as u8);
            image[14] ^= 1 << dice.below(8);
            Change::Garbage
        }
        5 | 6 => sync_manager(&mut image, &found, &mut dice),
        7 => pdos(&mut image, &found, &mut dice),
        8 => pdo_moved(&mut image, &found, &mut dice),
        9 => word(&mut image, &mut dice),
        10 => category_length(&mut image, &found, &mut dice),
        _ => rearrange(&mut image, &found, &mut dice),
    };
    Variant { image, change }
}

type Found = Vec<(usize, CategoryHeader)>;

/// The categories of a valid image, with the offsets of their headers.
fn categories(image: &[u8]) -> Found {
    let mut found = Vec::new();
    let mut at = SiiHeader::LEN;
    while let Some(bytes) = image.get(at..).and_then(|rest| rest.first_chunk()) {
        let header = CategoryHeader::decode(bytes);
        if header.kind == CategoryKind::End || at + CategoryHeader::LEN + header.data_len() > image.len() {
            break;
        }
        found.push((at, header));
        at += CategoryHeader::LEN + header.data_len();
    }
    found
}

fn is_needed(kind: CategoryKind) -> bool {
    use CategoryKind::{Dc, General, RxPdo, Strings, SyncManager, TxPdo};
    matches!(kind, Strings | General | SyncManager | TxPdo | RxPdo | Dc)
}

/// A category that lost this many bytes lost relevant data.
const LOST: usize = 8;

fn cut(image: &mut [u8], found: &Found, used: usize, dice: &mut Dice) -> Change {
    let at = if dice.one_in(4) { SiiHeader::LEN } else { dice.below(used as u64) as usize };
    let padding = *dice.pick(&[0xFF, 0xFF, 0x00]);
    // Bytes at the end of an entry may be padding or have no meaning.
    let hit = |(start, header): &(usize, CategoryHeader)| {
        let end = start + CategoryHeader::LEN + header.data_len();
        let is_here = (start + CategoryHeader::LEN..end).contains(&at);
        is_needed(header.kind) && is_here && end - at >= LOST && image[at..end].iter().any(|byte| *byte != padding)
    };
    let is_inside = at == SiiHeader::LEN || found.iter().any(hit);
    image[at..].fill(padding);
    Change::Cut { at, padding, is_inside }
}

fn flip(image: &mut [u8], bytes: usize, dice: &mut Dice) -> Vec<usize> {
    let count = 1 + dice.below(6) as usize;
    let bits: Vec<usize> = (0..count).map(|_| dice.below(8 * bytes as u64) as usize).collect();
    for bit in &bits {
        image[bit / 8] ^= 1 << (bit % 8);
    }
    bits
}

/// Corrects the checksum.
pub fn mend_checksum(image: &mut [u8]) {
    if let Some(area) = image.first_chunk_mut::<{ SiiHeader::LEN }>() {
        *area = SiiHeader::decode(area).with_checksum().encode();
    }
}

fn of_kind(found: &Found, kind: CategoryKind) -> Option<std::ops::Range<usize>> {
    let (at, header) = found.iter().find(|(_, header)| header.kind == kind)?;
    let start = at + CategoryHeader::LEN;
    Some(start..start + header.data_len())
}

/// Plausible values: types, control and enable bytes of other devices, slightly wrong addresses and lengths.
fn sync_manager(image: &mut [u8], found: &Found, dice: &mut Dice) -> Change {
    let Some(range) = of_kind(found, CategoryKind::SyncManager).filter(|range| range.len() >= SiiSyncManager::LEN)
    else {
        return word(image, dice);
    };
    let number = dice.below((range.len() / SiiSyncManager::LEN) as u64) as usize;
    let values: [(usize, &[u8]); 8] = [
        (7, &[0, 1, 2, 3, 4, 5, 0xFF]),
        (7, &[0]),
        (6, &[0, 1, 3, 4, 9]),
        (4, &[0x00, 0x20, 0x22, 0x24, 0x26, 0x44, 0x64, 0xFF]),
        (2, &[0, 1, 2, 7, 40, 0xFF]),
        (3, &[0, 1, 2, 0x10, 0xFF]),
        (0, &[0, 1, 0x40, 0x80, 0xFF]),
        (1, &[0, 0x0F, 0x10, 0x11, 0x18, 0x2F, 0x30, 0x40, 0xFF]),
    ];
    let (byte, values) = *dice.pick(&values);
    let value = *dice.pick(values);
    image[range.start + number * SiiSyncManager::LEN + byte] = value;
    Change::SyncManager { number, byte, value }
}

const PDOS: [CategoryKind; 2] = [CategoryKind::TxPdo, CategoryKind::RxPdo];

/// PDOs in one direction only, or of size 0.
fn pdos(image: &mut [u8], found: &Found, dice: &mut Dice) -> Change {
    let there: Vec<_> = found.iter().filter(|(_, header)| PDOS.contains(&header.kind)).collect();
    if there.is_empty() {
        return sync_manager(image, found, dice);
    }
    let (at, header) = **dice.pick(&there);
    if dice.one_in(2) {
        image[at..at + 2].copy_from_slice(&[0, 0]);
        return Change::WithoutPdos(header.kind);
    }
    let data = &mut image[at + CategoryHeader::LEN..at + CategoryHeader::LEN + header.data_len()];
    let mut place = 0;
    while let Some(count) = data.get(place + 2).copied() {
        for entry in 0..usize::from(count) {
            if let Some(bits) = data.get_mut(place + 8 + 8 * entry + 5) {
                *bits = 0;
            }
        }
        place += 8 + 8 * usize::from(count);
    }
    Change::EmptyPdos(header.kind)
}

fn pdo_moved(image: &mut [u8], found: &Found, dice: &mut Dice) -> Change {
    let there: Vec<_> = found.iter().filter(|(_, header)| PDOS.contains(&header.kind) && header.words >= 4).collect();
    if there.is_empty() {
        return sync_manager(image, found, dice);
    }
    let (at, _) = **dice.pick(&there);
    let to = *dice.pick(&[0xFF, 0xFF, 0, 1, 2, 3, 9]);
    image[at + CategoryHeader::LEN + 3] = to;
    Change::PdoMoved { to }
}

/// Mailboxes, protocols, sizes.
fn word(image: &mut [u8], dice: &mut Dice) -> Change {
    let word = *dice.pick(&[0x14, 0x15, 0x16, 0x17, 0x18, 0x19, 0x1A, 0x1B, 0x1C, 0x3E, 0x3E, 0x3F]);
    let value: u16 = *dice.pick(&[0, 1, 3, 15, 0x20, 0x80, 0x0400, 0x1000, 0x1080, 0x2F80, 0x7878, 0xFFFF]);
    image[2 * word..2 * word + 2].copy_from_slice(&value.to_le_bytes());
    Change::Word { word, value }
}

fn category_length(image: &mut [u8], found: &Found, dice: &mut Dice) -> Change {
    if found.is_empty() {
        return word(image, dice);
    }
    let (at, header) = *dice.pick(found);
    let words = *dice.pick(&[0, 1, header.words / 2, header.words + 1, header.words + 7, 0x0400, 0xFFFF]);
    image[at + 2..at + 4].copy_from_slice(&words.to_le_bytes());
    Change::CategoryLength { kind: header.kind, words }
}

/// The same categories in another arrangement.
fn rearrange(image: &mut Vec<u8>, found: &Found, dice: &mut Dice) -> Change {
    let mut parts: Vec<Vec<u8>> =
        found.iter().map(|(at, header)| image[*at..at + CategoryHeader::LEN + header.data_len()].to_vec()).collect();
    if parts.is_empty() {
        return word(image, dice);
    }
    let change = if dice.one_in(2) {
        let again = dice.below(parts.len() as u64) as usize;
        let mut part = parts[again].clone();
        if dice.one_in(2) {
            part[CategoryHeader::LEN..].fill(0xFF);
        }
        let kind = CategoryHeader::decode(part.first_chunk().expect("it has a header")).kind;
        parts.push(part);
        Change::Repeated(kind)
    } else {
        for at in (1..parts.len()).rev() {
            parts.swap(at, dice.below(at as u64 + 1) as usize);
        }
        parts.insert(parts.len() / 2, vec![0x00, 0x80, 2, 0, 0xAA, 0x55, 0xAA, 0x55]);
        Change::Reordered
    };
    image.truncate(SiiHeader::LEN);
    image.extend(parts.concat());
    image.extend([0xFF, 0xFF]);
    image.resize(image.len().next_multiple_of(128), 0xFF);
    let kbit = (image.len() / 128 - 1) as u16;
    image[2 * 0x3E..2 * 0x3F].copy_from_slice(&kbit.to_le_bytes());
    change
}

#[cfg(test)]
mod tests {
    use ringcat_sim::{catalogue, sii_image};

    use super::*;

    #[test]
    fn a_seed_makes_one_image_and_each_kind_of_change_comes() {
        let image = sii_image::build(&catalogue::by_name("servo").expect("it is there"));
        let made = |seed| -> Vec<Variant> {
            let mut dice = Dice::new(seed);
            (0..200).map(|number| variant(&image, number, &mut dice)).collect()
        };
        let (one, again) = (made(1), made(1));
        assert!(one.iter().zip(&again).all(|(one, again)| one.image == again.image && one.change == again.change));
        let kinds: std::collections::BTreeSet<String> = one
            .iter()
            .map(|made| format!("{:?}", made.change).split([' ', '(']).next().unwrap_or("").to_owned())
            .collect();
        assert_eq!(kinds.len(), 13, "{kinds:?}");
        let differ = one.iter().filter(|made| made.image != image).count();
        assert!(differ > 190, "{differ} of 200 differ");
    }
}
