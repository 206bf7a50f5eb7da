//! Rings behind a junction (protocol 9.4): their place in the tree, and their cables.
//!
//! A local ring leaves its junction through one port, passes its members, and comes back through a later one; frames
//! pass the members in the same order whether it is closed or broken at one place. So the tree contains it as a branch
//! on the port where it begins, without the two ports of the closing cable: the same tree for a closed and a broken
//! ring.

use alloc::vec::Vec;

use super::port::PortOf;

/// The cable through which a local ring returns to its junction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Closing {
    /// The junction, and its port at which frames return.
    pub head: PortOf,
    /// The last SubDevice of the ring, and the port through which they leave it.
    pub tail: PortOf,
}

/// A cable of a local ring.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct RingCable {
    /// The port from which frames come. `None` where unknown: the ring was broken there at the last look.
    pub near: Option<PortOf>,
    /// The port that they reach.
    pub far: PortOf,
}

/// A ring behind a junction.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LocalRing {
    /// Its closing cable.
    pub closing: Closing,
    /// Its cables in the order of travel, the closing one last. Where it was broken at the last look, only those from
    /// the break on.
    pub cables: Vec<RingCable>,
}

impl LocalRing {
    /// Whether one of its cables ends at a port.
    pub fn is_at(&self, at: PortOf) -> bool {
        self.cables.iter().any(|cable| cable.near == Some(at) || cable.far == at)
    }
}
