//! How long to wait for the copies of a frame, learnt from those that came back.
//!
//! A frame that is lost at the edge of a cut should cost a few round trips and no more; one that a thousand SubDevices
//! or a busy host delay must not be taken for lost.

use core::time::Duration;

/// Longest wait, also before anything was learnt: far beyond any round trip with a full window queued before it.
const LONGEST: Duration = Duration::from_millis(20);
/// What is added to a multiple of the round trip: hosts are late at times.
const MARGIN: Duration = Duration::from_millis(2);
/// Waits are so many of the longest recent round trips.
const FACTOR: u32 = 4;

/// Learns round trips.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct RoundTrip {
    /// The longest one of late; it fades.
    longest: Option<Duration>,
}

impl RoundTrip {
    /// A copy came back in time.
    pub(crate) fn took(&mut self, time: Duration) {
        let faded = self.longest.unwrap_or_default() * 15 / 16;
        self.longest = Some(faded.max(time));
    }

    /// A copy came back when it had been given up.
    pub(crate) fn was_late(&mut self) {
        if let Some(longest) = &mut self.longest {
            *longest = (*longest * 2 + MARGIN / 2).min(LONGEST);
        }
    }

    /// How long to wait for a frame whose datagrams were lost so often before. Each loss doubles it.
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
    fn waits_follow_the_round_trips_and_grow_with_each_loss() {
        let mut trips = RoundTrip::default();
        assert_eq!(trips.wait(0), LONGEST, "nothing was learnt");
        trips.took(Duration::from_micros(100));
        assert_eq!(trips.wait(0), Duration::from_micros(2_400));
        assert_eq!(trips.wait(1), Duration::from_micros(4_800));
        assert_eq!(trips.wait(7), LONGEST);
        trips.was_late();
        assert_eq!(trips.wait(0), Duration::from_micros(6_800));
    }

    #[test]
    fn a_long_round_trip_fades() {
        let mut trips = RoundTrip::default();
        trips.took(Duration::from_millis(4));
        assert_eq!(trips.wait(0), Duration::from_millis(18));
        (0..100).for_each(|_| trips.took(Duration::from_micros(100)));
        assert_eq!(trips.wait(0), Duration::from_micros(2_400));
    }
}
