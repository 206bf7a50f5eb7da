//! Cables by the ports at their ends: station addresses, which stay as they are when positions move.

use ringcat_wire::address::StationAddress;

/// A port, by the station address of its SubDevice.
pub type End = (StationAddress, u8);

/// Both ends of a cable, the smaller one first.
pub(super) type Ends = (End, End);

/// The same cable from either end.
pub(super) fn ends((one, other): (End, End)) -> Ends {
    if one <= other { (one, other) } else { (other, one) }
}
