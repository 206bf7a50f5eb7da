//! Lines for the operator about a bus, as users search for them: link, SubDevices, states, scans, working counters, and
//! once a second what was lost.
//!
//! [`Lines`] decides from samples and events what is worth a line; [`Messenger`] takes both ten times a second in a
//! thread of its own and prints. Neither touches the cyclic path.

use std::collections::BTreeMap;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use ringcat::daemon::serving;
use ringcat::{Event, Instant, Link, Services, SupervisorThread, TimedEvent};

use crate::code::report;
use crate::host::be_an_ordinary_thread;

/// Interval of looks.
const LOOK: Duration = Duration::from_millis(100);
/// Looks between two summaries.
const LOOKS_PER_SUMMARY: u32 = 10;
/// Looks without an answer until the SubDevices count as gone: a scan knows them before the supervision does.
const SILENT_LOOKS: u32 = 3;
/// Stack of the thread.
const STACK_BYTES: usize = 256 << 10;
/// Names of the AL states by bit.
const STATES: [&str; 4] = ["INIT", "PREOP", "SAFEOP", "OP"];

/// What is compared from look to look.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sample {
    /// A link is up.
    pub is_up: bool,
    /// SubDevices that answer.
    pub responding: u16,
    /// Their AL states, ORed.
    pub al_states: u8,
}

/// What is counted from summary to summary.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Datagrams and copies of frames that did not come back in time.
    pub timed_out: u64,
    /// Frames that came too late, twice, or with other datagrams than were sent.
    pub unmatched: u64,
}

/// Changes of the working counter of a domain since the last summary.
#[derive(Clone, Copy, Debug, Default)]
struct WorkingCounter {
    changes: u32,
    now: (u32, u32),
    /// A line was printed in this second.
    is_shown: bool,
}

/// What is to be printed.
#[derive(Debug, Default)]
pub struct Lines {
    before: Sample,
    silent_looks: u32,
    counts: Counts,
    skipped: u64,
    scan_begun: Option<Instant>,
    domains: BTreeMap<usize, WorkingCounter>,
    lines: Vec<String>,
}

impl Lines {
    /// Takes a sample.
    pub fn look(&mut self, now: Sample) {
        let is_silent = now.responding == 0 && self.before.responding > 0;
        self.silent_looks = if is_silent { self.silent_looks + 1 } else { 0 };
        if is_silent && self.silent_looks < SILENT_LOOKS {
            return;
        }
        let before = std::mem::replace(&mut self.before, now);
        if now.is_up != before.is_up {
            self.lines.push(format!("Link state changed to {}.", if now.is_up { "UP" } else { "DOWN" }));
        }
        if now.responding != before.responding {
            self.lines.push(format!("Slave(s) responding: {}.", now.responding));
        }
        if now.al_states != before.al_states && now.responding > 0 {
            let states = STATES.iter().enumerate().filter(|(bit, _)| now.al_states >> bit & 1 != 0);
            let names: Vec<&str> = states.map(|(_, name)| *name).collect();
            self.lines.push(format!("Slave states: {}.", names.join(", ")));
        }
    }

    /// Takes an event.
    pub fn take(&mut self, event: &TimedEvent) {
        match &event.event {
            Event::Counted { main, redundant } => {
                let responding = main.saturating_add(*redundant);
                self.look(Sample { is_up: self.before.is_up || responding > 0, responding, ..self.before });
                self.scan_begun = Some(event.at);
                self.lines.push("Scanning bus.".into());
            }
            Event::ScanFinished { .. } => {
                if let Some(begun) = self.scan_begun.take() {
                    let time = event.at.since(begun).as_millis();
                    self.lines.push(format!("Bus scanning completed in {time} ms."));
                }
            }
            Event::ScanFailed { reason } => self.lines.push(format!("Bus scanning failed: {reason}")),
            Event::ConfigurationFailed { subdevice, reason } => {
                self.lines.push(format!("Slave configuration {} failed: {reason}", subdevice.0));
            }
            Event::Domain { domain, status, .. } => {
                let (number, now) = (domain.0, (status.wkc, status.expected));
                let counter = self.domains.entry(number).or_default();
                if counter.now == now {
                    return;
                }
                counter.now = now;
                if counter.is_shown {
                    counter.changes += 1;
                } else {
                    counter.is_shown = true;
                    self.lines.push(format!("Domain {number}: Working counter changed to {}/{}.", now.0, now.1));
                }
            }
            Event::Skipped { .. } => self.skipped += 1,
            _ => {}
        }
    }

    /// A second is over.
    pub fn summarise(&mut self, now: Counts) {
        let before = std::mem::replace(&mut self.counts, now);
        let skipped = std::mem::take(&mut self.skipped);
        let sums = [
            (now.timed_out.saturating_sub(before.timed_out), "TIMED OUT"),
            (now.unmatched.saturating_sub(before.unmatched), "UNMATCHED"),
            (skipped, "SKIPPED"),
        ];
        for (count, what) in sums.into_iter().filter(|(count, _)| *count > 0) {
            let plural = if count == 1 { "" } else { "s" };
            self.lines.push(format!("WARNING: {count} datagram{plural} {what}!"));
        }
        for (number, counter) in &mut self.domains {
            let (changes, (wkc, expected)) = (std::mem::take(&mut counter.changes), counter.now);
            counter.is_shown = changes > 0;
            if changes > 0 {
                self.lines.push(format!(
                    "Domain {number}: {changes} working counter change{} - now {wkc}/{expected}.",
                    if changes == 1 { "" } else { "s" }
                ));
            }
        }
    }

