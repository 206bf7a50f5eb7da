//! A log of the frames that leave and reach the interfaces of the hosts: evidence for checkers, as the logs of the
//! devices are. Off unless a checker turns it on, and to be taken before it is full.

use crate::cable::HostLink;
use crate::time::SimTime;

/// Most frames between two calls of a checker.
const CAPACITY: usize = 65_536;
/// Bytes of a frame that are kept: addresses, EtherType, EtherCAT header, the header of the first datagram.
const HEAD: usize = 26;

/// A frame at an interface.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HostFrame {
    /// When it was given to the interface, or when its last bit arrived.
    pub at: SimTime,
    /// The interface.
    pub link: HostLink,
    /// Whether the host sent it.
    pub is_sent: bool,
    /// Its beginning.
    pub head: [u8; HEAD],
}

/// The frames since the last call of the checker.
#[derive(Debug, Default)]
pub(crate) struct HostLog {
    frames: Vec<HostFrame>,
}

impl HostLog {
    /// Notes a frame, which has at least the length of the shortest Ethernet frame.
    ///
    /// # Panics
    /// The checker does not take the log.
    pub(crate) fn note(&mut self, at: SimTime, link: HostLink, is_sent: bool, bytes: &[u8]) {
        assert!(self.frames.len() < CAPACITY, "the log of the hosts is on, and nothing takes it");
        let mut head = [0; HEAD];
        head.iter_mut().zip(bytes).for_each(|(to, from)| *to = *from);
        self.frames.push(HostFrame { at, link, is_sent, head });
    }

    pub(crate) fn take(&mut self) -> Vec<HostFrame> {
        core::mem::take(&mut self.frames)
    }
}
