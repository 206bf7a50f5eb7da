//! Changes of the segment that posted words show, counted for the procedures that wait for one. Rules of the model
//! compare the words with references of their own: a round with those at its begin (`attention`), the ring with what
//! was reported (`ring`), idle operation with the last scan (`rules/idle`), silence with the last answer
//! (`rules/silence`).

use super::clocks::Clocks;
use super::ring::Words;
use crate::board::Board;

/// Numbers of changes so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Changes {
    /// Other SubDevices answer on a link, or the ring has changed; before clocks are set up, ports too.
    pub segment: u32,
    /// The ring has changed.
    pub ring: u32,
    /// The first SubDevices answer: so it is when cycles begin, which is not a change of the segment.
    pub beginnings: u32,
}

/// What is compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Shown {
    /// [`crate::board::RingWord::changes`].
    ring: u32,
    /// SubDevices that answer on each link.
    answering: (u16, u16),
    /// Stops of the time distribution after changes of ports.
    holds: u32,
}

/// The changes, and what the next words are compared with.
#[derive(Debug, Default)]
pub(super) struct Compared {
    shown: Shown,
    has_answered: bool,
    /// Changes so far.
    pub changes: Changes,
}

impl Compared {
    /// The segment is now as the clocks were measured, or could not be: words are compared with those posted now.
    pub fn begin(&mut self, board: &Board) {
        let answering = board.supervision().map_or((0, 0), |(_, seen)| (seen.main.0, seen.redundant.0));
        self.shown = Shown { ring: board.ring().changes, answering, holds: board.clocks.holds() };
        self.has_answered = answering != (0, 0);
    }

    /// Compares posted words with the last ones.
    pub fn observe(&mut self, words: &Words, holds: u32, clocks: &Clocks) {
        let answering = words.supervision.map_or((0, 0), |(_, seen)| (seen.main.0, seen.redundant.0));
        let now = Shown { ring: words.ring.changes, answering, holds };
        let before = core::mem::replace(&mut self.shown, now);
        let had_answered = self.has_answered;
        self.has_answered |= answering != (0, 0);
        self.changes.ring = self.changes.ring.wrapping_add(u32::from(before.ring != now.ring));
        // Clocks that were set up read on their own why the distribution has stopped.
        let is_set_up = clocks.are_set_up();
        let compared = |shown: Shown| Shown { holds: if is_set_up { 0 } else { shown.holds }, ..shown };
        if compared(before) == compared(now) {
            return;
        }
        let count = usize::from(answering.0) + usize::from(answering.1);
        let is_beginning = match is_set_up {
            true => !had_answered && clocks.measured_count() == Some(count),
            false => before.answering == (0, 0),
        };
        let counter = if is_beginning { &mut self.changes.beginnings } else { &mut self.changes.segment };
        *counter = counter.wrapping_add(1);
    }
}
