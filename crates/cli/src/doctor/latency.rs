//! How late a thread wakes up that sleeps from one cycle to the next, with the settings that a cycle has.
//!
//! The thread sleeps until the times of a grid of 1 ms, as a cycle with `--receive block` does. It has what
//! `ringcat run --priority` gives: SCHED_FIFO, locked memory, processors that stay awake. All of it ends with the
//! measurement. What is not permitted is left out, as in `ringcat run`, and is reported.

use std::thread;
use std::time::Duration;

use ringcat::histogram::{Bucket, Histogram};
use ringcat_link::monotonic;
use ringcat_link::realtime::{self, CpuLatency};

use super::finding::{Finding, Topic};
use crate::ending::EndRequest;
use crate::failure::Failure;
use crate::json;
use crate::json::values::Times;
use crate::output::warn;

const LATENCY: Topic =
    Topic { id: "latency", why: "a cycle that begins late leaves its outputs late, or loses its place in time" };

/// The cycle.
const PERIOD: Duration = Duration::from_millis(1);
/// From here on, half of a cycle of 1 ms is gone.
const BAD: Duration = Duration::from_micros(500);
/// From here on, the shorter cycles of drives suffer.
const MINOR: Duration = Duration::from_micros(100);
/// Times that are not longer than this are in one row, in nanoseconds.
const FIRST_ROW_NS: u64 = 1 << 10;
/// Characters of the longest bar.
const BAR: usize = 46;

/// What the thread has.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Settings {
    /// Real-time priority; `None` where it is not permitted.
    pub priority: Option<i32>,
    /// Processor that it is bound to.
    pub cpu: Option<usize>,
    /// Whether memory is locked.
    pub locked: bool,
    /// Whether processors stay awake.
    pub awake: bool,
}

/// What was measured.
#[derive(Debug)]
pub struct Latency {
    pub settings: Settings,
    pub delays: Histogram,
    /// Wake-ups that were left out, since the one before came later than them.
    pub skipped: u64,
}

/// Measures for a while, or until the end is requested.
pub fn measure(lasts: Duration, priority: i32, cpu: Option<usize>, end: &EndRequest) -> Result<Latency, Failure> {
    let end = end.clone();
    let body = move || {
        realtime::precise_timers();
        let cpu = cpu.filter(|cpu| realtime::affinity(*cpu).map_err(warn).is_ok());
        // What is refused of the others is in the settings, and in the findings about permissions.
        let locked = realtime::lock_memory().is_ok();
        let awake = CpuLatency::request(0).ok();
        let priority = Some(priority).filter(|priority| realtime::fifo(*priority).is_ok());
        let settings = Settings { priority, cpu, locked, awake: awake.is_some() };
        let mut latency = Latency { settings, delays: Histogram::default(), skipped: 0 };
        latency.wake(lasts, &end);
        drop(awake);
        latency
    };
    let thread = thread::Builder::new().name("ringcat-latency".to_owned()).spawn(body);
    let thread = thread.map_err(|error| Failure::new(format!("a thread cannot be started: {error}")))?;
    thread.join().map_err(|_| Failure::new("the thread that measures has ended by a panic"))
}

impl Latency {
    fn wake(&mut self, lasts: Duration, end: &EndRequest) {
        let period_ns = PERIOD.as_nanos() as u64;
        let mut next = monotonic::now_ns() + period_ns;
        let last = next.saturating_add(u64::try_from(lasts.as_nanos()).unwrap_or(u64::MAX));
        while next < last && !end.is_asked() {
            monotonic::sleep_until_ns(next);
            let late_ns = monotonic::now_ns().saturating_sub(next);
            self.delays.record(Duration::from_nanos(late_ns));
            let missed = late_ns / period_ns;
            self.skipped += missed;
            next += (missed + 1) * period_ns;
        }
    }

    /// What follows from it.
    pub fn finding(&self) -> Finding {
        if self.delays.count() == 0 {
            return LATENCY.unknown("nothing was measured");
        }
        let longest = self.delays.longest();
        let us = longest.as_nanos() as f64 / 1e3;
        let text = format!("of {} wake-ups the latest came {us:.1} us late; {}", self.delays.count(), self.settings());
        let mend = ["correct the other findings first, then measure under the load of operation"];
        match longest {
            _ if longest >= BAD => LATENCY.bad(text, &mend),
            _ if longest >= MINOR => LATENCY.minor(text, &mend),
            _ => LATENCY.good(text),
        }
    }

