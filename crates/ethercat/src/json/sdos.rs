//! What `sdos --json` prints.

use ringcat_control::tool::{EntryLine, ObjectLine};
use serde::Serialize;

use crate::data_types;

/// States in the order of the bits of access rights.
const STATES: [&str; 3] = ["PREOP", "SAFEOP", "OP"];

/// The dictionary of a SubDevice.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Sdos<'a> {
    /// Number of the master
    pub master: u32,
    /// Position of the SubDevice on the bus, from 0
    pub position: u16,
    /// Its objects; none without SDO information
    pub objects: Vec<Object<'a>>,
}

/// An object.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Object<'a> {
    /// Index of the object
    pub index: u16,
    /// Its name, as the SubDevice tells it
    pub name: &'a str,
    /// Its entries; null with --quiet
    pub entries: Option<Vec<Entry<'a>>>,
}

/// An entry of an object.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Entry<'a> {
    /// Sub-index of the entry
    pub subindex: u8,
    /// Name of its data type, as `--type` takes it; null for a type that the tool does not know
    pub data_type: Option<&'static str>,
    /// Number of its data type
    pub data_type_code: u16,
    /// Length, in bits
    pub length_bits: u16,
    /// States in which it can be read: `PREOP`, `SAFEOP`, `OP`
    pub read_in: Vec<&'static str>,
    /// States in which it can be written
    pub write_in: Vec<&'static str>,
    /// Its name, as the SubDevice tells it
    pub name: &'a str,
}

impl<'a> Object<'a> {
    /// An object, with its entries or without.
    pub fn new(index: u16, line: &'a ObjectLine, has_entries: bool) -> Object<'a> {
        let entries = has_entries.then(|| line.entries.iter().map(entry).collect());
        Object { index, name: &line.name, entries }
    }
}

fn entry(line: &EntryLine) -> Entry<'_> {
    // Read in bits 0 to 2, write in bits 3 to 5.
    let states = |first: u16| {
        let allowed = (first..).zip(STATES).filter(|(bit, _)| line.access >> bit & 1 != 0);
        allowed.map(|(_, state)| state).collect()
    };
    Entry {
        subindex: line.sub_index,
        data_type: data_types::coded(line.data_type).map(|it| it.name),
        data_type_code: line.data_type,
        length_bits: line.bits,
        read_in: states(0),
        write_in: states(3),
        name: &line.name,
    }
}
