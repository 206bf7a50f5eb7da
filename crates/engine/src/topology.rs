//! Who hangs on which port of whom, from DL status and receive times (facts 2.1 to 2.4, 2.9, 9.5).
//!
//! In goes what each SubDevice reported, in the order in which frames meet the processing units: first those that the
//! frames of the main link met, then those of the redundant link. Out comes a tree and what is odd about the
//! cabling. Status words are taken as they come: none makes this panic, what does not fit becomes a finding.
//!
//! In a broken ring the SubDevices of the redundant link form a tree of their own. It is oriented like the intact
//! ring, with the SubDevice next to the break as its head: that its port 0 is unconnected is the break, no finding.
//!
//! Rings behind junctions ([`LocalRing`]) have to be known: open ports do not tell them from a tree.

mod ends;
mod local_ring;
mod place;
mod stub;

use alloc::vec::Vec;
use core::fmt;

use ringcat_wire::register::{DlStatus, PortKind};

use crate::info::SubDeviceInfo;
pub(crate) use ends::{are_doubtful, ends_of_break, seam};
use local_ring::Rings;
pub use local_ring::{Closing, LocalRing, RingCable, candidates};
pub(crate) use local_ring::{candidates_with, rings_shown, with_longer_rings};

/// What a SubDevice reported about its ports.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NodeStatus {
    /// Register DL_STATUS.
    pub dl_status: DlStatus,
    /// Times at which one frame came in at port 0..3, in nanoseconds of the SubDevice's own clock.
    pub receive_times: Option<[u32; 4]>,
    /// Kind of port 0..3.
    pub ports: [PortKind; 4],
}

impl From<&SubDeviceInfo> for NodeStatus {
    fn from(info: &SubDeviceInfo) -> NodeStatus {
        NodeStatus { dl_status: info.dl_status, receive_times: info.receive_times, ports: info.controller.ports }
    }
}

/// A SubDevice in the tree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Node {
    /// SubDevice and port on which it hangs; `None` for the first one of a link.
    pub parent: Option<(usize, u8)>,
    /// Its own port towards the parent or the link.
    pub entry_port: u8,
    /// SubDevice on port 0..3, the parent not included.
    pub children: [Option<usize>; 4],
}

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

/// A cable or neighbourhood of two SubDevices.
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

/// Something odd about the cabling.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Finding {
    /// Nothing is plugged into port 0: frames pass at most one such SubDevice (facts 2.4).
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
    /// A port is held open without a link: frames get lost there.
    ForcedOpen {
        /// Position of the SubDevice.
        node: usize,
        /// The port.
        port: u8,
    },
    /// A port is kept closed though there is communication on it: forced, or auto-close and not opened again.
    ClosedWithLink {
        /// Position of the SubDevice.
        node: usize,
        /// The port.
        port: u8,
    },
    /// A physical link, but no communication.
    LinkWithoutCommunication {
        /// Position of the SubDevice.
        node: usize,
        /// The port.
        port: u8,
    },
    /// What it reports does not fit the others; it stands in the tree without a parent or with ports left over.
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

/// The tree of a segment, or the two trees of a broken ring.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Topology {
    /// SubDevices by position.
    pub nodes: Vec<Node>,
    /// SubDevices in front, met by the frames of the main link.
    pub main_count: usize,
    /// Head of the tree on the redundant link, next to the break; `None` in a closed ring or without a second link.
    pub redundant_head: Option<usize>,
    /// Where the SubDevices of the main link end in an open ring, or all of them where only the redundant link meets any and
    /// enters each at port 0. Not where branches leave several ports that a cable of the ring could be missing from.
    pub main_end: Option<PortOf>,
    /// Ports that are open but lead to no SubDevice: the redundant link, or a device that is no SubDevice. In the order
    /// in which frames of the main link, then of the redundant link, pass them.
    pub open_ports: Vec<PortOf>,
    /// What is odd, by position.
    pub findings: Vec<Finding>,
    /// Rings behind a junction, as far as they are known.
    pub local_rings: Vec<LocalRing>,
}

impl Topology {
    /// Builds the tree. The first `main_count` SubDevices are those that the frames of the main link met.
    pub fn build(nodes: &[NodeStatus], main_count: usize) -> Topology {
        Topology::with_local_rings(nodes, main_count, &[])
    }

    /// As [`Topology::build`], with rings behind junctions. Each of them is a branch on the port where it begins, whole or
    /// broken; a connection that does not fit is left out.
    pub fn with_local_rings(nodes: &[NodeStatus], main_count: usize, closings: &[Closing]) -> Topology {
        place::build(nodes, main_count.min(nodes.len()), &Rings::new(nodes, closings))
    }

    /// Whether neighbours are an assumption: frames of both links meet SubDevices though no break separates them. Who of
    /// them is crossed, or hangs on a port 2, does not show as long as the ring is closed (LC-02).
    pub fn is_assumed(&self) -> bool {
        self.redundant_head.is_none() && self.main_count < self.nodes.len()
    }

    /// Whether the cable that leads to a SubDevice from the one before it is part of a local ring.
    pub fn is_in_local_ring(&self, node: usize) -> bool {
        let Some(here) = self.nodes.get(node) else { return false };
        let far = PortOf { node, port: here.entry_port };
        self.local_rings.iter().flat_map(|ring| &ring.cables).any(|cable| cable.far == far)
    }

    /// Whether a SubDevice is another one, or is reached through it.
    pub(crate) fn hangs_behind(&self, node: usize, other: usize) -> bool {
        let mut at = node;
        for _ in 0..=self.nodes.len() {
            if at == other {
                return true;
            }
            let Some((parent, _)) = self.nodes.get(at).and_then(|here| here.parent) else { break };
            at = parent;
        }
        false
    }

    /// The cable that leads to a SubDevice from the one before it.
    pub fn connection_to(&self, node: usize) -> Option<Connection> {
        let here = self.nodes.get(node)?;
        let (parent, port) = here.parent?;
        let far = PortOf { node, port: here.entry_port };
        Some(Connection { near: PortOf { node: parent, port }, far })
    }

    /// The cable on a port.
    pub fn connection_at(&self, at: PortOf) -> Option<Connection> {
        let here = self.nodes.get(at.node)?;
        match here.children.get(usize::from(at.port))? {
            Some(child) => self.connection_to(*child),
            None if here.entry_port == at.port => self.connection_to(at.node),
            None => None,
        }
    }

    /// The cable between two SubDevices, in either order.
    pub fn connection_between(&self, a: usize, b: usize) -> Option<Connection> {
        [(a, b), (b, a)]
            .into_iter()
            .filter_map(|(from, to)| self.connection_to(to).filter(|connection| connection.near.node == from))
            .next()
    }
}

#[cfg(test)]
mod tests;
