//! Network files of RingCAT: one file with all keys, `../files/whole.network.toml`, variants of it, and networks that
//! are compared with it.

mod bad_files;
mod differences;
mod generated;
mod properties;
mod reading;

/// A file with all keys, in canonical form.
pub const WHOLE: &str = include_str!("../files/whole.network.toml");
