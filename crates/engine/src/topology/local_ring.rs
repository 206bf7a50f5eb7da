//! Rings behind a junction (protocol 9.4): their place in the tree, and their cables.
//!
//! A local ring begins at one port of its junction, connects its members, and returns to a later port. Frames pass the
//! members in the same order whether the ring is closed or broken at one cable. So the tree contains the ring as a
//! branch on the port where it begins, without the two ports of the closing cable: the tree is the same for a closed
//! and a broken ring.

use alloc::vec::Vec;

use super::port::PortOf;

/// The cable through which a local ring returns to its junction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Closing {
    /// The junction, and its port at which frames return.
    pub head: PortOf,
    /// The last SubDevice of the ring, and the port through which frames leave it.
    pub tail: PortOf,
}

/// A cable of a local ring.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct RingCable {
    /// The port from which frames come. `None` if unknown: the ring was broken there at the last scan.
    pub near: Option<PortOf>,
    /// The port that they reach.
    pub far: PortOf,
}

/// A ring behind a junction.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LocalRing {
    /// Its closing cable.
    pub closing: Closing,
    /// Its cables in the order of processing, the closing cable last. If the ring was broken at the last scan: only
    /// those from the break on.
    pub cables: Vec<RingCable>,
}

impl LocalRing {
    /// Whether one of its cables ends at a port.
    pub fn is_at(&self, at: PortOf) -> bool {
        self.cables.iter().any(|cable| cable.near == Some(at) || cable.far == at)
    }
}
