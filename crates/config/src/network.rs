//! Network files of RingCAT: a configured network as TOML. Input is the text of a file, output a [`NetworkFile`] or an
//! error with file, line and key; [`NetworkFile::configuration`] is its declaration for the engine. The format is
//! described in `docs/network-file.md`.

mod check;
mod commands;
mod declare;
mod error;
mod esi_differences;
mod esi_names;
mod export_error;
mod from_esi;
mod from_scan;
pub mod model;
mod places;
mod read;
#[cfg(test)]
mod schema;
mod stated;
mod to_eni;
mod unique;
mod values;
mod write;

pub use error::{MAX_NETWORK_BYTES, NetworkError};
pub use from_esi::FromEsi;
pub use from_scan::ScanOptions;
pub use model::NetworkFile;
pub use values::{Bytes, Mac, Shift, Time};
pub use write::Digest;
