//! Checks the address of a SubDevice; its name for messages.

use ringcat_engine::main_device::{Address, MainDevice as Engine};

use super::error::SubDeviceFailure;
use super::name::SubDeviceName;

/// Why a SubDevice cannot be used by this address.
pub(super) fn check(engine: &Engine, address: Address) -> Result<(), SubDeviceFailure> {
    let Some(scanned) = engine.scanned_count() else { return Err(SubDeviceFailure::NotScanned) };
    if engine.station(address).is_some() {
        return Ok(());
    }
    let declared = engine.stations().len();
    Err(match address {
        Address::Declared(_) if declared == 0 => SubDeviceFailure::NotActive,
        Address::Declared(_) => SubDeviceFailure::NotDeclared { declared },
        Address::Scanned(_) if declared > 0 && !engine.has_idle_operation() => SubDeviceFailure::Active,
        Address::Scanned(_) => SubDeviceFailure::NoPosition { scanned },
    })
}

impl SubDeviceName {
    pub(crate) fn of(engine: &Engine, address: Address) -> SubDeviceName {
        let name = engine.info(address).map_or_else(String::new, |info| info.name);
        SubDeviceName { address, name, station: engine.station(address) }
    }
}
