//! Frames of a domain are made ready for their next flight: what is overdue is given up.

use core::ops::Range;

use super::Exchange;
use super::missed::{give_up, note_missing};
use crate::domain::DomainId;
use crate::event::CyclicEvent;
use crate::time::Instant;

impl Exchange {
    /// Makes frames of a domain ready to be loaded. False while some are still expected.
    pub(super) fn make_ready(&mut self, id: DomainId, set: Range<usize>, now: Instant) -> bool {
        let frames = &mut self.frames[set.clone()];
        if frames.iter().any(|frame| frame.is_waiting() && !frame.overdue(now)) {
            self.tally.disturbed().skipped += 1;
            self.domains[id.0].count_skip();
            self.events.push(CyclicEvent::Skipped { domain: id.0 as u16 }.pack());
            return false;
        }
        for frame in frames.iter_mut().filter(|frame| frame.is_open()) {
            if frame.is_waiting() {
                give_up(frame, &mut self.missed, self.tally.disturbed());
                self.board.post_lost(self.tally.counters.lost);
            }
            if frame.is_delivered() {
                self.tally.disturbed().copies_lost += 1;
            }
            note_missing(frame, &self.board);
            self.evidence.close(frame, &self.board, &mut self.events);
        }
        let changes = self.board.taking_part_changes();
        if !frames.iter().all(|frame| frame.is_ready(changes)) {
            self.follow_board(set, changes);
        }
        true
    }
}
