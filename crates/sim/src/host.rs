//! The network interfaces of a MainDevice: they send at 100 Mbit/s, one frame after the other, and store received
//! frames (protocol 1.3).

pub(crate) mod machine;
pub mod program;

use core::time::Duration;
use std::collections::VecDeque;

use crate::cable::{HostLink, LegId};
use crate::frame::SimFrame;
use crate::queue::Lane;
use crate::time::SimTime;

/// A frame received by the MainDevice.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Received {
    /// Time at which its last bit arrived.
    pub at: SimTime,
    /// The frame without FCS.
    pub bytes: Vec<u8>,
}

/// One interface.
#[derive(Debug)]
pub(crate) struct HostInterface {
    /// The outgoing direction of its cable, if a cable is plugged in.
    pub(crate) out: Option<LegId>,
    /// Received frames that were not fetched yet.
    pub(crate) received: VecDeque<Received>,
    /// Whether it was taken down.
    pub(crate) disconnected: bool,
    free_at: SimTime,
    ends: VecDeque<SimTime>,
    transmit_limit: usize,
    receive_limit: usize,
}

impl HostLink {
    /// The event lane for frames that enter the segment here; `None` if they do not take the fast path.
    pub(crate) const fn entry_lane(self) -> Option<Lane> {
        match self {
            HostLink::Main => Some(Lane::EntryMain),
            HostLink::Redundant => Some(Lane::EntryRedundant),
            HostLink::SecondMain | HostLink::SecondRedundant => None,
        }
    }
}

impl HostInterface {
    pub(crate) fn new(out: Option<LegId>, transmit_limit: usize, receive_limit: usize) -> HostInterface {
        HostInterface {
            out,
            received: VecDeque::with_capacity(receive_limit),
            disconnected: false,
            free_at: SimTime(0),
            ends: VecDeque::with_capacity(transmit_limit),
            transmit_limit,
            receive_limit,
        }
    }

    /// Queues a frame after the frames being sent. Returns the time at which its last bit leaves, or `None` if the
    /// queue is full.
    pub(crate) fn transmit(&mut self, now: SimTime, frame: &SimFrame) -> Option<SimTime> {
        while self.ends.front().is_some_and(|end| *end <= now) {
            self.ends.pop_front();
        }
        if self.ends.len() >= self.transmit_limit {
            return None;
        }
        let start = self.free_at.max(now);
        self.free_at = start + Duration::from_nanos(frame.occupies_ns());
        let end = start + Duration::from_nanos(frame.first_to_last_bit_ns());
        self.ends.push_back(end);
        Some(end)
    }

    /// Stores a frame, or returns it if the queue is full.
    pub(crate) fn deliver(&mut self, frame: Received) -> Result<(), Received> {
        if self.received.len() >= self.receive_limit {
            return Err(frame);
        }
        self.received.push_back(frame);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(len: usize) -> SimFrame {
        SimFrame::new(0, vec![0; len])
    }

    #[test]
    fn back_to_back_frames_are_one_wire_time_apart() {
        // protocol 1.3: 60 bytes, 8 of preamble, 4 of FCS, 12 of gap: 84 byte times of 80 ns.
        let mut host = HostInterface::new(None, 8, 8);
        assert_eq!(host.transmit(SimTime(1_000), &frame(60)), Some(SimTime(1_000 + 72 * 80)));
        assert_eq!(host.transmit(SimTime(1_000), &frame(60)), Some(SimTime(1_000 + 84 * 80 + 72 * 80)));
        assert_eq!(host.transmit(SimTime(1_000_000), &frame(1514)), Some(SimTime(1_000_000 + 1_526 * 80)));
    }

    #[test]
    fn a_full_transmit_queue_refuses_until_a_frame_has_left() {
        let mut host = HostInterface::new(None, 2, 8);
        assert_eq!(host.transmit(SimTime(0), &frame(60)), Some(SimTime(5_760)));
        assert!(host.transmit(SimTime(0), &frame(60)).is_some());
        assert_eq!(host.transmit(SimTime(0), &frame(60)), None);
        assert!(host.transmit(SimTime(5_760), &frame(60)).is_some());
    }
}
