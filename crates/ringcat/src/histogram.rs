//! Histograms of times: round trips, delays of wake-ups.
//!
//! Recording takes a few instructions and does not allocate. Times are kept with an error of at most one eighth. One
//! thread records; other threads may read at the same time.

use std::fmt;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// Buckets per doubling.
const FINE: usize = 8;
/// Enough for any 64-bit number of nanoseconds.
const BUCKETS: usize = 62 * FINE;

/// Counts of times by their length. Only one thread records, so no read-modify-write is needed.
#[derive(Debug)]
pub struct Histogram {
    buckets: Box<[AtomicU64; BUCKETS]>,
    shortest_ns: AtomicU64,
    longest_ns: AtomicU64,
}

impl Default for Histogram {
    fn default() -> Histogram {
        Histogram {
            buckets: Box::new([const { AtomicU64::new(0) }; BUCKETS]),
            shortest_ns: AtomicU64::new(u64::MAX),
            longest_ns: AtomicU64::new(0),
        }
    }
}

/// Number of measured times within limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Bucket {
    /// The shortest time that is counted here.
    pub begin: Duration,
    /// Times that are counted here are shorter.
    pub end: Duration,
    /// Number of times.
    pub count: u64,
}

fn get(word: &AtomicU64) -> u64 {
    word.load(Ordering::Relaxed)
}

fn set(word: &AtomicU64, value: u64) {
    word.store(value, Ordering::Relaxed);
}

impl Histogram {
    /// Counts a time. For one thread only.
    pub fn record(&self, time: Duration) {
        self.record_ns(u64::try_from(time.as_nanos()).unwrap_or(u64::MAX));
    }

    /// As [`Histogram::record`], in nanoseconds.
    // The sum of the buckets is the count: readers add them up, so that recording need not.
    #[inline(always)]
    pub(crate) fn record_ns(&self, ns: u64) {
        if let Some(bucket) = self.buckets.get(bucket_of(ns)) {
            set(bucket, get(bucket) + 1);
        }
        if ns < get(&self.shortest_ns) {
            set(&self.shortest_ns, ns);
        }
        if ns > get(&self.longest_ns) {
            set(&self.longest_ns, ns);
        }
    }

    /// Clears all counts. For the thread that records.
    pub fn clear(&self) {
        for word in self.buckets.iter().chain([&self.longest_ns]) {
            set(word, 0);
        }
        set(&self.shortest_ns, u64::MAX);
    }

    /// Number of counted times.
    pub fn count(&self) -> u64 {
        self.buckets.iter().map(get).sum()
    }

    /// Counts of the times in each bucket that has some, from the shortest times to the longest.
    pub fn buckets(&self) -> impl Iterator<Item = Bucket> + '_ {
        let bucket = |(number, count): (usize, &AtomicU64)| Bucket {
            begin: Duration::from_nanos(start_of(number)),
            end: Duration::from_nanos(start_of(number + 1)),
            count: get(count),
        };
        self.buckets.iter().enumerate().map(bucket).filter(|bucket| bucket.count > 0)
    }

    /// The shortest time.
    pub fn shortest(&self) -> Duration {
        Duration::from_nanos(if self.count() == 0 { 0 } else { get(&self.shortest_ns) })
    }

    /// The longest time.
    pub fn longest(&self) -> Duration {
        Duration::from_nanos(get(&self.longest_ns))
    }

    /// Quantile: at least this share of all times, in parts per million, is not longer than the result.
    pub fn quantile(&self, parts_per_million: u32) -> Duration {
        let rank = (u128::from(self.count()) * u128::from(parts_per_million)).div_ceil(1_000_000) as u64;
        let mut seen = 0;
        let found = self.buckets.iter().position(|count| {
            seen += get(count);
            seen >= rank
        });
        let limit_ns = found.map_or(0, |bucket| start_of(bucket + 1).saturating_sub(1));
        let (shortest, longest) = (get(&self.shortest_ns), get(&self.longest_ns));
        Duration::from_nanos(limit_ns.clamp(shortest.min(longest), longest))
    }
}

impl fmt::Display for Histogram {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let us = |time: Duration| time.as_nanos() as f64 / 1e3;
        write!(f, "min {:.1}", us(self.shortest()))?;
        for (name, part) in [("50 %", 500_000), ("90 %", 900_000), ("99 %", 990_000), ("99.9 %", 999_000)] {
            write!(f, ", {name} {:.1}", us(self.quantile(part)))?;
        }
        write!(f, ", max {:.1} us", us(self.longest()))
    }
}

/// Below `FINE` one bucket per nanosecond, from there on `FINE` buckets per doubling.
#[inline(always)]
fn bucket_of(ns: u64) -> usize {
    if ns < FINE as u64 {
        return ns as usize;
    }
    let doubling = (ns / FINE as u64).ilog2();
    (doubling as usize) * FINE + (ns >> doubling) as usize
}

/// The shortest time of a bucket.
fn start_of(bucket: usize) -> u64 {
    if bucket < 2 * FINE {
        return bucket as u64;
    }
    let doubling = bucket / FINE - 1;
    u64::try_from(((bucket - doubling * FINE) as u128) << doubling).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_time_is_in_the_bucket_that_begins_at_or_before_it() {
        let mut times: Vec<u64> = (0..5_000).collect();
        times.extend((12..64).flat_map(|bit| [(1u64 << bit) - 1, 1 << bit, (1 << bit) + 1]));
        times.push(u64::MAX);
        for ns in times {
            let bucket = bucket_of(ns);
            assert!(bucket < BUCKETS, "{ns}");
            assert!(start_of(bucket) <= ns, "{ns}");
            assert!(ns < start_of(bucket + 1) || start_of(bucket + 1) == u64::MAX, "{ns}");
        }
    }

    // covers: run
    #[test]
    fn quantiles_are_at_most_an_eighth_too_long() {
        let histogram = Histogram::default();
        for us in 1..=1_000 {
            histogram.record(Duration::from_micros(us));
        }
        for (part, us) in [(500_000, 500), (990_000, 990), (1_000_000, 1_000)] {
            let found = histogram.quantile(part).as_nanos() as u64;
            assert!((us * 1_000..=us * 1_125).contains(&found), "{part}: {found}");
        }
        assert_eq!((histogram.shortest(), histogram.longest()), (Duration::from_micros(1), Duration::from_millis(1)));
        assert!(histogram.to_string().starts_with("min 1.0, 50 % "));
        assert_eq!(Histogram::default().quantile(500_000), Duration::ZERO);
    }

    // covers: bench
    #[test]
    fn buckets_hold_each_time_once_and_follow_each_other() {
        let histogram = Histogram::default();
        for ns in [0, 7, 8, 1_000, 1_001, 1_000_000, u64::MAX] {
            histogram.record(Duration::from_nanos(ns));
        }
        let buckets: Vec<Bucket> = histogram.buckets().collect();
        assert_eq!(buckets.iter().map(|bucket| bucket.count).sum::<u64>(), 7);
        assert!(buckets.windows(2).all(|two| two[0].end <= two[1].begin));
        assert!(buckets.iter().all(|bucket| bucket.begin < bucket.end), "{buckets:?}");
        assert!(buckets.iter().any(|bucket| bucket.count == 2 && bucket.begin <= Duration::from_micros(1)));
    }
}
