//! How messages name a SubDevice.

use std::fmt;

use ringcat_engine::main_device::Address;
use ringcat_wire::address::StationAddress;

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
