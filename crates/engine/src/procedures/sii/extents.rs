//! The words of each extent: reserved words that no reader needs soon are left out of smaller extents (protocol 4.1,
//! 4.3). One command reads 4 words.

use ringcat_wire::sii::CategoryKind;

use crate::info::SiiExtent;

/// Words of the fixed area that are read: all but reserved words. Words 0x20 to 0x23 are reserved too, but in many real
/// images with otherwise equal fixed areas and different categories only these words differ, so they are read.
const WHOLE: [(u32, u32); 2] = [(0x00, 0x24), (0x3E, 2)];
/// The same without the delays at words 0x10 to 0x12, which are not used.
const WITHOUT_DELAYS: [(u32, u32); 3] = [(0x00, 0x10), (0x14, 0x10), (0x3E, 2)];
/// Behind the words that a scan reads in one piece. Words before it that are not read repeat the first byte, so that an
/// erased area looks erased.
pub(super) const LAST_FIXED: u32 = 0x24;
/// Words of the general category before its reserved end.
const GENERAL: u32 = 10;

/// First words and numbers of the words of the fixed area that are read.
pub(super) const fn fixed_area(extent: SiiExtent) -> &'static [(u32, u32)] {
    match extent {
        SiiExtent::Operation | SiiExtent::Clocks => &WITHOUT_DELAYS,
        SiiExtent::Complete => &WHOLE,
    }
}

/// How many words of a category are read at most; the rest is taken as zero.
pub(super) const fn words_of(extent: SiiExtent, kind: CategoryKind) -> u32 {
    match (extent, kind) {
        (SiiExtent::Operation | SiiExtent::Clocks, CategoryKind::General) => GENERAL,
        _ => u32::MAX,
    }
}
