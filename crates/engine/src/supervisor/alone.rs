//! A frame that is alone on the wire, so that no other frame changes the times that SubDevices latch for it (protocol
//! 7.1).
//!
//! Input: a datagram that must be alone ([`Bus::alone`]). It waits until all acyclic frames have returned or are lost
//! and no cyclic frame is on the wire; the next acyclic frame waits until all copies of this frame are received. The
//! cyclic half is not involved: it posts the number of frames sent ([`Board::at_rest`]). If it has sent meanwhile, the
//! answer is discarded ([`BusError::Disturbed`]). A procedure may also request a pause of the cyclic half
//! ([`Bus::ask_for_pause`]).

mod latch;
mod send;

use alloc::collections::VecDeque;
use alloc::vec::Vec;
use core::time::Duration;

use super::task::TaskId;
use super::transfer::TransferId;
use crate::board::Board;
use crate::link::LinkSet;
use crate::time::Instant;

pub(crate) use latch::Turn;

/// Pause between two checks whether cyclic frames are on the wire.
const CHECK_PAUSE: Duration = Duration::from_micros(20);
/// If the cyclic half has sent no frame for this time, none is on the wire.
const SILENCE: Duration = Duration::from_millis(25);

/// Stage of the first waiting datagram.
#[derive(Clone, Copy, Debug, Default)]
enum Stage {
    /// No datagram waits, or acyclic frames are on the wire.
    #[default]
    Idle,
    /// Cyclic frames are on the wire; `returned`: number of returned frames per link when the wait began.
    Waiting { until: Instant, returned: [u16; 2] },
    /// It is on the wire; number of cyclic frames sent before it.
    UnderWay { departures: u32 },
}

/// Datagrams to be sent alone.
#[derive(Debug, Default)]
pub(crate) struct Alone {
    /// Each with the links on which copies are known not to return, a bit each.
    waiting: VecDeque<(TransferId, u8)>,
    stage: Stage,
    /// Number of cyclic frames sent as of the last check, and since when it is unchanged.
    departures: (u32, Instant),
    /// A procedure has the exclusive right to latch.
    is_taken: bool,
    /// Procedures that wait for it.
    want_turn: Vec<TaskId>,
}

impl Alone {
    /// Whether such a datagram waits or is on the wire: no other acyclic frame may be sent.
    pub(super) fn is_held(&self) -> bool {
        !self.waiting.is_empty()
    }

    /// Time of the next check whether it may be sent.
    pub(super) fn next_deadline(&self, now: Instant) -> Option<Instant> {
        (self.is_held() && !matches!(self.stage, Stage::UnderWay { .. })).then_some(now + CHECK_PAUSE)
    }

    /// Number of cyclic frames sent, if none is on the wire.
    fn at_rest(&mut self, board: &Board, links: LinkSet, silent: u8, now: Instant) -> Option<u32> {
        let departures = board.traffic.departures();
        if departures != self.departures.0 {
            self.departures = (departures, now);
        }
        let has_stopped = now.since(self.departures.1) >= SILENCE;
        board.at_rest(links, silent).or(has_stopped.then_some(departures))
    }
}
