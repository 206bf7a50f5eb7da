//! A frame that is alone on the wire: what SubDevices latch of it no other frame has spoiled (facts 7.1).
//!
//! In: a datagram that asks for that ([`Bus::alone`]). It waits until all acyclic frames are home or lost and no cyclic one is
//! under way; nothing acyclic follows until all its copies are in. The cyclic half knows nothing of it: it posts when it
//! sends ([`Board::at_rest`]), and where it has sent meanwhile, the answer counts for nothing ([`BusError::Disturbed`]).
//! Where it pauses on request, that can be asked for.

use alloc::collections::VecDeque;
use alloc::rc::Rc;
use alloc::vec::Vec;
use core::cell::RefCell;
use core::future::Future;
use core::time::Duration;

use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;

use super::bus::{Bus, BusError, Reply};
use super::shared::Shared;
use super::transfer::{Request, TransferId};
use crate::board::Board;
use crate::link::{Link, LinkSet};
use crate::time::Instant;

/// A wire that is never empty for so long is waited for no longer; meanwhile nothing acyclic is sent.
const LIMIT: Duration = Duration::from_millis(4);
/// Between two looks whether the cyclic half is at rest.
const LOOK: Duration = Duration::from_micros(20);
/// A cyclic half that has not sent for so long has nothing under way.
const SILENCE: Duration = Duration::from_millis(25);
/// Between two looks whether others have read what their frame has latched.
const TURN_LOOK: Duration = Duration::from_micros(100);

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

/// The right to have frames latched, until it is dropped: latches hold until the next frame of this kind.
pub(crate) struct Turn {
    shared: Rc<RefCell<Shared>>,
}

impl Drop for Turn {
    fn drop(&mut self) {
        self.shared.borrow_mut().alone.is_taken = false;
    }
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

impl Shared {
    /// The datagram that leaves now and alone, if one may, and the links on which copies are known not to come home.
    pub(super) fn next_alone(&mut self) -> Option<(TransferId, u8)> {
        let (id, deaf) = loop {
            let (id, deaf) = *self.alone.waiting.front()?;
            if matches!(self.alone.stage, Stage::UnderWay { .. }) {
                return None;
            }
            if self.transfers.find(id).is_some_and(|transfer| !transfer.abandoned) {
                break (id, deaf);
            }
            self.transfers.remove(id);
            self.end_alone();
        };
        let silent = deaf | self.silence.mask(self.now);
        if self.flights.are_under_way(self.links, silent) {
            return None;
        }
        let departures = match &self.board {
            Some(board) => {
                if !matches!(self.alone.stage, Stage::Waiting { .. }) {
                    self.alone.stage =
                        Stage::Waiting { until: self.now + LIMIT, home: board.traffic.home(self.links, silent) };
                }
                self.alone.at_rest(board, self.links, silent, self.now)?
            }
            None => 0,
        };
        self.alone.stage = Stage::UnderWay { departures };
        Some((id, deaf))
    }

    /// Gives up one that waits for the cyclic half for too long. Where frames of that come home all the time, it has to pause;
    /// where some do not, they were lost.
    pub(super) fn expire_alone(&mut self) {
        let Stage::Waiting { until, home: before } = self.alone.stage else { return };
        let Some((id, deaf)) = self.alone.waiting.front().copied().filter(|_| self.now >= until) else { return };
        let target = self.transfers.find(id).map_or(Target::None, |transfer| transfer.request.target);
        let silent = deaf | self.silence.mask(self.now);
        let home = self.board.as_ref().map_or(before, |board| board.traffic.home(self.links, silent));
        let waited_for = self.links.mask() & !silent;
        let links = Link::ALL.into_iter().filter(|link| waited_for & link.bit() != 0);
        let come_home = links.map(|link| link.index()).all(|link| home[link] != before[link]);
        self.finish(id, Err(if come_home { BusError::Busy { target } } else { BusError::Lost { target, retries: 0 } }));
    }

    /// What became of a datagram, if it was to be alone and was not.
    pub(super) fn judge_alone(&mut self, id: TransferId, result: Result<Reply, BusError>) -> Result<Reply, BusError> {
        if self.alone.waiting.front().is_none_or(|(first, _)| *first != id) {
            return result;
        }
        let sent_meanwhile = match (self.alone.stage, &self.board) {
            (Stage::UnderWay { departures }, Some(board)) => board.traffic.departures() != departures,
            _ => false,
        };
        self.end_alone();
        let target = self.transfers.find(id).map_or(Target::None, |transfer| transfer.request.target);
        result.and_then(|reply| if sent_meanwhile { Err(BusError::Disturbed { target }) } else { Ok(reply) })
    }

    fn end_alone(&mut self) {
        self.alone.waiting.pop_front();
        self.alone.stage = Stage::Idle;
    }

    /// Queues one.
    pub(super) fn push_alone(&mut self, id: TransferId, deaf: u8) {
        self.alone.waiting.push_back((id, deaf));
    }
}

impl Bus {
    /// Sends a datagram once, alone on the wire, and returns what came back, whatever its working counter. Copies on the link
    /// that is `deaf` are known not to come home.
    ///
    /// The future fails with [`BusError::Busy`] where the wire was never empty, with [`BusError::Disturbed`] where a cyclic
    /// frame left while it was under way, with [`BusError::Lost`] where a copy did not come back, or one of cyclic frames.
    pub(crate) fn alone(
        &self,
        command: Command,
        target: Target,
        data: Vec<u8>,
        deaf: Option<Link>,
    ) -> impl Future<Output = Result<Reply, BusError>> {
        self.submit(Request { alone: Some(deaf.map_or(0, Link::bit)), ..Request::once(command, target, data) })
    }

    /// Waits for the right to have frames latched.
    pub(crate) async fn latch_turn(&self) -> Turn {
        while core::mem::replace(&mut self.shared.borrow_mut().alone.is_taken, true) {
            self.sleep(TURN_LOOK).await;
        }
        Turn { shared: self.shared.clone() }
    }

    /// Asks the cyclic half not to begin a cycle for a time.
    pub(crate) fn ask_for_pause(&self, time: Duration) {
        let shared = self.shared.borrow();
        if let Some(board) = &shared.board {
            board.traffic.ask_for_pause(shared.now + time);
        }
    }
}
