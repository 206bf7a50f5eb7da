//! Links in memory: frames go into rings of fixed size, a peer answers in the same process.
//!
//! For tests, benches, and applications with their own access to the wire. Nothing is allocated after construction;
//! frames that do not fit are counted.

use ringcat_engine::link::Link;
use ringcat_engine::time::Instant;
use ringcat_wire::frame::{MAX_FRAME_VLAN, MacAddress};

use crate::links::{Links, PerLink};

/// A frame in a ring.
#[derive(Clone, Debug)]
struct Slot {
    link: Link,
    length: usize,
    bytes: [u8; MAX_FRAME_VLAN],
}

/// A bounded queue of frames.
#[derive(Debug)]
pub struct FrameRing {
    slots: Vec<Slot>,
    head: usize,
    count: usize,
    overflowed: u64,
}

impl FrameRing {
    /// A queue for this many frames, at least one.
    pub fn new(capacity: usize) -> FrameRing {
        let slot = Slot { link: Link::Main, length: 0, bytes: [0; MAX_FRAME_VLAN] };
        FrameRing { slots: vec![slot; capacity.max(1)], head: 0, count: 0, overflowed: 0 }
    }

    /// Appends a frame. False if the queue is full or the frame is too long; such frames are counted.
    pub fn push(&mut self, link: Link, frame: &[u8]) -> bool {
        if self.count == self.slots.len() || frame.len() > MAX_FRAME_VLAN {
            self.overflowed += 1;
            return false;
        }
        let mut at = self.head + self.count;
        if at >= self.slots.len() {
            at -= self.slots.len();
        }
        let slot = &mut self.slots[at];
        slot.bytes[..frame.len()].copy_from_slice(frame);
        slot.length = frame.len();
        slot.link = link;
        self.count += 1;
        true
    }

    /// Takes the oldest frame. Its bytes are valid, and may be changed, until the next push.
    pub fn pop(&mut self) -> Option<(Link, &mut [u8])> {
        if self.count == 0 {
            return None;
        }
        let at = self.head;
        self.head = if at + 1 == self.slots.len() { 0 } else { at + 1 };
        self.count -= 1;
        let slot = &mut self.slots[at];
        Some((slot.link, &mut slot.bytes[..slot.length]))
    }

    /// Frames in the queue.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Whether the queue is empty.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Frames that did not fit.
    pub fn overflowed(&self) -> u64 {
        self.overflowed
    }
}

/// Links whose other end is in the same process.
#[derive(Debug)]
#[non_exhaustive]
pub struct MemoryLinks {
    /// Frames that were sent, for the peer to take.
    pub sent: FrameRing,
    /// Frames from the peer.
    pub arriving: FrameRing,
    now: Instant,
    addresses: PerLink<MacAddress>,
}

impl MemoryLinks {
    /// Links with these addresses and queues of `capacity` frames.
    pub fn new(main: MacAddress, redundant: Option<MacAddress>, capacity: usize) -> MemoryLinks {
        MemoryLinks {
            sent: FrameRing::new(capacity),
            arriving: FrameRing::new(capacity),
            now: Instant::default(),
            addresses: PerLink::new(main, redundant),
        }
    }

    /// Sets the time.
    pub fn set_now(&mut self, now: Instant) {
        self.now = now;
    }
}

impl Links for MemoryLinks {
    fn now(&self) -> Instant {
        self.now
    }

    fn addresses(&self) -> PerLink<MacAddress> {
        self.addresses
    }

    fn send(&mut self, link: Link, frame: &[u8]) {
        self.sent.push(link, frame);
    }

    fn receive(&mut self, take: &mut dyn FnMut(Link, &[u8])) -> bool {
        match self.arriving.pop() {
            Some((link, frame)) => {
                take(link, frame);
                true
            }
            None => false,
        }
    }

    /// Time passes at once.
    fn wait(&mut self, until: Instant) {
        if self.arriving.is_empty() {
            self.now = self.now.max(until);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: links
    #[test]
    fn frames_come_out_in_order_and_an_overflow_is_counted() {
        let mut ring = FrameRing::new(2);
        assert!(ring.push(Link::Main, &[1]));
        assert!(ring.push(Link::Redundant, &[2, 2]));
        assert!(!ring.push(Link::Main, &[3]));
        assert!(!FrameRing::new(1).push(Link::Main, &[0; MAX_FRAME_VLAN + 1]));
        assert_eq!(ring.pop().map(|(link, frame)| (link, frame.to_vec())), Some((Link::Main, vec![1])));
        assert!(ring.push(Link::Main, &[4]));
        assert_eq!(ring.pop().map(|(link, frame)| (link, frame.to_vec())), Some((Link::Redundant, vec![2, 2])));
        assert_eq!(ring.pop().map(|(_, frame)| frame.to_vec()), Some(vec![4]));
        assert!(ring.pop().is_none());
        assert_eq!(ring.overflowed(), 1);
    }
}
