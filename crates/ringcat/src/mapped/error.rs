//! Why process data is not found, with the objects that are mapped.

use std::fmt;

use ringcat_engine::exchange::Entry;
use ringcat_engine::info::Direction;
use ringcat_engine::main_device::SubDeviceId;

/// Most objects that a message lists.
const LISTED: usize = 24;

/// The wanted object.
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
    /// Direction, from the side of the MainDevice.
    pub direction: Direction,
    /// Its place.
    pub entry: Entry,
    /// Its name; empty where neither SII nor dictionary give one.
    pub name: String,
    /// Name of its PDO; may be empty.
    pub pdo: String,
}

impl MappedObject {
    /// Index, subindex and name.
    fn label(&self) -> impl fmt::Display {
        fmt::from_fn(|f| {
            write!(f, "{:#06x}:{:02x}", self.index, self.sub_index)?;
            match (self.pdo.as_str(), self.name.as_str()) {
                (_, "") => Ok(()),
                ("", name) => write!(f, " \"{name}\""),
                (pdo, name) => write!(f, " \"{pdo}.{name}\""),
            }
        })
    }
}

impl fmt::Display for MappedObject {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({}, {} bits)", self.label(), noun(self.direction), self.entry.bit_length)
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
        /// Number of declared SubDevices.
        declared: usize,
    },
    /// It is not mapped.
    NotMapped {
        /// The SubDevice.
        subdevice: SubDeviceId,
        /// Its name; may be empty.
        name: String,
        /// The wanted object.
        wanted: Wanted,
        /// What is mapped.
        mapped: Vec<MappedObject>,
    },
    /// The names in its SII were not read yet: see [`Options::sii_extent`](crate::Options::sii_extent).
    NamesNotRead {
        /// The SubDevice.
        subdevice: SubDeviceId,
        /// The wanted object.
        wanted: Wanted,
    },
    /// It is mapped in the other direction.
    Direction {
        /// The SubDevice.
        subdevice: SubDeviceId,
        /// Its name; may be empty.
        name: String,
        /// The object, with the direction that it has.
        object: Box<MappedObject>,
    },
    /// It has another number of bits than the type.
    Width {
        /// The SubDevice.
        subdevice: SubDeviceId,
        /// Its name; may be empty.
        name: String,
        /// The object.
        object: Box<MappedObject>,
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
        /// Its name; may be empty.
        name: String,
        /// The wanted object.
        wanted: Wanted,
        /// The objects with this name.
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
                write!(f, "{}: {wanted} is not mapped; mapped: ", called(*subdevice, name))?;
                list(f, mapped)
            }
            MapError::NamesNotRead { subdevice, wanted } => write!(
                f,
                "SubDevice {subdevice}: {wanted}: the scan did not read names (option sii_extent), and they were not \
                 read since: complete_siis() reads them"
            ),
            MapError::Direction { subdevice, name, object } => {
                let other = match object.direction {
                    Direction::Inputs => "the SubDevice sends it, so it cannot be set",
                    Direction::Outputs => "the SubDevice receives it: use an output",
                };
                let (at, label) = (called(*subdevice, name), object.label());
                write!(f, "{at}: {label} is an {}: {other}", noun(object.direction))
            }
            MapError::Width { subdevice, name, object, number, expected, is } => {
                let (at, label) = (called(*subdevice, name), object.label());
                write!(f, "{at}: {label}: {number} has {expected} bits, {is} bits are mapped")
            }
            MapError::Ambiguous { subdevice, name, wanted, found } => {
                write!(f, "{}: several objects have the name {wanted}: ", called(*subdevice, name))?;
                list(f, found)
            }
        }
    }
}

/// A SubDevice with its name, if it has one.
fn called(subdevice: SubDeviceId, name: &str) -> impl fmt::Display {
    fmt::from_fn(move |f| match name {
        "" => write!(f, "SubDevice {subdevice}"),
        name => write!(f, "SubDevice {subdevice} \"{name}\""),
    })
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
