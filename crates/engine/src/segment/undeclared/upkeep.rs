//! The requested state of a SubDevice without a declaration, and the attempts to reach it.
//!
//! An attempt has a number: when another one has begun, or the SubDevice has left, its findings are refused.

use alloc::string::String;
use core::time::Duration;

use ringcat_wire::al::{AlState, AlStatus};

use crate::segment::choices::Retries;
use crate::time::Instant;

/// Pause before the first attempt after a refusal; it doubles with every failure.
const FIRST_PAUSE: Duration = Duration::from_millis(100);
/// Pause before the first attempt after a loss of frames, shorter because held outputs stay until a watchdog of 100 ms
/// expires.
const FIRST_PAUSE_OF_BUS: Duration = Duration::from_millis(5);
/// Longest pause between attempts.
const LONGEST_PAUSE: Duration = Duration::from_secs(5);

/// Progress of a SubDevice towards its requested state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UpkeepProgress {
    /// The next attempt is due at this time; never, if it waits for a request.
    Due(Instant),
    /// An attempt is under way.
    UnderWay,
    /// The requested state was reached.
    Reached,
    /// The application has forced a state: it is left as it is until another state is requested.
    Left,
}

/// Whether the PDOs in the dictionary of a SubDevice in its state are to be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PdoReading {
    /// They are read if they are not known.
    Open,
    /// A procedure reads them.
    UnderWay,
    /// They cannot be read.
    Ended,
}

/// Why an attempt has failed.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct AttemptFailure {
    /// Frames were lost: the SubDevice has not refused anything.
    pub is_of_bus: bool,
    /// The reason in words.
    pub reason: String,
}

/// The requested state of a SubDevice without a declaration, and the attempts to reach it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Upkeep {
    /// The requested state.
    pub target: AlState,
    /// The requested state before the last request.
    before: AlState,
    /// Progress towards it.
    pub progress: UpkeepProgress,
    /// Number of the last attempt.
    pub attempt: u32,
    /// Whether the PDOs in its dictionary are to be read.
    pub reading: PdoReading,
    /// The last attempt after which its object dictionary was read.
    dictionary_of: Option<u32>,
    /// Consecutive failed attempts.
    failures: u32,
}

impl Upkeep {
    /// An attempt or a reading under way has ended without a result: the next one is due.
    #[cfg(feature = "standby")]
    pub(in crate::segment) fn end_attempt(&mut self) {
        self.attempt = self.attempt.wrapping_add(1);
        // In OP its outputs were written by an attempt.
        let is_in_op = self.progress == UpkeepProgress::Reached && self.target == AlState::Op;
        if self.progress == UpkeepProgress::UnderWay || is_in_op {
            self.progress = UpkeepProgress::Due(Instant::default());
        }
        if self.reading == PdoReading::UnderWay {
            self.reading = PdoReading::Open;
        }
    }

    /// PREOP is requested, and the first attempt is due at this time.
    pub(in crate::segment) fn due(at: Instant) -> Upkeep {
        let progress = UpkeepProgress::Due(at);
        Upkeep {
            target: AlState::PreOp,
            before: AlState::PreOp,
            progress,
            attempt: 0,
            reading: PdoReading::Open,
            dictionary_of: None,
            failures: 0,
        }
    }

    /// Another process has brought it this far. A first refusal may be due to a request of that process: it is
    /// followed by another attempt, and only the next one by PREOP.
    pub(in crate::segment) fn handed_over(target: AlState, progress: UpkeepProgress) -> Upkeep {
        let kept = Upkeep::due(Instant::default());
        Upkeep { target, before: target, progress, ..kept }
    }

    /// Whether it is in its requested state, or left as it is.
    pub fn is_settled(&self) -> bool {
        matches!(self.progress, UpkeepProgress::Reached | UpkeepProgress::Left)
    }

    /// Whether no attempt has failed since the request, and it is not left as it is.
    pub fn is_on_its_first_way(&self) -> bool {
        self.failures == 0 && matches!(self.progress, UpkeepProgress::Due(_) | UpkeepProgress::UnderWay)
    }

