//! When all SubDevices are looked at: as soon as something that is posted differs from what it was at the last look,
//! when something else calls for it, and once a second.

use core::time::Duration;

use ringcat_wire::register::EcatEvent;

use super::disturbance::Disturbance;
use super::effect::{Effects, Task};
use super::ring::Words;
use crate::board::{RingWord, Supervision};
use crate::ring::RingState;
use crate::time::Instant;

/// Shortest pause between two rounds.
const PAUSE: Duration = Duration::from_micros(500);
/// All SubDevices are looked at so often even if nothing changed: an OR can hide one state behind others.
const ROUTINE: Duration = Duration::from_secs(1);
/// A supervision result that so many came before since a round ended was not out when a SubDevice was looked at.
const SURELY_LATER: u32 = 8;
/// Rounds in a row because of a request that stands.
const MOST_MISSED: u8 = 3;

/// What the last round has brought.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Round {
    /// It is known of all members whether they are there.
    pub is_certain: bool,
    /// More SubDevices are counted than have answered, and all were asked: unknown ones are to be found first.
    pub finds_others: bool,
    /// No others are missing: those without a declaration may be told apart.
    pub is_complete: bool,
    /// Looks do not come back though process data does, or the other way round, and that is worth a trial.
    pub is_blind: bool,
    /// It counts: no SubDevice was out of reach on purpose, and something was counted.
    pub counts: bool,
}

/// What calls for a round.
#[derive(Debug)]
pub(super) struct Attention {
    /// What was posted when the last round began.
    seen: Supervision,
    ring: RingWord,
    /// The state of the ring that had been told by then.
    reported: RingState,
    /// Number of the result at the end of the last round, and rounds since only because of what had been missed.
    checked: u32,
    missed: u8,
    /// Something else calls for a round.
    is_wanted: bool,
    is_awaited: bool,
    next_routine: Instant,
    /// Not before then.
    earliest: Instant,
    is_looking: bool,
    /// What the last round has brought.
    pub round: Round,
    /// Rounds in a row in which looks were lost though frames came back, or the other way round.
    pub blind: u8,
    /// When to look at what is posted though nothing else is posted.
    pub wake: Instant,
}

impl Default for Attention {
    fn default() -> Attention {
        Attention {
            seen: Supervision::default(),
            ring: RingWord::default(),
            reported: RingState::Unknown,
            checked: 0,
            missed: 0,
            is_wanted: false,
            is_awaited: false,
            next_routine: Instant::default(),
            earliest: Instant::default(),
            is_looking: false,
            round: Round::default(),
            blind: 0,
            wake: Instant::default(),
        }
    }
}

impl Attention {
    /// Something is not as it was when the last round began.
    pub fn has_changed(&self, words: &Words, reported: RingState) -> bool {
        words.supervision.is_some_and(|(_, supervision)| supervision != self.seen)
            || words.ring != self.ring
            || reported != self.reported
            || self.is_wanted
    }

    /// Ports have changed again right behind a look that took their request for attention away: it stands, as before
    /// the look. `None` where that cannot be.
    fn has_missed(&mut self, words: &Words) -> Option<bool> {
        let (number, supervision) = words.supervision?;
        if !EcatEvent::from_bits(supervision.irq).dl_status {
            self.missed = 0;
            return None;
        }
        // Requests of those that are not looked at stand for ever.
        if self.missed >= MOST_MISSED {
            return None;
        }
        let is_missed = number.wrapping_sub(self.checked) >= SURELY_LATER;
        self.missed += u8::from(is_missed);
        Some(is_missed)
    }

    /// Starts a round where one is called for. Returns when to look again though nothing else is posted.
    pub fn observe(
        &mut self,
        words: &Words,
        reported: RingState,
        disturbance: Option<Disturbance>,
        now: Instant,
        effects: &mut Effects,
    ) -> Instant {
        // Silence tells nothing while SubDevices are out of reach on purpose; the end of that is an observation.
        if self.is_looking || disturbance == Some(Disturbance::IsolateRings) {
            return Instant::NEVER;
        }
        if now < self.earliest {
            return self.earliest;
        }
        let missed = self.has_missed(words);
        let changed = self.has_changed(words, reported) || missed == Some(true);
        if !changed && now < self.next_routine {
            return if missed.is_some() { self.next_routine.min(now + PAUSE) } else { self.next_routine };
        }
        effects.start(Task::Look { routine: !changed && !self.is_awaited });
        (self.is_looking, self.is_awaited, self.is_wanted) = (true, false, false);
        self.seen = words.supervision.map_or(self.seen, |(_, supervision)| supervision);
        self.ring = words.ring;
        self.reported = reported;
        self.next_routine = now + ROUTINE;
        Instant::NEVER
    }

    /// The state of the ring that had been reported when the last round began.
    pub fn reported(&self) -> RingState {
        self.reported
    }

    /// A round is called for.
    pub fn want(&mut self) {
        self.is_wanted = true;
    }

    /// The next round comes after a pause at the latest.
    pub fn again_in(&mut self, pause: Duration, now: Instant) {
        self.is_awaited = true;
        self.next_routine = self.next_routine.min(now + pause);
    }

    /// A round has ended, when results had this number.
    pub fn end(&mut self, number: Option<u32>, now: Instant) {
        self.is_looking = false;
        self.checked = number.unwrap_or(0);
        self.earliest = now + PAUSE;
    }
}
