//! Ports of SubDevices, and the cables between two of them.

use core::fmt;

use ringcat_wire::address::Position;

/// A port of a SubDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PortOf {
    /// Position of the SubDevice, as index.
    pub(crate) node: usize,
    /// Port 0..3.
    pub(crate) port: u8,
}

impl PortOf {
    /// Port 0..3 of the SubDevice at a position.
    pub const fn new(position: Position, port: u8) -> PortOf {
        PortOf { node: position.0 as usize, port }
    }

    /// Position of the SubDevice.
    pub const fn position(self) -> Position {
        // A scan counts SubDevices in 16 bits (protocol 2.2).
        Position(self.node as u16)
    }

    /// Number of the port, 0..3.
    pub const fn port(self) -> u8 {
        self.port
    }
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
    /// The side farther from the main link.
    pub far: PortOf,
}

impl fmt::Display for Connection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "between {} and {}", self.near, self.far)
    }
}
