//! CoE: objects of a SubDevice's dictionary (facts 6.3).
//!
//! [`upload`] and [`download`] move objects of any size, expedited, normal or in segments, between the SubDevice and a
//! [`Sink`](super::stream::Sink) or [`Source`](super::stream::Source); [`read`] and [`write()`] do so with bytes in memory.
//! [`information`] asks which objects there are, [`pdo`] reads and writes assignment and mapping, [`history`] the diagnosis
//! history; [`pdo_mail`] moves PDOs by mailbox.

mod download;
mod error;
pub mod history;
pub mod information;
pub mod pdo;
pub mod pdo_mail;
mod transfer;
mod upload;

use core::fmt;

pub use download::{download, write};
pub use error::{SdoError, SdoFailure};
pub(in crate::mail) use transfer::settle;
pub use upload::{read, upload};

use super::talk::Limits;

/// Which object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SdoAddress {
    /// Index.
    pub index: u16,
    /// Subindex.
    pub sub_index: u8,
    /// All entries at once.
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
