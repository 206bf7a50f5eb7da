//! The tree of a segment: the connections between SubDevices, and queries on them.

use alloc::vec::Vec;

use ringcat_wire::address::Position;
use ringcat_wire::register::{DlStatus, PortKind};

use super::finding::Finding;
use super::local_ring::LocalRing;
use super::port::{Connection, PortOf};
use crate::info::SubDeviceInfo;

/// Port registers of a SubDevice.
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
    /// SubDevice and port to which it is connected; `None` for the first one of a link.
    pub parent: Option<(usize, u8)>,
    /// Its own port towards the parent or the link.
    pub entry_port: u8,
    /// SubDevice on port 0..3, the parent not included.
    pub children: [Option<usize>; 4],
}

/// The tree of a segment, or the two trees of a broken ring.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Topology {
    /// SubDevices by position.
    pub nodes: Vec<Node>,
    /// Number of SubDevices on the main link.
    pub main_count: usize,
    /// Head of the tree on the redundant link, next to the break; `None` in a closed ring or without a second link.
    pub(crate) redundant_head: Option<usize>,
    /// The open port at the end of the main link's SubDevices in an open ring; if frames of the redundant link alone
    /// reach all SubDevices, each at port 0, the end of all of them. `None` if, because of branches, the cable of the
    /// ring could be missing at several ports.
    pub main_end: Option<PortOf>,
    /// Ports that are open without a SubDevice behind them: the redundant link, or a device that is no SubDevice. In
    /// the order in which frames of the main link, then of the redundant link, pass them.
    pub open_ports: Vec<PortOf>,
    /// Findings, by position.
    pub findings: Vec<Finding>,
    /// The known rings behind junctions.
    pub local_rings: Vec<LocalRing>,
}

impl Topology {
    /// Whether the neighbours are an assumption: both links have SubDevices although no break separates these. Which of
    /// them are crossed, or connected to a port 2, is not visible while the ring is closed (LC-02).
    pub fn is_assumed(&self) -> bool {
        self.redundant_head.is_none() && self.main_count < self.nodes.len()
    }

    /// Head of the tree on the redundant link, next to the break; `None` in a closed ring or without a second link.
    pub fn redundant_head(&self) -> Option<Position> {
        self.redundant_head.map(|node| PortOf { node, port: 0 }.position())
    }

    /// Whether the cable between a SubDevice and its parent is part of a local ring.
    pub fn is_in_local_ring(&self, subdevice: Position) -> bool {
        self.has_ring_cable(usize::from(subdevice.0))
    }

    /// As [`Topology::is_in_local_ring`].
    pub(crate) fn has_ring_cable(&self, node: usize) -> bool {
        let Some(here) = self.nodes.get(node) else { return false };
        let far = PortOf { node, port: here.entry_port };
        self.local_rings.iter().flat_map(|ring| &ring.cables).any(|cable| cable.far == far)
    }

    /// Whether a SubDevice is `other` itself, or is reached through `other`.
    pub(crate) fn is_behind(&self, node: usize, other: usize) -> bool {
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

    /// The cable between a SubDevice and its parent.
    pub fn connection_to(&self, subdevice: Position) -> Option<Connection> {
        self.cable_to(usize::from(subdevice.0))
    }

    /// As [`Topology::connection_to`].
    pub(crate) fn cable_to(&self, node: usize) -> Option<Connection> {
        let here = self.nodes.get(node)?;
        let (parent, port) = here.parent?;
        let far = PortOf { node, port: here.entry_port };
        Some(Connection { near: PortOf { node: parent, port }, far })
    }
}
