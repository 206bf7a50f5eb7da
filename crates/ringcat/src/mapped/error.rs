//! Why process data is not found, with what there is instead.

use std::fmt;

use ringcat_engine::exchange::Entry;
use ringcat_engine::info::Direction;
use ringcat_engine::main_device::SubDeviceId;

/// Most objects that a message lists.
const LISTED: usize = 24;

/// What is looked for.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Wanted {
    /// An object's entry.
    Index {
        /// Index.
        index: u16,
        /// Subindex.
        sub_index: u8,
    },
    /// A name.
    Name(String),
}

impl fmt::Display for Wanted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Wanted::Index { index, sub_index } => write!(f, "{index:#06x}:{sub_index:02x}"),
            Wanted::Name(name) => write!(f, "\"{name}\""),
        }
    }
}

/// An object's entry in the process data.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct MappedObject {
    /// Index.
    pub index: u16,
    /// Subindex.
    pub sub_index: u8,
    /// Direction, as the MainDevice sees it.
    pub direction: Direction,
    /// Its place.
    pub entry: Entry,
    /// Its name; empty where neither SII nor dictionary give one.
    pub name: String,
    /// Name of the PDO in which it is; may be empty.
    pub pdo: String,
}

impl fmt::Display for MappedObject {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:#06x}:{:02x}", self.index, self.sub_index)?;
        match (self.pdo.as_str(), self.name.as_str()) {
            (_, "") => {}
            ("", name) => write!(f, " \"{name}\"")?,
            (pdo, name) => write!(f, " \"{pdo}.{name}\"")?,
        }
        write!(f, " ({}, {} bits)", noun(self.direction), self.entry.bit_length)
    }
}

const fn noun(direction: Direction) -> &'static str {
    match direction {
        Direction::Outputs => "output",
        Direction::Inputs => "input",
    }
}

/// Why process data is not found.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum MapError {
    /// The declaration has no such SubDevice.
    NotDeclared {
        /// The index.
        subdevice: SubDeviceId,
        /// SubDevices that it has.
        declared: usize,
    },
    /// It is not mapped.
    NotMapped {
        /// The SubDevice.
        subdevice: SubDeviceId,
        /// Its name; may be empty.
        name: String,
        /// What was looked for.
        wanted: Wanted,
        /// What is mapped.
        mapped: Vec<MappedObject>,
    },
    /// It is mapped in the other direction.
    Direction {
        /// The SubDevice.
        subdevice: SubDeviceId,
        /// What was looked for.
        wanted: Wanted,
        /// The direction that it has.
        is: Direction,
    },
    /// It has another number of bits than the type.
    Width {
        /// The SubDevice.
        subdevice: SubDeviceId,
        /// What was looked for.
        wanted: Wanted,
        /// The type.
        number: &'static str,
        /// Bits of the type.
        expected: u16,
        /// Bits that are mapped.
        is: u16,
    },
    /// Several objects have the name.
    Ambiguous {
        /// The SubDevice.
        subdevice: SubDeviceId,
        /// What was looked for.
        wanted: Wanted,
        /// Those that have it.
        found: Vec<MappedObject>,
    },
}

impl fmt::Display for MapError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            MapError::NotDeclared { subdevice, declared } => {
                write!(f, "SubDevice {subdevice}: not declared: the declaration has {declared} SubDevices, from 0")
            }
            MapError::NotMapped { subdevice, name, wanted, mapped } => {
                write!(f, "SubDevice {subdevice}")?;
                if !name.is_empty() {
                    write!(f, " \"{name}\"")?;
                }
                write!(f, ": {wanted} is not mapped; mapped: ")?;
                list(f, mapped)
            }
            MapError::Direction { subdevice, wanted, is } => {
                let other = match is {
                    Direction::Inputs => "the SubDevice sends it, so it cannot be set",
                    Direction::Outputs => "the SubDevice receives it: look for an output",
                };
                let article = if *is == Direction::Inputs { "an input" } else { "an output" };
                write!(f, "SubDevice {subdevice}: {wanted} is {article}: {other}")
            }
            MapError::Width { subdevice, wanted, number, expected, is } => {
                write!(f, "SubDevice {subdevice}: {wanted}: {number} has {expected} bits, {is} bits are mapped")
            }
            MapError::Ambiguous { subdevice, wanted, found } => {
                write!(f, "SubDevice {subdevice}: {wanted} is the name of several: ")?;
                list(f, found)
            }
        }
    }
}

fn list(f: &mut fmt::Formatter<'_>, objects: &[MappedObject]) -> fmt::Result {
    if objects.is_empty() {
        return f.write_str("nothing");
    }
    for (at, object) in objects.iter().take(LISTED).enumerate() {
        let comma = if at > 0 { ", " } else { "" };
        write!(f, "{comma}{object}")?;
    }
    match objects.len().saturating_sub(LISTED) {
        0 => Ok(()),
        more => write!(f, " and {more} more"),
    }
}

impl std::error::Error for MapError {}
