//! The owner of an EEPROM: EtherCAT or the PDI (protocol 3.8, registers 0x0500 and 0x0501).

use ringcat_wire::address::StationAddress;
use ringcat_wire::register::{SiiConfiguration, SiiPdiAccess, map};

use super::ServiceError;
use crate::procedures::sii::{assign, claim};
use crate::supervisor::{Bus, BusError};

/// A side that may use an EEPROM.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum EepromOwner {
    /// The MainDevice.
    Ethercat,
    /// The application of the SubDevice.
    Pdi,
}

/// What both registers show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct EepromOwnership {
    /// The side to which the EEPROM is assigned (0x0500, bit 0).
    pub assigned: EepromOwner,
    /// The side that uses it (0x0501, bit 0): a PDI that has taken it keeps it until it gives it back, or until it is
    /// taken by force.
    pub active: EepromOwner,
}

/// How an EEPROM is assigned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum EepromAssignment {
    /// Offered to the PDI, which takes it when it needs it.
    ToPdi,
    /// Back to EtherCAT, as soon as the PDI has given it back.
    ToEthercat,
    /// Back to EtherCAT at once (0x0500, bit 1): an access of the PDI is cut off.
    Force,
}

impl EepromOwner {
    const fn of(is_pdi: bool) -> EepromOwner {
        if is_pdi { EepromOwner::Pdi } else { EepromOwner::Ethercat }
    }
}

/// Reads the owner.
pub(crate) async fn owner(bus: &Bus, station: StationAddress) -> Result<EepromOwnership, BusError> {
    let [configuration, access] = bus.fprd_array(station, map::SII_CONFIGURATION).await?;
    Ok(EepromOwnership {
        assigned: EepromOwner::of(SiiConfiguration::from_bits(configuration).offer_pdi),
        active: EepromOwner::of(SiiPdiAccess::from_bits(access).pdi_access),
    })
}

/// Assigns it, and reads the owner back.
pub(crate) async fn set_owner(
    bus: &Bus,
    station: StationAddress,
    assignment: EepromAssignment,
) -> Result<EepromOwnership, ServiceError> {
    match assignment {
        EepromAssignment::ToPdi => assign(bus, station, true).await?,
        EepromAssignment::ToEthercat => assign(bus, station, false).await?,
        EepromAssignment::Force => claim(bus, station).await?,
    }
    Ok(owner(bus, station).await?)
}
