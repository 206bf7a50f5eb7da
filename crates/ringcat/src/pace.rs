//! How well cycles keep to their times, and what makes them begin.

use std::time::Duration;

/// What makes a cycle begin.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Trigger {
    /// The time: cycles have a fixed grid of one period.
    #[default]
    Time,
    /// The time, on a grid that follows the reference clock (master shift): a cycle begins when the system time of the
    /// segment is `phase_ns` modulo the period. Needs distributed clocks; until the reference was read, as
    /// [`Trigger::Time`].
    ReferenceClock {
        /// From the multiples of the period in system time to the beginning of cycles, in nanoseconds; may be negative.
        phase_ns: i64,
    },
    /// The return of the last cycle's frames; where several cycles may be under way, of the oldest one's. Where they do
    /// not return, a cycle begins as many periods after the last one as cycles may be under way.
    FramesReturned {
        /// From the beginning of the last cycle to that of the next at the least; zero for cycles back to back.
        at_least: Duration,
    },
}

/// [`Pace`] in whole nanoseconds, as the cycles count it.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PaceNs {
    pub cycles: u64,
    pub late: u64,
    pub skipped: u64,
    pub paused: u64,
    pub last_delay: u64,
    pub longest_delay: u64,
    /// How often anything was changed but `cycles` and `last_delay`.
    pub disturbances: u64,
}

impl PaceNs {
    pub const fn shown(&self) -> Pace {
        let PaceNs { cycles, late, skipped, paused, last_delay, longest_delay, disturbances: _ } = *self;
        let [last_delay, longest_delay] = [Duration::from_nanos(last_delay), Duration::from_nanos(longest_delay)];
        Pace { cycles, late, skipped, paused, last_delay, longest_delay }
    }
}

/// How well the cycles keep to their times. None of it is the wire's fault.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Pace {
    /// Cycles that ran.
    pub cycles: u64,
    /// Cycles that began later than a tenth of the period after their time.
    pub late: u64,
    /// Cycles that were left out because their time and that of the next had passed.
    pub skipped: u64,
    /// Cycles that began later because the wire had to be empty while propagation delays were measured.
    pub paused: u64,
    /// How late the last cycle began.
    pub last_delay: Duration,
    /// How late the latest cycle began.
    pub longest_delay: Duration,
}
