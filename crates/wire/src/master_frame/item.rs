//! One item of a configuration by its digest: in each cycle the next one, so that a difference gets a name.

use super::cursor::{Reader, Writer};

/// A digest of one item of the configuration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Item {
    /// Its number.
    pub number: u16,
    /// Number of items.
    pub count: u16,
    /// Its digest.
    pub digest: u32,
}

impl Item {
    /// Bytes.
    pub(super) const LEN: usize = 8;

    pub(super) fn take(from: &mut Reader<'_>) -> Item {
        Item { number: from.u16(), count: from.u16(), digest: from.u32() }
    }

    pub(super) fn put(&self, out: &mut Writer<'_>) {
        out.u16(self.number);
        out.u16(self.count);
        out.u32(self.digest);
    }
}
