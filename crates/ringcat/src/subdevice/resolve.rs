//! Finds a SubDevice by its address, and its name for messages.

use ringcat_engine::info::SubDeviceInfo;
use ringcat_engine::main_device::{Address, MainDevice as Engine};

use super::error::SubDeviceFailure;
use super::name::SubDeviceName;

/// The number of a SubDevice in the engine.
pub(super) fn find(engine: &Engine, address: Address) -> Result<usize, SubDeviceFailure> {
    let Some(scanned) = engine.scanned_count() else { return Err(SubDeviceFailure::NotScanned) };
    let declared = engine.stations().len();
    match address {
        Address::Declared(_) if declared == 0 => Err(SubDeviceFailure::NotActive),
        Address::Declared(subdevice) if subdevice.0 < declared => Ok(subdevice.0),
        Address::Declared(_) => Err(SubDeviceFailure::NotDeclared { declared }),
        Address::Scanned(_) if declared > 0 && !engine.has_idle_operation() => Err(SubDeviceFailure::Active),
        Address::Scanned(_) => engine.number(address).ok_or(SubDeviceFailure::NoPosition { scanned }),
    }
}

/// What the scan found about a SubDevice; `None` where it was absent.
pub(crate) fn info(engine: &Engine, number: usize) -> Option<SubDeviceInfo> {
    engine.info_at(engine.station(number)?)
}

impl SubDeviceName {
    pub(crate) fn of(engine: &Engine, address: Address) -> SubDeviceName {
        let number = find(engine, address).ok();
        let info = number.and_then(|number| info(engine, number));
        let station = number.and_then(|number| engine.station(number));
        SubDeviceName { address, name: info.map_or_else(String::new, |info| info.name), station }
    }
}
