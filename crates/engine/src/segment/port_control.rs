//! Orders to SubDevices about their ports.
//!
//! Rings of which no frame comes back are looked into by writing the loops of all ports of their junctions at once. A
//! port that was closed on purpose must stay closed then, also where that was less than a look ago, or where the answer
//! to the order did not come back any more. So an order counts from before it leaves on, and nothing that is read while
//! it is under way.

use ringcat_wire::address::StationAddress;
use ringcat_wire::register::DlControl;

/// A port that was closed to cut a SubDevice off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BlockedPort {
    /// Station address of the neighbour whose port it is.
    pub station: StationAddress,
    /// Port 0..3.
    pub port: u8,
}

/// The order to a junction.
#[derive(Clone, Copy, Debug)]
pub struct PortControl {
    /// The junction.
    pub station: StationAddress,
    /// The order.
    pub control: DlControl,
    /// Orders of the application so far.
    pub orders: u32,
    /// Of these the ones that are under way.
    pub under_way: u32,
}
