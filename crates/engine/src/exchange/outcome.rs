//! What the tries of a frame have shown together.

use core::ops::Range;

use super::again::{Again, Tries};
use super::flight::CyclicFrame;
use crate::board::Board;
use crate::time::Instant;

/// Result of the tries of a frame.
#[derive(Default)]
pub(super) struct Outcome {
    pub waiting: bool,
    pub complete: bool,
    pub wkc: u32,
    /// It is complete because it was sent again.
    pub saved: bool,
    /// It was sent again.
    pub was_sent: bool,
}

/// Result of the tries of a frame.
pub(super) fn outcome(first: &CyclicFrame, again: Option<&Option<Again>>) -> Outcome {
    let (waiting, complete, wkc) = (first.is_waiting(), first.is_complete(), first.wkc());
    let left = first.left();
    let Some(Some(again)) = again.filter(|again| again.as_ref().is_some_and(|again| again.was_sent(left))) else {
        return Outcome { waiting, complete, wkc, ..Outcome::default() };
    };
    if complete {
        return Outcome { waiting, complete, wkc, was_sent: true, ..Outcome::default() };
    }
    let saved = again.tries(left) == Tries::Complete;
    Outcome { waiting: waiting && !saved, complete: saved, wkc: again.wkc(), saved, was_sent: true }
}

/// Counts the wrong working counters of an evaluated cycle.
#[cold]
pub(super) fn count_errors(set: Range<usize>, frames: &[CyclicFrame], again: &[Option<Again>], board: &Board) {
    for index in set {
        let first = &frames[index];
        match again.get(index) {
            Some(Some(again)) if again.was_sent(first.left()) => again.count_errors(first, board),
            _ => first.count_errors(board),
        }
    }
}

/// Whether a copy of any try came back.
#[cold]
pub(super) fn has_returned(mut set: Range<usize>, frames: &[CyclicFrame], again: &[Option<Again>]) -> bool {
    set.any(|index| {
        let again = again.get(index).and_then(Option::as_ref);
        let again = again.filter(|again| again.was_sent(frames[index].left())).map(|again| &again.frame);
        frames[index].arrivals().arrived != 0 || again.is_some_and(|frame| frame.arrivals().arrived != 0)
    })
}

/// When a frame left that is overdue after this time.
pub(super) fn sent_at(frame: &CyclicFrame, timeout_ns: u64) -> Instant {
    Instant(frame.deadline().0.saturating_sub(timeout_ns))
}
