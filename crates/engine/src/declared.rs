//! Names of what the application declares: SubDevices and hot connect groups, by their index in the declaration.
//!
//! The place of a SubDevice on the bus is a [`Position`]. The two numbers differ as soon as a declared SubDevice is
//! absent, is found by alias, or is in a hot connect group.

use core::fmt;

use ringcat_wire::address::Position;
use ringcat_wire::memory_write::{MemoryWrite, WriteKind};

/// Index of a SubDevice in the declaration, from 0. It stays the same wherever the SubDevice is on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SubDeviceId(pub usize);

/// Number of a hot connect group in the declaration, from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct GroupId(pub usize);

/// Names a SubDevice by its index in the declaration or by its position on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Address {
    /// Index in the declaration; valid while a declaration is active.
    Declared(SubDeviceId),
    /// Position on the bus at the last scan; valid before a declaration is active.
    Scanned(Position),
}

impl Address {
    /// A write into the memory of this SubDevice.
    pub(crate) fn memory_write(self, kind: WriteKind) -> MemoryWrite {
        match self {
            Address::Declared(subdevice) => MemoryWrite::new(kind, false, subdevice.0),
            Address::Scanned(position) => MemoryWrite::new(kind, true, usize::from(position.0)),
        }
    }
}

/// A declared SubDevice that is at another position than before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Move {
    /// The SubDevice.
    pub subdevice: SubDeviceId,
    /// Position before.
    pub from: Position,
    /// Position now.
    pub to: Position,
}

impl From<SubDeviceId> for Address {
    fn from(subdevice: SubDeviceId) -> Address {
        Address::Declared(subdevice)
    }
}

impl From<Position> for Address {
    fn from(position: Position) -> Address {
        Address::Scanned(position)
    }
}

impl fmt::Display for SubDeviceId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl fmt::Display for GroupId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Address::Declared(subdevice) => write!(f, "SubDevice {subdevice}"),
            Address::Scanned(position) => write!(f, "SubDevice at position {position}"),
        }
    }
}
