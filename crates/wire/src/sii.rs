//! SubDevice information (SII): content of the EEPROM of a SubDevice (protocol 4).
//!
//! [`Sii::parse`] takes and borrows a whole image; each category also has its own decoder ([`General::decode`],
//! [`Strings::new`], [`Pdos::new`], ...) for readers that read one category at a time. [`SiiWriter`] writes an image
//! into a buffer of the caller. Unknown and vendor-specific categories are kept as bytes. This module does not read the
//! image from a controller (registers 0x0500..0x050F).

mod category;
mod checksum;
mod dc;
mod fmmu;
mod general;
mod header;
mod image;
mod pdo;
mod strings;
mod sync_manager;
mod writer;

pub use category::{Categories, Category, CategoryHeader, CategoryKind};
pub use checksum::{CHECKSUM_DISABLED, checksum};
pub use dc::{DcMode, DcModes};
pub use fmmu::{FmmuUsage, FmmuUsages};
pub use general::{CoeDetails, General, GeneralFlags, PhysicalPort};
pub use header::{Identity, MailboxLayout, MailboxProtocols, SiiHeader};
pub use image::{Sii, SiiError};
pub use pdo::{Pdo, PdoDescription, PdoDirection, PdoEntries, PdoEntry, Pdos};
pub use strings::{Strings, StringsIter};
pub use sync_manager::{SiiSyncManager, SiiSyncManagers, SyncManagerKind};
pub use writer::{SiiWriteError, SiiWriter};

#[cfg(test)]
mod tests;
