//! Triggers of cycles, and counts and delays of cycles.

use std::time::Duration;

/// Trigger of a cycle.
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
    /// The return of the last cycle's frames; if several cycles may be under way, the return of the oldest one. If they
    /// do not return, the next cycle begins after as many periods as cycles may be under way.
    FramesReturned {
        /// Shortest time from the beginning of a cycle to that of the next; zero for cycles back to back.
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
    /// Number of changes of fields other than `cycles` and `last_delay`.
    pub disturbances: u64,
}

impl PaceNs {
    pub const fn shown(&self) -> Pace {
        let PaceNs { cycles, late, skipped, paused, last_delay, longest_delay, disturbances: _ } = *self;
        let [last_delay, longest_delay] = [Duration::from_nanos(last_delay), Duration::from_nanos(longest_delay)];
        Pace { cycles, late, skipped, paused, last_delay, longest_delay }
    }
}

/// Counts and delays of the cycles. Their cause is the host, not the wire.
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
    /// Delay of the last cycle.
    pub last_delay: Duration,
    /// Longest delay of a cycle.
    pub longest_delay: Duration,
}
