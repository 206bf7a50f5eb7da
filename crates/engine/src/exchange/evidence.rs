//! Evaluates finished flights for the ring, the SubDevices and the clocks, and posts the results.
//!
//! With several cycles on the wire, or domains of several periods, flights may end in another order than that of
//! departure. The result of an older flight counts only until a newer one returned.

use super::clocks::Clocks;
use super::flight::CyclicFrame;
use crate::board::{Board, RingWord, Supervision};
use crate::link::Link;
use crate::queue::Producer;
use crate::ring::{RingMonitor, RingState};

#[derive(Debug, Default)]
pub(super) struct Evidence {
    pub monitor: RingMonitor,
    pub clocks: Clocks,
    /// Departure of the newest flight that returned, as a cycle plus one.
    newest: u64,
}

impl Evidence {
    /// One copy is received, and the other copy may never come: an open ring is reported at once.
    pub fn receive_first(&mut self, frame: &CyclicFrame, board: &Board) {
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

    /// Whether the end of a flight that came back on the only link would change nothing: no newer one ended before, no
    /// clocks, and the state of the ring is known.
    #[inline(always)]
    pub fn ends_as_usual(&mut self, frame: &CyclicFrame) -> bool {
        let is_known = frame.left() >= self.newest && frame.clocks().is_none() && self.monitor.is_open();
        if is_known {
            self.newest = frame.left();
        }
        is_known
    }

    /// Evaluates a finished flight: posts its evidence about the ring and the result of its supervision datagram.
    // Inlined on purpose: a cycle has few instructions to spare (bin `cycle`).
    #[inline(always)]
    pub fn close(&mut self, frame: &mut CyclicFrame, board: &Board, events: &mut Producer) {
        if frame.left() >= self.newest {
            self.newest = frame.left();
            if let Some(seen) = frame.clocks_seen() {
                self.clocks.observe(seen, frame.arrivals(), board, events);
            }
            // Counts first: a reader that reads the change then finds the matching counts.
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
        let seen = frame.supervision().filter(|_| frame.arrivals().returned != 0).map(Supervision::unpack);
        let returned = seen.map(|seen| (link, if link == Link::Main { seen.main.0 } else { seen.redundant.0 }));
        let (state, dead_way) = (self.monitor.state(), self.monitor.dead_way());
        board.post_ring(RingWord { state, returned, dead_way, changes: 0 });
    }
}
