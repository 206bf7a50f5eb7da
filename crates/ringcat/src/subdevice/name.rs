//! Which SubDevice is meant, and how messages name it.

use std::fmt;

use ringcat_engine::info::SubDeviceInfo;
use ringcat_engine::main_device::{MainDevice as Engine, SubDeviceId};
use ringcat_wire::address::{Position, StationAddress};

use super::error::SubDeviceFailure;

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

impl Address {
    /// From the number that services take: an index in the declaration once one is active, a position before.
    pub(crate) fn of_number(engine: &Engine, number: usize) -> Address {
        match (is_active(engine), u16::try_from(number)) {
            (false, Ok(position)) => Address::Scanned(Position(position)),
            (true, _) | (false, Err(_)) => Address::Declared(SubDeviceId(number)),
        }
    }

    /// The number by which the engine knows it now.
    pub(crate) fn find(self, engine: &Engine) -> Result<usize, SubDeviceFailure> {
        let scanned = engine.scanned_count();
        match (self, scanned) {
            (_, None) => Err(SubDeviceFailure::NotScanned),
            (Address::Declared(subdevice), Some(_)) => match engine.stations().len() {
                0 => Err(SubDeviceFailure::NotActive),
                declared if subdevice.0 < declared => Ok(subdevice.0),
                declared => Err(SubDeviceFailure::NotDeclared { declared }),
            },
            (Address::Scanned(_), Some(_)) if is_active(engine) => Err(SubDeviceFailure::Active),
            (Address::Scanned(position), Some(scanned)) => match usize::from(position.0) {
                number if number < scanned => Ok(number),
                _ => Err(SubDeviceFailure::NoPosition { scanned }),
            },
        }
    }
}

fn is_active(engine: &Engine) -> bool {
    !engine.stations().is_empty()
}

/// What the scan found about it; `None` where it was not there.
pub(crate) fn info(engine: &Engine, number: usize) -> Option<SubDeviceInfo> {
    engine.info_at(engine.station(number)?)
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

impl SubDeviceName {
    pub(crate) fn of(engine: &Engine, address: Address) -> SubDeviceName {
        let number = address.find(engine).ok();
        let info = number.and_then(|number| info(engine, number));
        let station = number.and_then(|number| engine.station(number));
        SubDeviceName { address, name: info.map_or_else(String::new, |info| info.name), station }
    }
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
