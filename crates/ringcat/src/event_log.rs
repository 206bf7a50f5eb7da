//! Events as lines of a log, condensed: a line for each of the first events of a kind, then counts.
//!
//! A machine that is too slow for its cycle leaves out cycles and misses frames continuously. A line for each of them
//! hides all other events; a fixed number of lines hides the next break. So each of the first twenty events of a kind
//! has a line. Further events are counted, and lines with the count follow at growing intervals. After a quiet time
//! each event has a line again. Only kinds that may occur thousands of times are condensed: changes of domain states,
//! skipped and left out cycles, frames of other MainDevices.
//!
//! ```
//! use ringcat::event_log::EventLog;
//! use ringcat::text::Names;
//! use ringcat::{AcyclicHalf, Application, Links};
//!
//! fn log<L: Links, H: AcyclicHalf>(application: &mut Application<L, H>, log: &mut EventLog) {
//!     while let Some(event) = application.pop_event() {
//!         log.event(&event).iter().for_each(|line| println!("{line}"));
//!     }
//!     let (now, skipped) = (application.links().now(), application.pace().skipped);
//!     log.left_out(skipped, now).iter().for_each(|line| println!("{line}"));
//!     log.counts(now).iter().for_each(|line| println!("{line}"));
//! }
//! ```

use std::time::Duration;

use ringcat_engine::event::{Event, TimedEvent};
use ringcat_engine::time::Instant;

use crate::text::{Names, describe};

/// Number of events of a kind that have a line each.
const ONE_BY_ONE: u32 = 20;
/// First interval of counting before a line with the count; each further interval is twice as long.
const FIRST_PAUSE: Duration = Duration::from_secs(1);
const LONGEST_PAUSE: Duration = Duration::from_secs(60);
/// After this time without an event of the kind, each event has a line again.
const QUIET: Duration = Duration::from_secs(10);

/// A condensed log of events. It makes lines; the application prints or stores them.
#[derive(Debug)]
pub struct EventLog {
    begin: Instant,
    names: Names,
    /// Changes of domain states, and the text of the last one.
    state_changes: Crowd,
    last_change: String,
    /// Cycles whose frames were still out when the next one was due.
    still_out: Crowd,
    /// Cycles that were left out because this machine was late, and the number that the log has counted.
    left_out: Crowd,
    left_out_before: u64,
    /// Frames of other MainDevices.
    foreign: Crowd,
    /// Nothing is condensed.
    one_by_one: bool,
}

impl EventLog {
    /// An empty log; times count from `begin`.
    pub fn new(begin: Instant, names: Names) -> EventLog {
        let [state_changes, still_out, left_out, foreign] = Default::default();
        EventLog {
            begin,
            names,
            state_changes,
            last_change: String::new(),
            still_out,
            left_out,
            left_out_before: 0,
            foreign,
            one_by_one: false,
        }
    }

    /// Sets whether each event has a line, without condensing.
    pub fn with_every_event(self, one_by_one: bool) -> EventLog {
        EventLog { one_by_one, ..self }
    }

    /// Names of the SubDevices.
    pub fn names(&self) -> &Names {
        &self.names
    }

    /// A line with a time, in milliseconds since the beginning, and a text.
    pub fn line(&self, at: Instant, words: &str) -> String {
        format!("{:>12.3} ms  {words}", at.since(self.begin).as_secs_f64() * 1e3)
    }

    /// The line of an event; `None` if the event is only counted.
    pub fn event(&mut self, event: &TimedEvent) -> Option<String> {
        let words = describe(event, &self.names);
        let crowd = match &event.event {
            Event::Domain { .. } => {
                self.last_change.clone_from(&words);
                Some(&mut self.state_changes)
            }
            Event::Skipped { .. } => Some(&mut self.still_out),
            Event::ForeignFrame { .. } => Some(&mut self.foreign),
            _ => None,
        };
        let is_shown = self.one_by_one || crowd.is_none_or(|crowd| crowd.note(1, event.at));
        is_shown.then(|| self.line(event.at, &words))
    }

    /// The line for cycles that were left out since the last call; `None` if they are only counted. `skipped` is their
    /// number so far ([`Pace::skipped`](crate::Pace::skipped)).
    pub fn left_out(&mut self, skipped: u64, now: Instant) -> Option<String> {
        let more = skipped.saturating_sub(std::mem::replace(&mut self.left_out_before, skipped));
        let is_shown = more > 0 && (self.one_by_one || self.left_out.note(more, now));
        is_shown.then(|| self.line(now, &format!("this machine: {more} cycles left out")))
    }

    /// The due lines with numbers of counted events. To be called regularly.
    pub fn counts(&mut self, now: Instant) -> Vec<String> {
        let last_change = &self.last_change;
        let words = [
            self.left_out
                .count(now)
                .map(|(count, within)| format!("this machine: {count} cycles left out within {within:.0?}")),
            self.still_out.count(now).map(|(count, within)| {
                format!("process data: {count} cycles skipped within {within:.0?}, frames were still out")
            }),
            self.state_changes.count(now).map(|(count, within)| {
                format!("process data: state changed {count} times within {within:.0?}, now {last_change}")
            }),
            self.foreign
                .count(now)
                .map(|(count, within)| format!("{count} frames of another MainDevice within {within:.0?}")),
        ];
        words.iter().flatten().map(|words| self.line(now, words)).collect()
    }
}

