//! What `--json` prints: one object per line on the standard output, of the data that the text is made of.
//!
//! The types below are the documentation too: `docs/ethercat-json.md` is compared with them.

pub mod config;
pub mod details;
pub mod domains;
#[cfg(test)]
mod keys;
pub mod master;
pub mod pdos;
pub mod reads;
pub mod ring;
pub mod sdos;
pub mod slaves;
pub mod texts;
pub mod values;

use serde::Serialize;

use crate::failure::Failure;
use crate::session::Session;

/// Version of all keys together.
pub const SCHEMA_VERSION: u32 = 1;

/// What every line begins with.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Line<'a, T> {
    /// Version of the keys on this page
    pub schema_version: u32,
    /// The command that prints the line
    pub command: &'a str,
    /// The keys of the command.
    #[serde(flatten)]
    #[cfg_attr(test, schemars(skip))]
    pub data: &'a T,
}

/// Prints a line with the keys of the command.
///
/// # Errors
/// The output is closed.
pub fn print<T: Serialize>(session: &mut Session<'_>, data: &T) -> Result<(), Failure> {
    let line = Line { schema_version: SCHEMA_VERSION, command: session.name, data };
    let mut bytes = serde_json::to_vec(&line).map_err(|error| Failure::failed(error.to_string()))?;
    bytes.push(b'\n');
    session.write(&bytes)
}
