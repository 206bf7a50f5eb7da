//! The connections between ports of SubDevices, from DL status and receive times (protocol 2.1 to 2.4, 2.9, 9.5).
//!
//! Input: the registers of each SubDevice, in the order in which frames pass the processing units: first the SubDevices
//! on the main link, then those on the redundant link. Output: a tree, and findings about the cabling. Any status word
//! is allowed: none causes a panic, an inconsistent status word becomes a finding.
//!
//! In a broken ring the SubDevices of the redundant link form a tree of their own, oriented like the intact ring, with
//! the SubDevice next to the break as its head: its unconnected port 0 is the break, not a finding.
//!
//! Rings behind junctions ([`LocalRing`]) must be passed in: open ports do not distinguish them from a tree.

mod candidates;
mod ends;
mod finding;
mod local_ring;
mod place;
mod port;
mod rings;
mod stub;
mod tree;

pub(crate) use candidates::{candidates_with, rings_shown, with_longer_rings};
pub(crate) use ends::{are_doubtful, ends_of_break, ends_of_earlier_break};
pub use finding::Finding;
pub use local_ring::{Closing, LocalRing, RingCable};
pub use port::PortOf;
pub use tree::{Node, NodeStatus, Topology};

use rings::Rings;

impl Topology {
    /// Builds the tree. The first `main_count` SubDevices are those on the main link.
    pub(crate) fn build(nodes: &[NodeStatus], main_count: usize) -> Topology {
        Topology::with_local_rings(nodes, main_count, &[])
    }

    /// As [`Topology::build`], with rings behind junctions. Each ring, closed or broken, is a branch on the port where
    /// it begins; a closing cable that does not fit is left out.
    pub(crate) fn with_local_rings(nodes: &[NodeStatus], main_count: usize, closings: &[Closing]) -> Topology {
        place::build(nodes, main_count.min(nodes.len()), &Rings::new(nodes, closings))
    }
}

#[cfg(test)]
mod tests;
