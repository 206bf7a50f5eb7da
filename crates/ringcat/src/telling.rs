//! What happens while cycles run, in lines: events one by one, and what a bad time makes thousands of in a few.
//!
//! A machine that is too slow for its cycle leaves cycles out and misses frames all the time. Told one by one, that buries
//! everything else; told up to some number, the next break says nothing. So the first few are told as they happen, and then
//! how many there were, at pauses that grow while it lasts. A quiet time begins it anew.

use std::time::Duration;

use ringcat::text::{Names, address_of_sender, describe};
use ringcat::{CyclicThread, Event, Instant, Links};

use crate::surroundings::Surroundings;

/// So many are told one by one.
const ONE_BY_ONE: u32 = 20;
/// Then they are counted for so long before the count is told, and for twice as long each time.
const FIRST_PAUSE: Duration = Duration::from_secs(1);
const LONGEST_PAUSE: Duration = Duration::from_secs(60);
/// Without any for so long, the next ones are told one by one again.
const QUIET: Duration = Duration::from_secs(10);

/// What is to be told.
#[derive(Debug)]
pub enum Told {
    /// Something that happened, with its time.
    Line(String),
    /// Something that the user should do something about.
    Warning(String),
}

/// Tells.
pub struct Telling {
    begin: Instant,
    names: Names,
    surroundings: Surroundings,
    /// Changes of what process data is judged.
    judgements: Crowd,
    /// The last of them, in words.
    judged: String,
    /// Cycles whose frames were still out when the next one was due.
    still_out: Crowd,
    /// Cycles that this machine was too late for.
    left_out: Crowd,
    /// How many of these are accounted for.
    left_out_before: u64,
    /// Nothing is counted instead of being told.
    one_by_one: bool,
}

impl Telling {
    /// Nothing has been told; times count from `begin`.
    pub fn new(begin: Instant, names: Names, surroundings: Surroundings) -> Telling {
        let [judgements, still_out, left_out] = Default::default();
        Telling {
            begin,
            names,
            surroundings,
            judgements,
            judged: String::new(),
            still_out,
            left_out,
            left_out_before: 0,
            one_by_one: false,
        }
    }

    /// The same, with everything told one by one, however often it comes, or not.
    pub fn one_by_one(self, one_by_one: bool) -> Telling {
        Telling { one_by_one, ..self }
    }

    /// Names of the SubDevices.
    pub fn names(&self) -> &Names {
        &self.names
    }

    /// What was noticed around the segment.
    pub fn surroundings(&self) -> &Surroundings {
        &self.surroundings
    }

    /// A line of something that happened at a time.
    pub fn line(&self, at: Instant, words: &str) -> String {
        format!("{:>12.3} ms  {words}", at.since(self.begin).as_secs_f64() * 1e3)
    }

    /// Tells what has happened since the last call.
    pub fn news<L: Links + Send>(&mut self, cycles: &CyclicThread<L>, now: Instant, mut tell: impl FnMut(Told)) {
        if let Some((link, source)) = cycles.news().foreign() {
            self.surroundings.note_sender(link, source).map(Told::Warning).into_iter().for_each(&mut tell);
        }
        let all = self.one_by_one;
        while let Some(event) = cycles.supervisor().pop_event() {
            let words = describe(&event, &self.names);
            let is_told = match &event.event {
                Event::ForeignFrame { arrived_on, bytes } => {
                    let words = address_of_sender(bytes).and_then(|it| self.surroundings.note_sender(*arrived_on, it));
                    words.map(Told::Warning).into_iter().for_each(&mut tell);
                    false
                }
                Event::Domain { .. } => {
                    self.judged.clone_from(&words);
                    all || self.judgements.note(1, event.at)
                }
                Event::Skipped { .. } => all || self.still_out.note(1, event.at),
                _ => true,
            };
            if is_told {
                tell(Told::Line(self.line(event.at, &words)));
            }
        }
        let left_out = cycles.news().pace().skipped;
        let more = left_out - std::mem::replace(&mut self.left_out_before, left_out);
        if more > 0 && (all || self.left_out.note(more, now)) {
            tell(Told::Line(self.line(now, &format!("this machine: {more} cycles left out"))));
        }
        if let Some((count, within)) = self.left_out.count(now) {
            tell(Told::Line(self.line(now, &format!("this machine: {count} cycles left out within {within:.0?}"))));
        }
        if let Some((count, within)) = self.still_out.count(now) {
            let words = format!("process data: {count} cycles skipped within {within:.0?}, frames were still out");
            tell(Told::Line(self.line(now, &words)));
        }
        if let Some((count, within)) = self.judgements.count(now) {
            let words = format!("process data: judged anew {count} times within {within:.0?}, now {}", self.judged);
            tell(Told::Line(self.line(now, &words)));
        }
    }
}

/// Things of one kind that may come by the thousand.
#[derive(Debug, Default)]
struct Crowd {
    /// How many were told one by one.
    told: u32,
    /// How many were not told yet, and since when they are counted.
    held: u64,
    since: Instant,
    pause: Duration,
    /// When the last one came.
    last: Instant,
}

impl Crowd {
    /// Takes note of some more; whether they are to be told by themselves.
    fn note(&mut self, more: u64, now: Instant) -> bool {
        if self.held == 0 && now.since(self.last) >= QUIET {
            *self = Crowd::default();
        }
        self.last = now;
        if self.told < ONE_BY_ONE {
            self.told += 1;
            return true;
        }
        if self.held == 0 {
            self.since = now;
            self.pause = (self.pause * 2).clamp(FIRST_PAUSE, LONGEST_PAUSE);
        }
        self.held += more;
        false
    }

    /// How many were not told one by one, and within how long, if it is time to tell that.
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

    /// Something every millisecond from one second to another: how many are told one by one, and the counts.
    fn storm(crowd: &mut Crowd, from: u64, to: u64) -> (usize, Vec<u64>) {
        let (mut one_by_one, mut counts) = (0, Vec::new());
        for ms in from * 1_000..to * 1_000 {
            let now = Instant(ms * 1_000_000);
            one_by_one += usize::from(crowd.note(1, now));
            counts.extend(crowd.count(now).map(|(count, _)| count));
        }
        (one_by_one, counts)
    }

    #[test]
    fn a_crowd_is_told_one_by_one_then_by_counts_at_pauses_that_grow() {
        let mut crowd = Crowd::default();
        let (one_by_one, counts) = storm(&mut crowd, 1, 601);
        assert_eq!(one_by_one, ONE_BY_ONE as usize);
        assert_eq!(counts[..4], [1_001, 2_001, 4_001, 8_001]);
        assert!(counts.len() < 20 && counts.iter().all(|count| *count <= 60_001), "{counts:?}");
        // What is held is told, however long it is quiet.
        let held = crowd.held;
        assert!(held > 0);
        assert_eq!(crowd.count(Instant(700_000_000_000)).map(|(count, _)| count), Some(held));
        assert_eq!(crowd.count(Instant(800_000_000_000)), None);
    }

    #[test]
    fn after_a_quiet_time_things_are_told_one_by_one_again() {
        let mut crowd = Crowd::default();
        storm(&mut crowd, 1, 5);
        crowd.count(Instant(10_000_000_000));
        assert_eq!(storm(&mut crowd, 6, 7).0, 0);
        crowd.count(Instant(20_000_000_000));
        assert_eq!(storm(&mut crowd, 30, 31).0, ONE_BY_ONE as usize);
    }
}
