//! Which SubDevice is meant, and how messages name it.

use std::fmt;

use ringcat_engine::main_device::SubDeviceId;
use ringcat_wire::address::{Position, StationAddress};

/// Which SubDevice is meant: by its place in the declaration, or by its place on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Address {
    /// Index in the declaration; to be used once a declaration is active.
    Declared(SubDeviceId),
    /// Position on the bus at the last scan; to be used before a declaration is active.
    Scanned(Position),
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

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Address::Declared(subdevice) => write!(f, "SubDevice {subdevice}"),
            Address::Scanned(position) => write!(f, "SubDevice at position {position}"),
        }
    }
}

/// A SubDevice as messages name it: `SubDevice 1 "servo" (0x1002)`.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct SubDeviceName {
    /// How the application named it.
    pub address: Address,
    /// Its name in the SII; empty where it was not found by the scan or its SII has none.
    pub name: String,
    /// Its station address, where it has one.
    pub station: Option<StationAddress>,
}

impl fmt::Display for SubDeviceName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let SubDeviceName { address, name, station } = self;
        address.fmt(f)?;
        if !name.is_empty() {
            write!(f, " \"{name}\"")?;
        }
        station.map_or(Ok(()), |station| write!(f, " ({station})"))
    }
}
