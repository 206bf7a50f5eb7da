//! What `sdos --json` prints.

use ringcat_control::tool::{EntryLine, ObjectLine};
use serde::Serialize;

use super::values::{Bits, List};
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
    pub objects: List<'a, (u16, ObjectLine), bool, Object<'a>>,
}

/// An object.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Object<'a> {
    /// Index of the object
    pub index: u16,
    /// Its name, as the SubDevice describes it
    pub name: &'a str,
    /// Its entries; null with --quiet
    pub entries: Option<List<'a, EntryLine, (), Entry<'a>>>,
}

/// An entry of an object.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Entry<'a> {
    /// Sub-index of the entry
    pub subindex: u8,
    /// Name of its data type, as `--type` takes it; null for a type unknown to the tool
    pub data_type: Option<&'static str>,
    /// Number of its data type
    pub data_type_code: u16,
    /// Length, in bits
    pub length_bits: u16,
    /// States in which it can be read: `PREOP`, `SAFEOP`, `OP`
    pub read_in: Bits,
    /// States in which it can be written
    pub write_in: Bits,
    /// Its name, as the SubDevice describes it
    pub name: &'a str,
}

impl<'a> Sdos<'a> {
    /// Objects by index, with their entries or without.
    pub fn new(master: u32, position: u16, all: &'a [(u16, ObjectLine)], has_entries: bool) -> Sdos<'a> {
        Sdos { master, position, objects: List { all, context: has_entries, make: object } }
    }
}

fn object<'a>(_: usize, (index, line): &'a (u16, ObjectLine), has_entries: bool) -> Object<'a> {
    let entries = List { all: &line.entries[..], context: (), make: entry };
    Object { index: *index, name: &line.name, entries: has_entries.then_some(entries) }
}

fn entry(_: usize, line: &EntryLine, _: ()) -> Entry<'_> {
    Entry {
        subindex: line.sub_index,
        data_type: data_types::coded(line.data_type).map(|it| it.name),
        data_type_code: line.data_type,
        length_bits: line.bits,
        // Read in bits 0 to 2, write in bits 3 to 5.
        read_in: Bits { names: &STATES, bits: line.access },
        write_in: Bits { names: &STATES, bits: line.access >> 3 },
        name: &line.name,
    }
}
