//! What flights that are over show of the ring, the SubDevices and the clocks, and who is told.
//!
//! With several cycles under way, or domains of several periods, flights may end in another order than they left in.
//! What an older one shows counts only until a newer one was heard of.

use super::clocks::Clocks;
use super::flight::CyclicFrame;
use crate::board::{Board, RingWord};
use crate::link::Link;
use crate::queue::Producer;
use crate::ring::{RingMonitor, RingState};

#[derive(Debug, Default)]
pub(super) struct Evidence {
    pub monitor: RingMonitor,
    pub clocks: Clocks,
    /// When, as a cycle plus one, the newest flight that was heard of had left.
    newest: u64,
}

impl Evidence {
    /// A copy is in, and the other one may never come: an open ring is told at once.
    pub fn hear_early(&mut self, frame: &CyclicFrame, board: &Board) {
        if frame.arrivals().returned != 0 && self.monitor.state() != RingState::Open && frame.left() >= self.newest {
            self.newest = frame.left();
            self.observe(frame, board);
        }
    }

    #[cold]
    fn observe(&mut self, frame: &CyclicFrame, board: &Board) {
        if self.monitor.observe(frame.arrivals()) {
            self.post_ring(frame, board);
        }
    }

    /// A flight is over: what it proves about the ring and what its supervision datagram saw go on the board.
    // Inlined on purpose: a cycle has few instructions to spare (bin `cycle`).
    #[inline(always)]
    pub fn close(&mut self, frame: &mut CyclicFrame, board: &Board, events: &mut Producer) {
        if frame.left() >= self.newest {
            self.newest = frame.left();
            if let Some(seen) = frame.clocks_seen() {
                self.clocks.observe(seen, frame.arrivals(), board, events);
            }
            // Counts first: whoever sees the change finds those that belong to it.
            if let Some(supervision) = frame.supervision() {
                board.post_supervision(supervision);
            }
            if self.monitor.observe(frame.arrivals()) {
                self.post_ring(frame, board);
            }
        }
        frame.close();
    }

    #[cold]
    fn post_ring(&self, frame: &CyclicFrame, board: &Board) {
        let link = if frame.arrivals().returned & Link::Main.bit() != 0 { Link::Main } else { Link::Redundant };
        let seen = frame.supervision().filter(|_| frame.arrivals().returned != 0);
        let returned = seen.map(|seen| (link, if link == Link::Main { seen.main.0 } else { seen.redundant.0 }));
        let (state, dead_way) = (self.monitor.state(), self.monitor.dead_way());
        board.post_ring(RingWord { state, returned, dead_way, changes: 0 });
    }
}
