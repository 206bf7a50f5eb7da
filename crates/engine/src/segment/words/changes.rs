//! Since the words before: changes of the segment, counted for the procedures that wait for one.

use super::posted::{Words, counts_of};
use crate::board::Board;
use crate::ring_status::LinkCounts;
use crate::segment::clocks::Clocks;

/// Numbers of changes so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Changes {
    /// Other SubDevices answer on a link, or the ring has changed; before clocks are set up, ports too.
    pub segment: u32,
    /// The ring has changed.
    pub ring: u32,
    /// The first SubDevices answer, as always when cycles begin: this is no change of the segment.
    pub beginnings: u32,
}

/// What is compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Shown {
    /// [`crate::board::RingWord::changes`].
    ring: u32,
    /// SubDevices that answer on each link.
    answering: LinkCounts,
    /// Stops of the time distribution after changes of ports.
    holds: u32,
}

/// The words before, and the changes so far.
#[derive(Debug, Default)]
pub struct SinceBefore {
    shown: Shown,
    has_answered: bool,
    /// Changes so far.
    pub changes: Changes,
}

impl SinceBefore {
    /// The segment is now as the clocks were measured, or could not be: words are compared with those posted now.
    pub fn begin(&mut self, board: &Board) {
        let answering = board.supervision().map(|(_, result)| counts_of(&result)).unwrap_or_default();
        self.shown = Shown { ring: board.ring().changes, answering, holds: board.clocks.holds() };
        self.has_answered = answering != LinkCounts::default();
    }

    /// Compares posted words with the last ones.
    pub fn observe(&mut self, words: &Words, holds: u32, clocks: &Clocks) {
        let answering = words.answering();
        let now = Shown { ring: words.ring.changes, answering, holds };
        let before = core::mem::replace(&mut self.shown, now);
        let had_answered = self.has_answered;
        self.has_answered |= answering != LinkCounts::default();
        self.changes.ring = self.changes.ring.wrapping_add(u32::from(before.ring != now.ring));
        // Clocks that were set up read on their own why the distribution has stopped.
        let is_set_up = clocks.are_set_up();
        let compared = |shown: Shown| Shown { holds: if is_set_up { 0 } else { shown.holds }, ..shown };
        if compared(before) == compared(now) {
            return;
        }
        let count = usize::from(answering.main) + usize::from(answering.redundant);
        let is_beginning = match is_set_up {
            true => !had_answered && clocks.measured_count() == Some(count),
            false => before.answering == LinkCounts::default(),
        };
        let counter = if is_beginning { &mut self.changes.beginnings } else { &mut self.changes.segment };
        *counter = counter.wrapping_add(1);
    }
}
