//! Deadline of a frame's copies, from measured round trips.
//!
//! After a cut, a lost frame costs only a few round trips, and a frame that a thousand SubDevices or a busy host delay
//! does not count as lost.

use core::time::Duration;

/// Longest deadline, also initially: far beyond any round trip with a full window queued before it.
const LONGEST: Duration = Duration::from_millis(20);
/// Margin added to a multiple of the round trip, for late hosts.
const MARGIN: Duration = Duration::from_millis(2);
/// Factor on the longest recent round trip.
const FACTOR: u32 = 4;

/// Learns round-trip times.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct RoundTrip {
    /// The longest recent round trip; it decays.
    longest: Option<Duration>,
}

impl RoundTrip {
    /// A copy came back in time.
    pub(crate) fn took(&mut self, time: Duration) {
        let faded = self.longest.unwrap_or_default() * 15 / 16;
        self.longest = Some(faded.max(time));
    }

    /// A copy came back after it was given up.
    pub(crate) fn was_late(&mut self) {
        if let Some(longest) = &mut self.longest {
            *longest = (*longest * 2 + MARGIN / 2).min(LONGEST);
        }
    }

    /// Time limit of a frame whose datagrams were lost this number of times before. Each loss doubles it.
    pub(crate) fn wait(&self, losses: u8) -> Duration {
        let Some(longest) = self.longest else { return LONGEST };
        let wait = longest * FACTOR + MARGIN;
        wait.saturating_mul(1 << losses.min(7)).min(LONGEST)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_follow_the_round_trips_and_double_with_each_loss() {
        let mut trips = RoundTrip::default();
        assert_eq!(trips.wait(0), LONGEST, "no round trip was measured");
        trips.took(Duration::from_micros(100));
        assert_eq!(trips.wait(0), Duration::from_micros(2_400));
        assert_eq!(trips.wait(1), Duration::from_micros(4_800));
        assert_eq!(trips.wait(7), LONGEST);
        trips.was_late();
        assert_eq!(trips.wait(0), Duration::from_micros(6_800));
    }

    #[test]
    fn the_longest_round_trip_decays() {
        let mut trips = RoundTrip::default();
        trips.took(Duration::from_millis(4));
        assert_eq!(trips.wait(0), Duration::from_millis(18));
        (0..100).for_each(|_| trips.took(Duration::from_micros(100)));
        assert_eq!(trips.wait(0), Duration::from_micros(2_400));
    }
}
