//! Decides when a round of reads of all SubDevices begins: as soon as posted words differ from those of the last round,
//! on request, and once a second.

use core::time::Duration;

use ringcat_wire::register::EcatEvent;

use super::disturbance::Disturbance;
use super::effect::{Effects, Task};
use super::ring::Words;
use super::wake::Wake;
use crate::board::{RingWord, Supervision};
use crate::ring::RingState;
use crate::time::Instant;

/// Shortest pause between two rounds.
const PAUSE: Duration = Duration::from_micros(500);
/// Interval of rounds without a change: an OR can hide one state behind others.
const ROUTINE: Duration = Duration::from_secs(1);
/// A supervision result with a number this much higher than that at the end of a round was certainly sent after the
/// round's reads.
const SURELY_LATER: u32 = 8;
/// Consecutive rounds because of an ECAT event request that stays set.
const MOST_MISSED: u8 = 3;

/// Result of the last round.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Round {
    /// It is known of all members whether they are present.
    pub is_certain: bool,
    /// More SubDevices are counted than have answered, and all were read: unknown SubDevices have to be found first.
    pub finds_others: bool,
    /// No others are missing: those without a declaration can be identified.
    pub is_complete: bool,
    /// Reads do not return though process data does, or the reverse, often enough for a test of the frame limit.
    pub is_blind: bool,
    /// The round is valid: no SubDevice was out of reach on purpose, and a count was available.
    pub counts: bool,
}

/// Whether a round is under way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Reads {
    /// None is; the next one begins at this time at the earliest.
    Resting(Instant),
    /// One is.
    UnderWay,
}

/// Requests for a round by other triggers than posted words, the most urgent one last.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Request {
    /// None: the next round is routine.
    Nothing,
    /// One at a time: it is not routine.
    AtATime,
    /// One now.
    Now,
}

/// Triggers of a round.
#[derive(Debug)]
pub(super) struct Attention {
    /// The words posted when the last round began.
    seen: Supervision,
    ring: RingWord,
    /// The state of the ring reported by then.
    reported: RingState,
    /// Number of the result at the end of the last round, and the number of rounds since then that were started only
    /// because of missed requests.
    checked: u32,
    missed: u8,
    /// Other triggers.
    request: Request,
    next_routine: Instant,
    reads: Reads,
    /// Result of the last round.
    pub round: Round,
    /// Consecutive rounds in which reads were lost though frames returned, or the reverse.
    pub blind: u8,
    /// The next evaluation if no words are posted before.
    pub wake: Wake,
}

impl Default for Attention {
    fn default() -> Attention {
        Attention {
            seen: Supervision::default(),
            ring: RingWord::default(),
            reported: RingState::Unknown,
            checked: 0,
            missed: 0,
            request: Request::Nothing,
            next_routine: Instant::default(),
            reads: Reads::Resting(Instant::default()),
            round: Round::default(),
            blind: 0,
            wake: Wake::at(Instant::default()),
        }
    }
}

impl Attention {
    /// A word differs from its value at the start of the last round.
    pub fn has_changed(&self, words: &Words, reported: RingState) -> bool {
        words.supervision.is_some_and(|(_, supervision)| supervision != self.seen)
            || words.ring != self.ring
            || reported != self.reported
            || self.request == Request::Now
    }

    /// Ports have changed again directly after a round that cleared their ECAT event: the event is set again, as before
    /// the round. `None` if that is impossible.
    fn has_missed(&mut self, words: &Words) -> Option<bool> {
        let (number, supervision) = words.supervision?;
        if !EcatEvent::from_bits(supervision.irq).dl_status {
            self.missed = 0;
            return None;
        }
        // Events of SubDevices that are not read stay set for ever.
        if self.missed >= MOST_MISSED {
            return None;
        }
        let is_missed = number.wrapping_sub(self.checked) >= SURELY_LATER;
        self.missed += u8::from(is_missed);
        Some(is_missed)
    }

    /// Starts a round if it is requested. Returns the next evaluation if no words are posted before.
    pub fn observe(
        &mut self,
        words: &Words,
        reported: RingState,
        disturbance: Option<Disturbance>,
        now: Instant,
        effects: &mut Effects,
    ) -> Wake {
        // A missing answer has no meaning while SubDevices are out of reach on purpose; the end of this state is an
        // observation.
        let Reads::Resting(earliest) = self.reads else { return Wake::NEVER };
        if disturbance == Some(Disturbance::IsolateRings) {
            return Wake::NEVER;
        }
        if now < earliest {
            return Wake::at(earliest);
        }
        let missed = self.has_missed(words);
        let changed = self.has_changed(words, reported) || missed == Some(true);
        if !changed && now < self.next_routine {
            return Wake { at: self.next_routine, with_result: missed.is_some() };
        }
        effects.start(Task::Round { routine: !changed && self.request == Request::Nothing });
        (self.reads, self.request) = (Reads::UnderWay, Request::Nothing);
        self.seen = words.supervision.map_or(self.seen, |(_, supervision)| supervision);
        self.ring = words.ring;
        self.reported = reported;
        self.next_routine = now + ROUTINE;
        Wake::NEVER
    }

    /// The state of the ring that had been reported when the last round began.
    pub fn reported(&self) -> RingState {
        self.reported
    }

    /// Requests a round.
    pub fn want(&mut self) {
        self.request = Request::Now;
    }

    /// Requests a round after a pause at the latest.
    pub fn again_in(&mut self, pause: Duration, now: Instant) {
        self.request = self.request.max(Request::AtATime);
        self.next_routine = self.next_routine.min(now + pause);
    }

    /// A round has ended; `number` is the latest result's.
    pub fn end(&mut self, number: Option<u32>, now: Instant) {
        self.reads = Reads::Resting(now + PAUSE);
        self.checked = number.unwrap_or(0);
    }
}
