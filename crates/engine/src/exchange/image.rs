//! A domain's image, and when the inputs of each of its datagrams came into it.
//!
//! With several cycles under way, flights of the same datagram share this: inputs of an older cycle never overwrite
//! those of a newer one.

use alloc::boxed::Box;
use alloc::vec;

/// When inputs came. Cycles are counted from 1 here, so that zero is never.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Moment {
    /// Cycle in which the flight that brought them left.
    pub left: u64,
    /// Cycle in which it came back.
    pub came: u64,
}

/// The last deliveries of a datagram's inputs.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Delivery {
    /// Of all inputs.
    pub all: Moment,
    /// Of the inputs of those that took part.
    pub part: Moment,
}

/// The image and the deliveries of all datagrams, in the order of the domain's frames.
#[derive(Debug)]
pub(crate) struct Image {
    pub bytes: Box<[u8]>,
    pub deliveries: Box<[Delivery]>,
    /// When, as a cycle plus one, the newest flight of which anything came had left.
    pub newest: u64,
}

impl Image {
    pub fn new(bytes: usize, datagrams: usize) -> Image {
        Image {
            bytes: vec![0; bytes].into_boxed_slice(),
            deliveries: vec![Delivery::default(); datagrams].into_boxed_slice(),
            newest: 0,
        }
    }
}

impl Delivery {
    /// Whether a flight that left later has brought inputs, by the moment of this one.
    pub fn is_newer_than(&self, moment: Moment) -> bool {
        self.all.left > moment.left || self.part.left > moment.left
    }

    /// What a flight brought, by the cycle in which it left, does not count as new in this cycle.
    pub fn withdraw(&mut self, left: u64, cycle: u64) {
        for moment in [&mut self.all, &mut self.part] {
            if moment.left == left {
                *moment = Moment { left: left - 1, came: moment.came.min(cycle) };
            }
        }
    }
}
