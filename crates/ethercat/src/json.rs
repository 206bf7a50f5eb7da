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
mod writer;

use serde::Serialize;

use crate::failure::Failure;
use crate::session::Session;
use writer::{Unsupported, Writer};

/// Version of all keys together.
pub const SCHEMA_VERSION: u32 = 1;

/// Prints a line with the keys of the command.
///
/// # Errors
/// The output is closed.
pub fn print<T: Serialize>(session: &mut Session<'_>, data: &T) -> Result<(), Failure> {
    print_with(session, &|writer| data.serialize(writer))
}

/// Writes the keys of a command.
type Fill<'f> = dyn Fn(&mut Writer) -> Result<(), Unsupported> + 'f;

fn print_with(session: &mut Session<'_>, fill: &Fill<'_>) -> Result<(), Failure> {
    let mut writer = Writer::object(SCHEMA_VERSION, session.name);
    fill(&mut writer).map_err(|error| Failure::failed(error.to_string()))?;
    let mut text = writer.into_text();
    text.push('\n');
    session.write_text(&text)
}
