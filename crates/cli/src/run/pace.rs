//! Counters of the cycles at a moment, and whether the cycle time was kept between two of them.

use ringcat::cyclic_status::CyclicStatus;
use ringcat::{CyclicCounters, Pace};

/// The cycle time was not kept if more than one cycle in this many was left out.
const LEFT_OUT_PART: u64 = 10;

/// Counters at a moment.
#[derive(Clone, Copy, Debug, Default)]
pub struct Seen {
    pub counters: CyclicCounters,
    pub pace: Pace,
}

impl Seen {
    /// The present ones.
    pub fn of(cyclic_status: &CyclicStatus) -> Seen {
        Seen { counters: cyclic_status.counters(), pace: cyclic_status.pace() }
    }
}

impl Seen {
    /// The reason if too many cycles were left out since then.
    pub fn cycle_time_not_kept(&self, before: &Seen) -> Option<String> {
        let gained = |count: fn(&Seen) -> u64| count(self).saturating_sub(count(before));
        let left_out = gained(|seen| seen.pace.skipped) + gained(|seen| seen.counters.skipped);
        let cycles = gained(|seen| seen.pace.cycles) + left_out;
        (left_out * LEFT_OUT_PART > cycles)
            .then(|| format!("the cycle time was not kept: {left_out} of {cycles} cycles left out"))
    }
}
