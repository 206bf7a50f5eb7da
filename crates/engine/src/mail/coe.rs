//! CoE: objects of a SubDevice's dictionary (protocol 6.3).
//!
//! [`upload`] and [`download`] move objects of any size, expedited, normal or in segments, between the SubDevice and a
//! [`Sink`](super::stream::Sink) or [`Source`](super::stream::Source); [`read`] and [`write()`] do so with bytes in
//! memory. [`information`] reads lists and descriptions of objects, [`Dictionaries`] keeps them; [`pdo`] reads and
//! writes assignment and mapping, [`history`] reads the diagnosis history; [`pdo_mail`] transfers PDOs by mailbox.

mod address;
mod dictionaries;
mod download;
mod error;
pub mod history;
pub mod information;
pub mod pdo;
pub mod pdo_mail;
mod transfer;
mod upload;

pub use address::SdoAddress;
pub use dictionaries::{Dictionaries, ObjectDictionary};
pub use download::{download, write};
pub use error::{SdoError, SdoFailure};
pub(in crate::mail) use transfer::settle;
pub use upload::{read, upload};