    /// Whether this attempt is under way.
    pub fn is_under_way(&self, attempt: u32) -> bool {
        self.attempt == attempt && self.progress == UpkeepProgress::UnderWay
    }

    /// Whether this attempt has reached its state, which is still requested.
    pub fn is_reached(&self, attempt: u32) -> bool {
        self.attempt == attempt && self.progress == UpkeepProgress::Reached
    }

    /// The attempt that has reached its state, which is still requested.
    pub(in crate::segment) fn reached(&self) -> Option<u32> {
        Some(self.attempt).filter(|attempt| self.is_reached(*attempt))
    }

    /// The attempt that has reached its state, if the object dictionary was not read since.
    pub(in crate::segment) fn dictionary_due(&self) -> Option<u32> {
        self.reached().filter(|attempt| self.dictionary_of != Some(*attempt))
    }

    /// The object dictionary was read, or cannot be, after this attempt.
    pub(in crate::segment) fn end_dictionary(&mut self, attempt: u32) {
        self.dictionary_of = Some(attempt);
    }

    /// Begins another attempt. Returns its number.
    fn begin(&mut self) -> u32 {
        (self.progress, self.reading) = (UpkeepProgress::UnderWay, PdoReading::Open);
        self.attempt = self.attempt.wrapping_add(1);
        self.attempt
    }

    /// Begins the next attempt if it is due. Returns its number.
    pub(in crate::segment) fn begin_if_due(&mut self, now: Instant) -> Option<u32> {
        matches!(self.progress, UpkeepProgress::Due(at) if at <= now).then(|| self.begin())
    }

    /// Another state is requested. Returns the number of the new attempt; `None` if the same request is under way.
    pub(in crate::segment) fn request(&mut self, state: AlState) -> Option<u32> {
        if self.progress == UpkeepProgress::UnderWay && self.target == state {
            return None;
        }
        self.before = core::mem::replace(&mut self.target, state);
        self.failures = 0;
        Some(self.begin())
    }

    /// The attempt under way has ended. True if its failure is to be reported.
    pub(in crate::segment) fn end(&mut self, failure: Option<&AttemptFailure>, retries: Retries, now: Instant) -> bool {
        let Some(AttemptFailure { is_of_bus, .. }) = failure else {
            (self.progress, self.failures) = (UpkeepProgress::Reached, 0);
            return false;
        };
        let tried = self.target;
        if !is_of_bus {
            // A SubDevice that refuses a requested state goes back to the state before.
            self.target = core::mem::replace(&mut self.before, AlState::PreOp);
        }
        self.failures = self.failures.saturating_add(1);
        let first = if *is_of_bus { FIRST_PAUSE_OF_BUS } else { FIRST_PAUSE };
        let pause = first.saturating_mul(1 << (self.failures - 1).min(10)).min(LONGEST_PAUSE);
        let waits = retries == Retries::OnRequest && !is_of_bus && tried == self.target;
        self.progress = UpkeepProgress::Due(if waits { Instant::NEVER } else { now + pause });
        self.failures == 1 || !is_of_bus
    }

    /// It is left as it is until another state is requested; an attempt under way ends.
    pub(in crate::segment) fn leave(&mut self) {
        self.attempt = self.attempt.wrapping_add(1);
        self.progress = UpkeepProgress::Left;
    }

    /// A failed attempt is repeated now.
    pub(in crate::segment) fn retry(&mut self, now: Instant) {
        if matches!(self.progress, UpkeepProgress::Due(_)) {
            (self.progress, self.failures) = (UpkeepProgress::Due(now), 0);
        }
    }

    /// Its state was read; the read was requested after this attempt had reached its state. True if it has left the
    /// requested state since: then it is brought back.
    pub(in crate::segment) fn has_left(&mut self, attempt: u32, status: AlStatus, now: Instant) -> bool {
        let is_there = !status.error && status.al_state() == Some(self.target);
        let has_left = self.is_reached(attempt) && !is_there;
        if has_left {
            (self.progress, self.before) = (UpkeepProgress::Due(now), AlState::PreOp);
        }
        has_left
    }
}
