//! How well the simulator keeps up with the clock: turns that came later than they were due.
//!
//! A stall of this machine, or a frame that takes long to simulate, delays frames without any fault of the MainDevice
//! or of the simulated segment. It is counted and reported, so that a delayed frame can be traced to it.

use std::time::Duration;

/// A wake-up is late from this delay on.
pub const LATE: Duration = Duration::from_micros(200);
/// At most one line about late wake-ups in this time.
const QUIET: Duration = Duration::from_secs(1);

/// Late wake-ups.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Lateness {
    /// Number of late wake-ups.
    pub count: u64,
    /// The longest delay.
    pub longest: Duration,
    /// Sum of all delays.
    pub total: Duration,
    reported: u64,
    longest_since: Duration,
    quiet_until_ns: u64,
}

impl Lateness {
    /// Notes a wake-up.
    pub fn note(&mut self, asked_ns: u64, woke_ns: u64) {
        let late = Duration::from_nanos(woke_ns.saturating_sub(asked_ns));
        if late > LATE {
            self.count += 1;
            self.longest = self.longest.max(late);
            self.total += late;
            self.longest_since = self.longest_since.max(late);
        }
    }

    /// A line about what happened since the last one, if it is time for one.
    pub fn line(&mut self, now_ns: u64) -> Option<String> {
        if self.reported == self.count || now_ns < self.quiet_until_ns {
            return None;
        }
        let text = format!(
            "the simulator was late {} times, by up to {:.3} ms (this machine stalled, or a frame was much work); \
             frames were delayed by that",
            self.count - self.reported,
            self.longest_since.as_secs_f64() * 1e3
        );
        self.reported = self.count;
        self.longest_since = Duration::ZERO;
        self.quiet_until_ns = now_ns + QUIET.as_nanos() as u64;
        Some(text)
    }

    /// For the status.
    pub fn summary(&self) -> String {
        let ms = |time: Duration| time.as_secs_f64() * 1e3;
        format!(
            "late wake-ups of this simulator (more than {} us): {}, the latest by {:.3} ms, together {:.3} ms",
            LATE.as_micros(),
            self.count,
            ms(self.longest),
            ms(self.total)
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: sim-interfaces
    #[test]
    fn late_wake_ups_are_counted_and_reported_once_a_second() {
        let mut lateness = Lateness::default();
        lateness.note(1_000_000, 1_150_000);
        assert_eq!(lateness.line(2_000_000), None);
        lateness.note(1_000_000, 3_000_000);
        let line = lateness.line(3_000_000).expect("there was one");
        assert!(line.contains("late 1 times, by up to 2.000 ms ("), "{line}");
        lateness.note(4_000_000, 5_000_000);
        assert_eq!(lateness.line(5_000_000), None);
        assert!(lateness.line(1_003_000_000).is_some_and(|line| line.contains("by up to 1.000 ms")));
        assert!(lateness.summary().contains(": 2, the latest by 2.000 ms, together 3.000 ms"));
    }
}
