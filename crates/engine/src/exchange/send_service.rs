//! Departure of supervision and clocks in cycles in which the home domain does not leave.

use super::leaving::Leaving;
use super::missed::{give_up, note_missing};
use super::service::Carrier;
use super::{Domain, Exchange};
use crate::link::Link;
use crate::time::Instant;

impl Exchange {
    /// Sends the datagrams of supervision and clocks although the home domain does not leave: with another domain, or
    /// in a separate frame.
    #[cold]
    pub(super) fn send_service(&mut self, now: Instant, transmit: &mut impl FnMut(Link, &[u8])) {
        let Carrier::Alone(index) = self.service.place(&self.domains, &mut self.frames, &self.board, now) else {
            return;
        };
        let timeout_ns = self.service_timeout_ns();
        let Some(frame) = self.frames.get_mut(index) else { return };
        if frame.is_waiting() {
            give_up(frame, &mut self.missed, self.tally.disturbed());
            self.board.post_lost(self.tally.counters.lost);
        }
        if frame.is_open() {
            if frame.is_delivered() {
                self.tally.disturbed().copies_lost += 1;
            }
            note_missing(frame, &self.board);
            self.evidence.close(frame, &self.board, &mut self.events);
        }
        frame.load(&[], self.cycle);
        self.sequence = self.sequence.next();
        self.by_id[usize::from(self.sequence.frame_id())] = index as u16;
        let deadline = Instant(now.0.saturating_add(timeout_ns));
        let leaving = Leaving { identity: &self.identity, links: self.links, board: &self.board, now };
        let bytes = leaving.send(frame, self.sequence, deadline, &mut self.evidence, transmit);
        self.tally.counters.sent += 1;
        self.tally.counters.bytes += bytes as u64;
    }

    /// Deadline of a frame of supervision and clocks alone: that of the home domain.
    pub(super) fn service_timeout_ns(&self) -> u64 {
        self.domains.get(self.service.home()).map_or(0, Domain::timeout_ns)
    }
}
