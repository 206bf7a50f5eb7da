//! A frame that is alone on the wire, so that no other frame changes the times that SubDevices latch of it (protocol
//! 7.1).
//!
//! Input: a datagram that requires this ([`Bus::alone`]). It waits until all acyclic frames have returned or are lost
//! and no cyclic frame is on the wire; no acyclic frame follows until all its copies are received. The cyclic half is
//! not involved: it posts its departures ([`Board::at_rest`]), and where it has sent meanwhile, the answer is discarded
//! ([`BusError::Disturbed`]). A procedure may also ask it for a pause.

mod latch;
mod send;

use alloc::collections::VecDeque;
use core::time::Duration;

use super::transfer::TransferId;
use crate::board::Board;
use crate::link::LinkSet;
use crate::time::Instant;

pub(crate) use latch::Turn;

/// Pause between two checks whether the cyclic half is at rest.
const LOOK: Duration = Duration::from_micros(20);
/// A cyclic half that has not sent for this time has no frame on the wire.
const SILENCE: Duration = Duration::from_millis(25);

/// Stage of the first waiting datagram.
#[derive(Clone, Copy, Debug, Default)]
enum Stage {
    /// No datagram waits to be alone, or acyclic frames are on the wire.
    #[default]
    Idle,
    /// Cyclic frames are on the wire; the frames that had returned when the wait began.
    Waiting { until: Instant, home: [u16; 2] },
    /// It is on the wire; number of cyclic departures until then.
    UnderWay { departures: u32 },
}

/// Datagrams to be sent alone.
#[derive(Debug, Default)]
pub(crate) struct Alone {
    /// Each with the links on which copies are known not to return, a bit each.
    waiting: VecDeque<(TransferId, u8)>,
    stage: Stage,
    /// Departures of the cyclic half at the last check, and since when their number is unchanged.
    departures: (u32, Instant),
    /// The times latched by SubDevices are being read.
    is_taken: bool,
}

impl Alone {
    /// Whether one waits or is on the wire, so that no other frame may leave.
    pub(super) fn is_held(&self) -> bool {
        !self.waiting.is_empty()
    }

    /// Time of the next check whether it may leave.
    pub(super) fn next_deadline(&self, now: Instant) -> Option<Instant> {
        (self.is_held() && !matches!(self.stage, Stage::UnderWay { .. })).then_some(now + LOOK)
    }

    /// Number of cyclic departures, where no cyclic frame is on the wire.
    fn at_rest(&mut self, board: &Board, links: LinkSet, silent: u8, now: Instant) -> Option<u32> {
        let departures = board.traffic.departures();
        if departures != self.departures.0 {
            self.departures = (departures, now);
        }
        let has_stopped = now.since(self.departures.1) >= SILENCE;
        board.at_rest(links, silent).or(has_stopped.then_some(departures))
    }
}
