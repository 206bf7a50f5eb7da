//! A frame that is alone on the wire: what SubDevices latch of it no other frame has spoiled (protocol 7.1).
//!
//! In: a datagram that asks for that ([`Bus::alone`]). It waits until all acyclic frames are home or lost and no cyclic
//! one is under way; nothing acyclic follows until all its copies are in. The cyclic half knows nothing of it: it posts
//! when it sends ([`Board::at_rest`]), and where it has sent meanwhile, the answer counts for nothing
//! ([`BusError::Disturbed`]). Where it pauses on request, that can be asked for.

mod latch;
mod send;

use alloc::collections::VecDeque;
use core::time::Duration;

use super::transfer::TransferId;
use crate::board::Board;
use crate::link::LinkSet;
use crate::time::Instant;

pub(crate) use latch::Turn;

/// Between two looks whether the cyclic half is at rest.
const LOOK: Duration = Duration::from_micros(20);
/// A cyclic half that has not sent for so long has nothing under way.
const SILENCE: Duration = Duration::from_millis(25);

/// How far the first one that waits is.
#[derive(Clone, Copy, Debug, Default)]
enum Stage {
    /// Nothing is to be alone, or acyclic frames are on the wire.
    #[default]
    Idle,
    /// Cyclic frames are, of which these were home when the wait began.
    Waiting { until: Instant, home: [u16; 2] },
    /// It is on the wire; how often the cyclic half had sent.
    UnderWay { departures: u32 },
}

/// Datagrams that are to be alone.
#[derive(Debug, Default)]
pub(crate) struct Alone {
    /// Each with the links on which copies are known not to come home, a bit each.
    waiting: VecDeque<(TransferId, u8)>,
    stage: Stage,
    /// Departures of the cyclic half when it was looked at, and since when they were as many.
    departures: (u32, Instant),
    /// What SubDevices have latched is being read.
    is_taken: bool,
}

impl Alone {
    /// Whether one waits or is on the wire, so that nothing else may leave.
    pub(super) fn is_held(&self) -> bool {
        !self.waiting.is_empty()
    }

    /// When to look again whether it may go.
    pub(super) fn next_deadline(&self, now: Instant) -> Option<Instant> {
        (self.is_held() && !matches!(self.stage, Stage::UnderWay { .. })).then_some(now + LOOK)
    }

    /// How often the cyclic half has sent, where nothing of it is under way.
    fn at_rest(&mut self, board: &Board, links: LinkSet, silent: u8, now: Instant) -> Option<u32> {
        let departures = board.traffic.departures();
        if departures != self.departures.0 {
            self.departures = (departures, now);
        }
        let has_stopped = now.since(self.departures.1) >= SILENCE;
        board.at_rest(links, silent).or(has_stopped.then_some(departures))
    }
}