/// Events of one kind that may occur thousands of times.
#[derive(Debug, Default)]
struct Crowd {
    /// Number of events with a line each.
    shown: u32,
    /// Number of events without a line so far, and the time since which they are counted.
    held: u64,
    since: Instant,
    pause: Duration,
    /// When the last one came.
    last: Instant,
}

impl Crowd {
    /// Counts further events. True if they have a line of their own.
    fn note(&mut self, more: u64, now: Instant) -> bool {
        if self.held == 0 && now.since(self.last) >= QUIET {
            *self = Crowd::default();
        }
        self.last = now;
        if self.shown < ONE_BY_ONE {
            self.shown += 1;
            return true;
        }
        if self.held == 0 {
            self.since = now;
            self.pause = (self.pause * 2).clamp(FIRST_PAUSE, LONGEST_PAUSE);
        }
        self.held += more;
        false
    }

    /// Number of counted events and the time in which they occurred, if a line for them is due.
    fn count(&mut self, now: Instant) -> Option<(u64, Duration)> {
        let within = now.since(self.since);
        if self.held == 0 || within < self.pause {
            return None;
        }
        Some((std::mem::take(&mut self.held), within))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An event every millisecond between two seconds: number of single lines, and the counts.
    fn storm(crowd: &mut Crowd, from: u64, to: u64) -> (usize, Vec<u64>) {
        let (mut one_by_one, mut counts) = (0, Vec::new());
        for ms in from * 1_000..to * 1_000 {
            let now = Instant(ms * 1_000_000);
            one_by_one += usize::from(crowd.note(1, now));
            counts.extend(crowd.count(now).map(|(count, _)| count));
        }
        (one_by_one, counts)
    }

    // covers: no-frame-lost, run
    #[test]
    fn a_crowd_has_a_line_each_first_then_counts_at_pauses_that_grow() {
        let mut crowd = Crowd::default();
        let (one_by_one, counts) = storm(&mut crowd, 1, 601);
        assert_eq!(one_by_one, ONE_BY_ONE as usize);
        assert_eq!(counts[..4], [1_001, 2_001, 4_001, 8_001]);
        assert!(counts.len() < 20 && counts.iter().all(|count| *count <= 60_001), "{counts:?}");
        // Counted events get their line even after a long quiet time.
        let held = crowd.held;
        assert!(held > 0);
        assert_eq!(crowd.count(Instant(700_000_000_000)).map(|(count, _)| count), Some(held));
        assert_eq!(crowd.count(Instant(800_000_000_000)), None);
    }

    // covers: run
    #[test]
    fn after_a_quiet_time_events_have_a_line_each_again() {
        let mut crowd = Crowd::default();
        storm(&mut crowd, 1, 5);
        crowd.count(Instant(10_000_000_000));
        assert_eq!(storm(&mut crowd, 6, 7).0, 0);
        crowd.count(Instant(20_000_000_000));
        assert_eq!(storm(&mut crowd, 30, 31).0, ONE_BY_ONE as usize);
    }

    fn at(ms: u64, event: Event) -> TimedEvent {
        TimedEvent::new(Instant(ms * 1_000_000), event)
    }

    fn foreign() -> Event {
        Event::ForeignFrame { arrived_on: crate::Link::Main, bytes: vec![0; 60] }
    }

    // covers: run
    #[test]
    fn a_break_has_its_line_in_the_middle_of_a_storm() {
        let mut log = EventLog::new(Instant(0), Names::default());
        let shown = (0..1_000).filter(|ms| log.event(&at(*ms, foreign())).is_some()).count();
        assert_eq!(shown, ONE_BY_ONE as usize);
        let open = log.event(&at(1_000, Event::RingOpened { main: 2, redundant: 1 })).expect("a line");
        assert_eq!(open, "    1000.000 ms  ring open: 2 SubDevices on MAIN, 1 on REDUNDANT");
        assert_eq!(log.counts(Instant(1_010_000_000)), Vec::<String>::new());
        let counts = log.counts(Instant(2_000_000_000));
        assert_eq!(counts, ["    2000.000 ms  980 frames of another MainDevice within 2s"]);
    }

    // covers: run
    #[test]
    fn one_by_one_nothing_is_condensed() {
        let mut log = EventLog::new(Instant(0), Names::default()).with_every_event(true);
        assert!((0..1_000).all(|ms| log.event(&at(ms, foreign())).is_some()));
        assert_eq!(log.counts(Instant(9_000_000_000)), Vec::<String>::new());
        assert!((1..100).all(|cycle| log.left_out(cycle, Instant(cycle)).is_some()));
    }

    // covers: run
    #[test]
    fn cycles_left_out_are_those_since_the_last_call() {
        let mut log = EventLog::new(Instant(0), Names::default());
        assert_eq!(log.left_out(0, Instant(1)), None);
        assert_eq!(log.left_out(7, Instant(0)).as_deref(), Some("       0.000 ms  this machine: 7 cycles left out"));
        assert_eq!(log.left_out(7, Instant(1)), None);
        assert_eq!(log.left_out(3, Instant(1)), None, "counters begin anew with another application");
    }
}
