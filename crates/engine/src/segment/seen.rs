//! A segment as a look at all of it has shown it.

use ringcat_wire::address::StationAddress;

use crate::topology::Topology;

/// A segment as it was seen, all of it.
#[derive(Clone, Copy, Debug)]
pub struct Seen<'a> {
    /// Connections.
    pub topology: &'a Topology,
    /// Station addresses by position.
    pub stations: &'a [StationAddress],
    /// Members by position.
    pub members: &'a [Option<usize>],
}
