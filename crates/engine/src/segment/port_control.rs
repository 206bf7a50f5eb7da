//! Port commands to SubDevices, and settings of ports that are changed for a moment.
//!
//! When no frame returns, rings are examined by writing the loops of all ports of their junctions at once. A port that
//! was closed on purpose must stay closed then, also if it was closed after the last scan, or if the answer to the
//! command was lost. So a command is stored before it is sent, and values read while it is under way are ignored.

use ringcat_wire::address::StationAddress;
use ringcat_wire::register::DlControl;

/// A port that was closed to cut a SubDevice off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct BlockedPort {
    /// Station address of the neighbour whose port it is.
    pub station: StationAddress,
    /// Port 0..3.
    pub port: u8,
}

/// The port control of a junction, or of a SubDevice whose ports are changed for a measurement.
#[derive(Clone, Copy, Debug)]
pub struct PortControl {
    /// The SubDevice.
    pub station: StationAddress,
    /// The last command.
    pub control: DlControl,
    /// Commands of the application so far.
    pub orders: u32,
    /// Commands of the application under way.
    pub under_way: u32,
}
