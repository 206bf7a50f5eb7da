//! Cables by the ports at their ends. SubDevices are named by station address, because positions change with the
//! cabling.

use ringcat_wire::address::StationAddress;

/// A port: the station address of its SubDevice, and the port number.
pub type End = (StationAddress, u8);

/// Both ends of a cable, the smaller one first.
pub(super) type Ends = (End, End);

/// The same cable from either end.
pub(super) fn ends((one, other): (End, End)) -> Ends {
    if one <= other { (one, other) } else { (other, one) }
}
