//! Address of an object.

use core::fmt;

/// An object, or an entry of one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SdoAddress {
    /// Index.
    pub index: u16,
    /// Subindex.
    pub sub_index: u8,
    /// Complete access.
    pub complete_access: bool,
}

impl SdoAddress {
    /// One entry of an object.
    pub const fn new(index: u16, sub_index: u8) -> SdoAddress {
        SdoAddress { index, sub_index, complete_access: false }
    }

    /// A whole object, from subindex 0 or 1 on.
    pub const fn complete(index: u16, sub_index: u8) -> SdoAddress {
        SdoAddress { index, sub_index, complete_access: true }
    }
}

impl fmt::Display for SdoAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:#06x}:{:02x}", self.index, self.sub_index)?;
        if self.complete_access { f.write_str(" (complete access)") } else { Ok(()) }
    }
}
