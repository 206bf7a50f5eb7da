//! Decides when a datagram is sent alone, and evaluates the result.

use core::time::Duration;

use ringcat_wire::datagram::Target;

use super::Stage;
use crate::link::Link;
use crate::supervisor::reply::{BusError, Reply};
use crate::supervisor::shared::Shared;
use crate::supervisor::transfer::TransferId;

/// Longest wait for a free wire; meanwhile no acyclic frame is sent.
const LIMIT: Duration = Duration::from_millis(4);

impl Shared {
    /// The datagram that may be sent alone now, if any, and the links on which copies are known not to return.
    pub(in crate::supervisor) fn next_alone(&mut self) -> Option<(TransferId, u8)> {
        let (id, no_return) = loop {
            let (id, no_return) = *self.alone.waiting.front()?;
            if matches!(self.alone.stage, Stage::UnderWay { .. }) {
                return None;
            }
            if self.transfers.find(id).is_some_and(|transfer| !transfer.abandoned) {
                break (id, no_return);
            }
            self.transfers.remove(id);
            self.end_alone();
        };
        let silent = no_return | self.silence.mask(self.now);
        if self.sent_frames.are_under_way(self.links, silent) {
            return None;
        }
        let departures = match &self.board {
            Some(board) => {
                if !matches!(self.alone.stage, Stage::Waiting { .. }) {
                    self.alone.stage =
                        Stage::Waiting { until: self.now + LIMIT, returned: board.traffic.home(self.links, silent) };
                }
                self.alone.at_rest(board, self.links, silent, self.now)?
            }
            None => 0,
        };
        self.alone.stage = Stage::UnderWay { departures };
        Some((id, no_return))
    }

    /// Gives up a datagram that has waited too long for a free wire. If cyclic frames returned meanwhile on every link,
    /// the wire is busy ([`BusError::Busy`]); otherwise cyclic frames were lost ([`BusError::Lost`]).
    pub(in crate::supervisor) fn expire_alone(&mut self) {
        let Stage::Waiting { until, returned: before } = self.alone.stage else { return };
        let Some((id, no_return)) = self.alone.waiting.front().copied().filter(|_| self.now >= until) else { return };
        let target = self.transfers.find(id).map_or(Target::None, |transfer| transfer.request.target);
        let silent = no_return | self.silence.mask(self.now);
        let returned = self.board.as_ref().map_or(before, |board| board.traffic.home(self.links, silent));
        let waited_for = self.links.mask() & !silent;
        let links = Link::ALL.into_iter().filter(|link| waited_for & link.bit() != 0);
        let all_returned = links.map(|link| link.index()).all(|link| returned[link] != before[link]);
        self.finish(
            id,
            Err(if all_returned { BusError::Busy { target } } else { BusError::Lost { target, retries: 0 } }),
        );
    }

    /// Replaces the result of a datagram that had to be alone with an error if a cyclic frame was sent meanwhile.
    pub(in crate::supervisor) fn check_alone(
        &mut self,
        id: TransferId,
        result: Result<Reply, BusError>,
    ) -> Result<Reply, BusError> {
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

    /// Queues a datagram that must be alone.
    pub(in crate::supervisor) fn push_alone(&mut self, id: TransferId, no_return: u8) {
        self.alone.waiting.push_back((id, no_return));
    }
}