    /// The settings in words.
    pub fn settings(&self) -> String {
        let Settings { priority, cpu, locked, awake } = self.settings;
        let mut words = vec![priority.map_or("no real-time priority".to_owned(), |it| format!("SCHED_FIFO {it}"))];
        words.extend(cpu.map(|cpu| format!("on processor {cpu}")));
        words.push(if locked { "memory locked" } else { "memory not locked" }.to_owned());
        words.push(if awake { "processors kept awake" } else { "processors may sleep" }.to_owned());
        words.join(", ")
    }

    /// The histogram for people. Bars are logarithmic, so that a single wake-up shows.
    pub fn lines(&self) -> Vec<String> {
        let rows = self.rows();
        let most = rows.iter().map(|(_, count)| *count).max().unwrap_or(0);
        let bar = |count: u64| match count {
            0 => 0,
            count => (BAR as f64 * (1.0 + count as f64).log2() / (1.0 + most as f64).log2()).ceil() as usize,
        };
        let row = |(below, count): &(u64, u64)| {
            let line = format!("{:>10.1} us {count:>10}  {}", *below as f64 / 1e3, "#".repeat(bar(*count)));
            line.trim_end().to_owned()
        };
        let heading = "  late below   wake-ups  (bars are logarithmic)".to_owned();
        std::iter::once(heading).chain(rows.iter().map(row)).collect()
    }

    /// Counts by doublings, from the first row with some to the last one: times below so many nanoseconds.
    fn rows(&self) -> Vec<(u64, u64)> {
        let mut rows: Vec<(u64, u64)> = Vec::new();
        for Bucket { begin, count, .. } in self.delays.buckets() {
            let ns = u64::try_from(begin.as_nanos()).unwrap_or(u64::MAX);
            let below = (ns + 1).checked_next_power_of_two().unwrap_or(u64::MAX).max(FIRST_ROW_NS);
            while rows.last().is_some_and(|(last, _)| *last < below) {
                rows.extend(rows.last().map(|(last, _)| (last.saturating_mul(2), 0)));
            }
            match rows.last_mut() {
                Some((_, total)) => *total += count,
                None => rows.push((below, count)),
            }
        }
        rows
    }

    /// As the keys of JSON.
    pub fn json(&self) -> json::doctor::Latency {
        let Settings { priority, cpu, locked, awake } = self.settings;
        json::doctor::Latency {
            period_ns: PERIOD.as_nanos() as u64,
            priority,
            cpu,
            memory_locked: locked,
            processors_awake: awake,
            delays: Times::of(&self.delays),
            skipped: self.skipped,
            counts: self.rows().into_iter().map(|(below_ns, count)| json::doctor::Count { below_ns, count }).collect(),
        }
    }
}

#[cfg(test)]
pub mod tests {
    use super::*;

    /// A measurement with these delays, in microseconds.
    pub fn measured(delays: &[(u64, u64)]) -> Latency {
        let histogram = Histogram::default();
        for (us, count) in delays {
            (0..*count).for_each(|_| histogram.record(Duration::from_micros(*us)));
        }
        Latency { settings: Settings::default(), delays: histogram, skipped: 0 }
    }

    // covers: bench
    #[test]
    fn a_latency_is_rated_by_its_longest_delay() {
        use super::super::finding::Level::{Bad, Good, Minor, Unknown};
        let level = |delays: &[(u64, u64)]| measured(delays).finding().level;
        let levels = [level(&[]), level(&[(5, 9_000)]), level(&[(5, 9_000), (100, 1)]), level(&[(500, 1)])];
        assert_eq!(levels, [Unknown, Good, Minor, Bad]);
    }

    // covers: bench
    #[test]
    fn rows_have_every_wake_up_once_and_bars_show_a_single_one() {
        let latency = measured(&[(0, 3), (5, 9_000), (90, 1), (60_000, 1)]);
        let rows = latency.rows();
        assert_eq!((rows.first(), rows.last()), (Some(&(1_024, 3)), Some(&(1 << 26, 1))));
        assert_eq!(rows.iter().map(|(_, count)| count).sum::<u64>(), 9_005);
        assert!(rows.windows(2).all(|two| two[0].0 * 2 == two[1].0), "{rows:?}");
        let lines = latency.lines();
        assert!(lines.iter().all(|line| line.chars().count() <= 80), "{lines:?}");
        let bars = |line: &String| line.matches('#').count();
        assert_eq!(lines.iter().map(bars).max(), Some(BAR));
        assert!(lines.last().is_some_and(|line| bars(line) >= 1 && line.contains("67108.9 us          1  #")));
        assert_eq!(measured(&[]).lines().len(), 1);
        let end = measured(&[(u64::MAX / 1_000, 1), (0, 1)]).rows();
        assert!(end.len() < 70 && end.iter().map(|(_, count)| count).sum::<u64>() == 2, "{end:?}");
    }
}
