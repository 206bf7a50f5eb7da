//! Result of a complete rescan, as the model takes it.

use ringcat_wire::address::StationAddress;

use crate::topology::Topology;

/// Result of a complete rescan.
#[derive(Clone, Copy, Debug)]
pub struct Seen<'a> {
    /// Connections.
    pub topology: &'a Topology,
    /// Station addresses by position.
    pub stations: &'a [StationAddress],
    /// Members by position.
    pub members: &'a [Option<usize>],
}