    /// Takes the lines that are to be printed.
    pub fn pop(&mut self) -> Vec<String> {
        std::mem::take(&mut self.lines)
    }
}

/// Prints the lines of a bus until it is dropped.
#[derive(Debug)]
pub struct Messenger {
    end: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Messenger {
    /// Begins.
    ///
    /// # Errors
    /// The thread cannot be started.
    pub fn begin(master: u32, supervisor: SupervisorThread) -> std::io::Result<Messenger> {
        let (end, ends) = channel();
        let body = move || {
            be_an_ordinary_thread();
            let (mut lines, mut looks) = (Lines::default(), 0_u32);
            loop {
                let is_last = ends.recv_timeout(LOOK) != Err(RecvTimeoutError::Timeout);
                looks += 1;
                look(&supervisor, &mut lines, looks.is_multiple_of(LOOKS_PER_SUMMARY) || is_last);
                if let Some(now) = is_last.then(|| serving::look(&supervisor).ok()).flatten() {
                    // After a release the live status may be older than the states.
                    let (is_up, responding) = (now.is_up.contains(&true), now.responding());
                    lines.look(Sample { is_up, responding, al_states: now.al_states });
                }
                for line in lines.pop() {
                    match master {
                        0 => report(format_args!("{line}")),
                        _ => report(format_args!("master {master}: {line}")),
                    }
                }
                if is_last {
                    return;
                }
            }
        };
        let thread = std::thread::Builder::new().name("messages".into()).stack_size(STACK_BYTES).spawn(body)?;
        Ok(Messenger { end: Some(end), thread: Some(thread) })
    }
}

impl Drop for Messenger {
    fn drop(&mut self) {
        self.end = None;
        if let Some(thread) = self.thread.take() {
            // The panic handler has reported a panic of the thread.
            let _ = thread.join();
        }
    }
}

fn look(supervisor: &SupervisorThread, lines: &mut Lines, is_second_over: bool) {
    let Ok(live) = supervisor.live_status() else { return };
    let segment = live.segment();
    let (is_up, responding, al_states) = (segment.is_up, segment.responding, segment.al_states);
    lines.look(Sample { is_up, responding, al_states });
    while let Some(event) = supervisor.pop_event() {
        lines.take(&event);
    }
    if is_second_over {
        let counters = supervisor.counters();
        let lost: u64 = Link::ALL.into_iter().map(|link| live.lost(link).copies).sum();
        lines.summarise(Counts {
            timed_out: counters.timed_out.saturating_add(lost),
            unmatched: counters.late.saturating_add(counters.corrupt),
        });
    }
}

#[cfg(test)]
mod tests {
    use ringcat::{DomainId, DomainStatus};

    use super::*;

    fn at(ms: u64, event: Event) -> TimedEvent {
        TimedEvent::new(Instant(ms * 1_000_000), event)
    }

    // covers: c-interface
    #[test]
    fn a_scan_and_its_surroundings_are_printed_as_in_the_manual() {
        let mut lines = Lines::default();
        lines.look(Sample { is_up: false, responding: 0, al_states: 0 });
        lines.take(&at(100, Event::Counted { main: 5, redundant: 0 }));
        lines.take(&at(531, Event::ScanFinished { subdevices: 5 }));
        let wanted = [
            "Link state changed to UP.",
            "Slave(s) responding: 5.",
            "Scanning bus.",
            "Bus scanning completed in 431 ms.",
        ];
        assert_eq!(lines.pop(), wanted);
        lines.look(Sample { is_up: true, responding: 5, al_states: 2 });
        assert_eq!(lines.pop(), ["Slave states: PREOP."]);
        lines.look(Sample { is_up: true, responding: 5, al_states: 2 });
        (1..SILENT_LOOKS).for_each(|_| lines.look(Sample::default()));
        lines.look(Sample { is_up: true, responding: 5, al_states: 2 });
        assert!(lines.pop().is_empty(), "nothing has changed");
        lines.look(Sample { is_up: true, responding: 5, al_states: 10 });
        (0..SILENT_LOOKS).for_each(|_| lines.look(Sample::default()));
        assert_eq!(lines.pop(), ["Slave states: PREOP, OP.", "Link state changed to DOWN.", "Slave(s) responding: 0."]);
    }

    // covers: c-interface
    #[test]
    fn what_changes_often_is_summarised_once_a_second() {
        let mut lines = Lines::default();
        let changed = |wkc| {
            let mut status = DomainStatus::default();
            (status.wkc, status.expected) = (wkc, 5);
            at(0, Event::Domain { domain: DomainId(0), status, incomplete: 0 })
        };
        for wkc in [5, 4, 5, 3] {
            lines.take(&changed(wkc));
            lines.take(&at(0, Event::Skipped { domain: DomainId(0) }));
        }
        assert_eq!(lines.pop(), ["Domain 0: Working counter changed to 5/5."]);
        lines.summarise(Counts { timed_out: 7, unmatched: 1 });
        let wanted = [
            "WARNING: 7 datagrams TIMED OUT!",
            "WARNING: 1 datagram UNMATCHED!",
            "WARNING: 4 datagrams SKIPPED!",
            "Domain 0: 3 working counter changes - now 3/5.",
        ];
        assert_eq!(lines.pop(), wanted);
        lines.summarise(Counts { timed_out: 7, unmatched: 1 });
        assert!(lines.pop().is_empty());
    }
}
