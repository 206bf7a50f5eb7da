//! Who hangs on which port of whom, from DL status and receive times (protocol 2.1 to 2.4, 2.9, 9.5).
//!
//! In goes what each SubDevice reported, in the order in which frames meet the processing units: first those that the
//! frames of the main link met, then those of the redundant link. Out comes a tree and what is odd about the
//! cabling. Status words are taken as they come: none makes this panic, what does not fit becomes a finding.
//!
//! In a broken ring the SubDevices of the redundant link form a tree of their own. It is oriented like the intact
//! ring, with the SubDevice next to the break as its head: that its port 0 is unconnected is the break, no finding.
//!
//! Rings behind junctions ([`LocalRing`]) have to be known: open ports do not tell them from a tree.

mod candidates;
mod ends;
mod finding;
mod local_ring;
mod place;
mod port;
mod rings;
mod stub;
mod tree;

pub use candidates::candidates;
pub(crate) use candidates::{candidates_with, rings_shown, with_longer_rings};
pub(crate) use ends::{are_doubtful, ends_of_break, seam};
pub use finding::Finding;
pub use local_ring::{Closing, LocalRing, RingCable};
pub use port::{Connection, PortOf};
pub use tree::{Node, NodeStatus, Topology};

use rings::Rings;

impl Topology {
    /// Builds the tree. The first `main_count` SubDevices are those that the frames of the main link met.
    pub fn build(nodes: &[NodeStatus], main_count: usize) -> Topology {
        Topology::with_local_rings(nodes, main_count, &[])
    }

    /// As [`Topology::build`], with rings behind junctions. Each of them is a branch on the port where it begins, whole
    /// or broken; a connection that does not fit is left out.
    pub fn with_local_rings(nodes: &[NodeStatus], main_count: usize, closings: &[Closing]) -> Topology {
        place::build(nodes, main_count.min(nodes.len()), &Rings::new(nodes, closings))
    }
}

#[cfg(test)]
mod tests;
