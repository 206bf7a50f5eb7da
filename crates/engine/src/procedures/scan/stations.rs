//! Station addresses assigned by a scan, by position.

use ringcat_wire::address::{Position, StationAddress};

/// Station address of the SubDevice at position 0; the others follow.
pub const FIRST_STATION: u16 = 0x1001;
/// Maximum number of SubDevices of a scan: addresses from [`FIRST_STATION`] to the end of the address space.
pub const MAX_SUBDEVICES: u16 = u16::MAX - FIRST_STATION;

/// The station address that a scan assigns to a position.
pub const fn station_at(position: Position) -> StationAddress {
    StationAddress(FIRST_STATION + position.0)
}
