//! Fate of frames of which no copy came back in time: late, damaged, or never back.
//!
//! A frame is remembered by its sequence number until 256 newer frames have left. Frames that come back in time are not
//! affected.

use alloc::boxed::Box;
use core::ops::Range;

use super::counters::CyclicCounters;
use super::domain::Domain;
use super::flight::CyclicFrame;
use crate::board::Board;
use crate::ring::Sequence;
use crate::time::Instant;

/// Fate of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Fate {
    /// Unknown, or in time.
    #[default]
    None,
    /// A damaged copy of it came.
    Damaged,
    /// It was given up.
    GivenUp,
}

/// Frames by their ids, each with its last fate.
#[derive(Debug)]
pub(crate) struct Missed(Box<[(Sequence, Fate); 256]>);

impl Default for Missed {
    fn default() -> Missed {
        Missed(Box::new([(Sequence::default(), Fate::None); 256]))
    }
}

impl Missed {
    fn at(&mut self, sequence: Sequence) -> &mut (Sequence, Fate) {
        &mut self.0[usize::from(sequence.frame_id())]
    }

    /// A copy came with other datagrams than were sent.
    #[cold]
    pub(crate) fn damaged(&mut self, sequence: Sequence) {
        *self.at(sequence) = (sequence, Fate::Damaged);
    }

    /// No intact copy came in time.
    #[cold]
    pub(crate) fn give_up(&mut self, sequence: Sequence, counters: &mut CyclicCounters) {
        counters.lost += 1;
        let place = self.at(sequence);
        if *place == (sequence, Fate::Damaged) {
            counters.lost_damaged += 1;
        } else {
            *place = (sequence, Fate::GivenUp);
        }
    }

    /// A copy came too late, or twice.
    #[cold]
    pub(crate) fn late(&mut self, sequence: Sequence, counters: &mut CyclicCounters) {
        counters.late += 1;
        let place = self.at(sequence);
        if *place == (sequence, Fate::GivenUp) {
            *place = (sequence, Fate::None);
            counters.lost_late += 1;
        }
    }
}

/// Posts which copies of a flight that is closed did not come back.
#[cold]
pub(crate) fn note_missing(frame: &CyclicFrame, board: &Board) {
    frame.missing().for_each(|(link, bytes)| board.live.count_lost(link, bytes));
    if frame.has_lost_supervision() {
        board.post_silence();
    }
}

/// Gives up a frame that is overdue.
#[cold]
pub(crate) fn give_up(frame: &mut CyclicFrame, missed: &mut Missed, counters: &mut CyclicCounters) {
    if frame.give_up() {
        missed.give_up(frame.sequence(), counters);
    } else {
        counters.half += 1;
    }
}

/// Gives up the overdue frames of a domain's oldest cycle. True while others are still expected.
#[cold]
pub(super) fn give_up_overdue(
    domain: &Domain,
    frames: &mut [CyclicFrame],
    set: Range<usize>,
    now: Instant,
    missed: &mut Missed,
    counters: &mut CyclicCounters,
) -> bool {
    // Links keep the order of frames: a frame overtaken by a later one is lost, whatever the time.
    let now = if domain.is_overtaken(frames) { Instant::NEVER } else { now };
    let mut pending = false;
    for frame in frames[set].iter_mut().filter(|frame| frame.is_waiting()) {
        if frame.overdue(now) {
            give_up(frame, missed, counters);
        } else {
            pending = true;
        }
    }
    pending
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: lost-frames
    #[test]
    fn a_frame_that_was_given_up_is_late_damaged_or_missing_and_only_one_of_these() {
        let (mut missed, mut counters) = (Missed::default(), CyclicCounters::default());
        let mut sequence = Sequence::default();
        let mut next = || {
            sequence = sequence.next();
            sequence
        };
        let (missing, late, damaged, in_time) = (next(), next(), next(), next());
        missed.damaged(damaged);
        for given_up in [missing, late, damaged] {
            missed.give_up(given_up, &mut counters);
        }
        // Both copies of one frame, a copy of another one that was in time, and a copy of a damaged one.
        [late, late, in_time, damaged].into_iter().for_each(|sequence| missed.late(sequence, &mut counters));
        let expected = CyclicCounters { lost: 3, lost_late: 1, lost_damaged: 1, late: 4, ..CyclicCounters::default() };
        assert_eq!(counters, expected);
        assert_eq!(counters.missing(), 1);
    }

    #[test]
    fn a_copy_of_a_frame_with_the_same_id_and_another_sequence_is_another_frame() {
        let (mut missed, mut counters) = (Missed::default(), CyclicCounters::default());
        let old = Sequence::default().next();
        let new = (0..256).fold(old, |sequence, _| sequence.next());
        assert_eq!(old.frame_id(), new.frame_id());
        missed.give_up(new, &mut counters);
        missed.late(old, &mut counters);
        assert_eq!((counters.lost, counters.lost_late), (1, 0));
    }
}
