//! Deadline of a frame's copies, from measured round trips ([0064]).
//!
//! A lost frame costs only a few round trips, also several times in a row, and a frame that a thousand SubDevices or a
//! busy host delay does not count as lost. Limits grow slowly with the losses of a datagram: a copy that comes back
//! late shows a longer round trip by itself ([`RoundTrip::was_late`]). Only the last tries wait long, for a segment or
//! a host that stops for a while.
//!
//! [0064]: ../../../../docs/decisions/0064-a-start-with-losses-and-what-is-read-before-op.md

use core::time::Duration;

/// Longest deadline: far beyond any round trip with a full window queued before it.
const LONGEST: Duration = Duration::from_millis(20);
/// Deadline without losses while no round trip is measured: more than twice that of a thousand SubDevices, which single
/// frames of the first count pass.
const UNKNOWN: Duration = Duration::from_millis(5);
/// Margin added to a multiple of the round trip, for late hosts.
const MARGIN: Duration = Duration::from_millis(2);
/// Factor on the longest recent round trip.
const FACTOR: u32 = 4;

/// Time limits by the number of losses before, as multiples of the limit without losses; [`LONGEST`] after these.
const GROWTH: [u32; 6] = [1, 1, 1, 2, 2, 4];
/// Number of retries of a lost datagram. All tries together wait for 100 ms, as long as a busy host may stop a process.
pub(crate) const MAX_RETRIES: u8 = 9;

/// Learns round-trip times.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct RoundTrip {
    /// The longest recent round trip in nanoseconds; it decays.
    longest: Option<u64>,
}

impl RoundTrip {
    /// A copy came back in time, after this number of nanoseconds.
    pub(crate) fn took(&mut self, ns: u64) {
        let longest = self.longest.unwrap_or_default();
        self.longest = Some((longest - longest.div_ceil(16)).max(ns));
    }

    /// A copy came back after it was given up.
    pub(crate) fn was_late(&mut self) {
        let longest = self.longest.map_or(UNKNOWN / FACTOR, Duration::from_nanos);
        self.longest = Some(longest.saturating_mul(2).saturating_add(MARGIN / 2).min(LONGEST).as_nanos() as u64);
    }

    /// The longest recent round trip in nanoseconds, 0 if none was measured.
    pub(crate) fn longest(&self) -> u64 {
        self.longest.unwrap_or_default()
    }

    /// Time limit of a frame whose datagrams were lost this number of times before.
    pub(crate) fn wait(&self, losses: u8) -> Duration {
        let first = self.longest.map_or(UNKNOWN, |longest| Duration::from_nanos(longest) * FACTOR + MARGIN);
        GROWTH.get(usize::from(losses)).map_or(LONGEST, |factor| first.saturating_mul(*factor).min(LONGEST))
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;

    use super::*;

    #[test]
    fn limits_follow_the_round_trips_and_grow_slowly_with_losses() {
        let mut trips = RoundTrip::default();
        let limits = |trips: &RoundTrip| -> Vec<u128> {
            (0..=MAX_RETRIES).map(|losses| trips.wait(losses).as_micros()).collect()
        };
        let unknown = limits(&trips);
        assert_eq!(unknown[..6], [5_000, 5_000, 5_000, 10_000, 10_000, 20_000], "no round trip was measured");
        trips.took(100_000);
        let known = limits(&trips);
        assert_eq!(known[..6], [2_400, 2_400, 2_400, 4_800, 4_800, 9_600]);
        assert_eq!(known[6..], [20_000; 4]);
        assert!(known.iter().sum::<u128>() > 100_000, "a stop of a tenth of a second");
        trips.was_late();
        assert_eq!(trips.wait(0), Duration::from_micros(6_800));
    }

    #[test]
    fn a_late_copy_before_any_round_trip_doubles_the_limit() {
        let mut trips = RoundTrip::default();
        trips.was_late();
        assert_eq!(trips.wait(0), Duration::from_micros(16_000));
    }

    #[test]
    fn the_longest_round_trip_decays() {
        let mut trips = RoundTrip::default();
        trips.took(4_000_000);
        assert_eq!(trips.wait(0), Duration::from_millis(18));
        (0..100).for_each(|_| trips.took(100_000));
        assert_eq!(trips.wait(0), Duration::from_micros(2_400));
    }
}
