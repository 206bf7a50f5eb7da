//! From how an application names a SubDevice to how the engine knows it, and to its name in messages.

use ringcat_engine::info::SubDeviceInfo;
use ringcat_engine::main_device::{MainDevice as Engine, SubDeviceId};
use ringcat_wire::address::Position;

use super::error::SubDeviceFailure;
use super::name::{Address, SubDeviceName};

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

impl SubDeviceName {
    pub(crate) fn of(engine: &Engine, address: Address) -> SubDeviceName {
        let number = address.find(engine).ok();
        let info = number.and_then(|number| info(engine, number));
        let station = number.and_then(|number| engine.station(number));
        SubDeviceName { address, name: info.map_or_else(String::new, |info| info.name), station }
    }
}
