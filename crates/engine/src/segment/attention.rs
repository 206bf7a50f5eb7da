//! Decides when a round of reads of all SubDevices begins: as soon as posted words differ from those of the last round,
//! on request, and once a second.

use core::time::Duration;

use super::disturbance::Disturbance;
use super::effect::{Effects, Task};
use super::wake::Wake;
use super::words::{Reader, Words};
use crate::ring::RingState;
use crate::time::Instant;

/// Shortest pause between two rounds.
const PAUSE: Duration = Duration::from_micros(500);
/// Interval of rounds without a change: an OR can hide one state behind others.
const ROUTINE: Duration = Duration::from_secs(1);

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
    /// No round is under way; the next one begins at this time at the earliest.
    Resting(Instant),
    /// A round is under way.
    UnderWay,
}

/// Requests for a round by other triggers than posted words, the most urgent one last.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Request {
    /// No request: the next round is routine.
    Nothing,
    /// A round at a certain time: it is not routine.
    AtATime,
    /// A round now.
    Now,
}

/// Triggers of a round.
#[derive(Debug)]
pub(super) struct Attention {
    /// The state of the ring that had been reported when the last round began.
    reported: RingState,
    /// Requested round, by other triggers than posted words.
    request: Request,
    next_routine: Instant,
    reads: Reads,
    /// Result of the last round.
    pub round: Round,
    /// Rounds whose results were complete.
    pub rounds: u64,
    /// Consecutive rounds in which reads were lost though frames returned, or the reverse.
    pub blind: u8,
    /// The next evaluation if no words are posted before.
    pub wake: Wake,
}

impl Default for Attention {
    fn default() -> Attention {
        Attention {
            reported: RingState::Unknown,
            request: Request::Nothing,
            next_routine: Instant::default(),
            reads: Reads::Resting(Instant::default()),
            round: Round::default(),
            rounds: 0,
            blind: 0,
            wake: Wake::at(Instant::default()),
        }
    }
}

impl Attention {
    /// Nothing is requested and nothing under way, as at the beginning; numbers of rounds go on.
    #[cfg(feature = "standby")]
    pub fn begun_anew(&self) -> Attention {
        Attention { rounds: self.rounds, ..Attention::default() }
    }

    /// Something differs from when the last round began, or a round is requested.
    pub fn has_changed(&self, reader: &Reader, words: &Words, reported: RingState) -> bool {
        reader.round.has_changed(words) || reported != self.reported || self.request == Request::Now
    }

    /// Starts a round if it is requested. Returns the next evaluation if no words are posted before.
    pub fn observe(
        &mut self,
        (reader, words): (&mut Reader, &Words),
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
        let missed = reader.round.has_missed(words);
        let changed = self.has_changed(reader, words, reported) || missed == Some(true);
        if !changed && now < self.next_routine {
            return Wake { at: self.next_routine, with_result: missed.is_some() };
        }
        effects.start(Task::Round { routine: !changed && self.request == Request::Nothing });
        (self.reads, self.request) = (Reads::UnderWay, Request::Nothing);
        reader.round.begin(words);
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

    /// A round has ended.
    pub fn end(&mut self, now: Instant) {
        self.reads = Reads::Resting(now + PAUSE);
    }
}
