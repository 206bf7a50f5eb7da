//! Ports of SubDevices, and the cables between two of them.

use core::fmt;

/// A port of a SubDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PortOf {
    /// Position of the SubDevice.
    pub node: usize,
    /// Port 0..3.
    pub port: u8,
}

impl fmt::Display for PortOf {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "SubDevice {} port {}", self.node, self.port)
    }
}

/// A connection between two SubDevices.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Connection {
    /// The side nearer to the main link.
    pub near: PortOf,
    /// The other side.
    pub far: PortOf,
}

impl fmt::Display for Connection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "between {} and {}", self.near, self.far)
    }
}
