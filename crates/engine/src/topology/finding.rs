//! Findings about the cabling.

use core::fmt;

/// A finding about the cabling.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Finding {
    /// Port 0 is not connected. A frame passes at most one such SubDevice (protocol 2.4).
    UnconnectedPort0 {
        /// Position of the SubDevice.
        node: usize,
    },
    /// Frames enter at another port than 0: IN and OUT are swapped (LC-01).
    CrossedLine {
        /// Position of the SubDevice.
        node: usize,
        /// Port at which they enter.
        entry_port: u8,
    },
    /// A port is forced open without a link: frames are lost there.
    ForcedOpen {
        /// Position of the SubDevice.
        node: usize,
        /// The port.
        port: u8,
    },
    /// A port is closed although there is communication on it: forced closed, or closed in mode auto-close and not
    /// opened again.
    ClosedWithLink {
        /// Position of the SubDevice.
        node: usize,
        /// The port.
        port: u8,
    },
    /// A physical link without communication.
    LinkWithoutCommunication {
        /// Position of the SubDevice.
        node: usize,
        /// The port.
        port: u8,
    },
    /// Its status is inconsistent with that of the others: no open port is left for it in the tree.
    Inconsistent {
        /// Position of the SubDevice.
        node: usize,
    },
}

impl Finding {
    /// Position of the SubDevice.
    pub fn node(&self) -> usize {
        match *self {
            Finding::UnconnectedPort0 { node }
            | Finding::CrossedLine { node, .. }
            | Finding::ForcedOpen { node, .. }
            | Finding::ClosedWithLink { node, .. }
            | Finding::LinkWithoutCommunication { node, .. }
            | Finding::Inconsistent { node } => node,
        }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Finding::UnconnectedPort0 { node } => write!(f, "SubDevice {node}: port 0 is unconnected"),
            Finding::CrossedLine { node, entry_port } => {
                write!(f, "SubDevice {node}: line crossed, frames enter at port {entry_port}")
            }
            Finding::ForcedOpen { node, port } => write!(f, "SubDevice {node} port {port}: held open without a link"),
            Finding::ClosedWithLink { node, port } => {
                write!(f, "SubDevice {node} port {port}: kept closed in spite of a link")
            }
            Finding::LinkWithoutCommunication { node, port } => {
                write!(f, "SubDevice {node} port {port}: link without communication")
            }
            Finding::Inconsistent { node } => write!(f, "SubDevice {node}: DL status does not fit the others"),
        }
    }
}
