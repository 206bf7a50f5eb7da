//! Rings behind a junction (protocol 9.4): how they lie in the tree, and which cables they have.
//!
//! A local ring leaves its junction through one port, passes its members, and comes back through a later one; frames
//! meet the members in the same order whether it is whole or broken at one place. So the tree has it as a branch on the
//! port where it begins, with the two ports of the closing cable left out: whole and broken, it reads the same.

use alloc::vec::Vec;

use super::port::PortOf;

/// The cable through which a local ring comes back to its junction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Closing {
    /// The junction, and the port at which frames come back.
    pub head: PortOf,
    /// The last SubDevice of the ring, and the port through which they leave it.
    pub tail: PortOf,
}

/// A cable of a local ring.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct RingCable {
    /// The port from which frames come. `None` where it is not known: the ring was broken there when it was looked at.
    pub near: Option<PortOf>,
    /// The port that they reach.
    pub far: PortOf,
}

/// A ring behind a junction.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LocalRing {
    /// Where it closes.
    pub closing: Closing,
    /// Its cables in the order in which frames run, the closing one last. From the break on where it was broken when it
    /// was looked at.
    pub cables: Vec<RingCable>,
}

impl LocalRing {
    /// Whether one of its cables ends at a port.
    pub fn is_at(&self, at: PortOf) -> bool {
        self.cables.iter().any(|cable| cable.near == Some(at) || cable.far == at)
    }
}
