//! Which lines are printed of a bus: decided from samples and events.

use std::collections::BTreeMap;

use ringcat_engine::event::{Event, TimedEvent};
use ringcat_engine::time::Instant;
use ringcat_link::operator::Priority;

use crate::daemon::ownership::Ownership;

/// Samples without an answer until the SubDevices count as absent: a scan finds them before supervision does.
const SILENT_LOOKS: u32 = 3;
/// Names of the AL states by bit.
const STATES: [&str; 4] = ["INIT", "PREOP", "SAFEOP", "OP"];

/// What is compared from sample to sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Sample {
    /// A link is up.
    pub is_up: bool,
    /// SubDevices that answer.
    pub responding: u16,
    /// Their AL states, ORed.
    pub al_states: u8,
}

/// What is counted from summary to summary.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Counts {
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
    ownership: Option<Ownership>,
    domains: BTreeMap<usize, WorkingCounter>,
    lines: Vec<Line>,
}

/// A line with its priority.
pub(super) type Line = (Priority, String);

/// Whether an event is about the result of cyclic frames.
pub(super) const fn is_cyclic(event: &Event) -> bool {
    matches!(event, Event::Domain { .. } | Event::Skipped { .. })
}

impl Lines {
    fn push(&mut self, priority: Priority, text: String) {
        self.lines.push((priority, text));
    }

    /// Takes a sample.
    pub(super) fn look(&mut self, now: Sample) {
        let is_silent = now.responding == 0 && self.before.responding > 0;
        self.silent_looks = if is_silent { self.silent_looks + 1 } else { 0 };
        if is_silent && self.silent_looks < SILENT_LOOKS {
            return;
        }
        let before = std::mem::replace(&mut self.before, now);
        if now.is_up != before.is_up {
            let (priority, state) = if now.is_up { (Priority::Info, "UP") } else { (Priority::Warning, "DOWN") };
            self.push(priority, format!("Link state changed to {state}."));
        }
        if now.responding != before.responding {
            self.push(Priority::Info, format!("Slave(s) responding: {}.", now.responding));
        }
        if now.al_states != before.al_states && now.responding > 0 {
            let states = STATES.iter().enumerate().filter(|(bit, _)| now.al_states >> bit & 1 != 0);
            let names: Vec<&str> = states.map(|(_, name)| *name).collect();
            self.push(Priority::Info, format!("Slave states: {}.", names.join(", ")));
        }
    }

    /// Stores whether this process still has the bus, and why not. Returns whether that has changed.
    pub(super) fn own(&mut self, now: Ownership, cause: &str) -> bool {
        if self.ownership.replace(now) == Some(now) {
            return false;
        }
        let (priority, text) = match now {
            Ownership::TakenBack => {
                let text = format!("The master was taken back by ringcatd: {cause}.");
                (Priority::Error, text + " Calls of this process have no effect until it is requested again.")
            }
            Ownership::DaemonEnded => {
                (Priority::Warning, "ringcatd has ended; this process continues to drive the master.".to_owned())
            }
            _ => return true,
        };
        self.push(priority, text);
        true
    }

    /// Takes an event.
    pub(super) fn take(&mut self, event: &TimedEvent) {
        match &event.event {
            Event::Counted { main, redundant } => {
                let responding = main.saturating_add(*redundant);
                self.look(Sample { is_up: self.before.is_up || responding > 0, responding, ..self.before });
                self.scan_begun = Some(event.at);
                self.push(Priority::Info, "Scanning bus.".to_owned());
            }
            // Without an application a change of the segment is scanned.
            Event::ScanFinished { .. } | Event::SegmentChanged { .. } => {
                if let Some(begun) = self.scan_begun.take() {
                    let time = event.at.since(begun).as_millis();
                    self.push(Priority::Info, format!("Bus scanning completed in {time} ms."));
                }
            }
            Event::ScanFailed { reason } => self.push(Priority::Error, format!("Bus scanning failed: {reason}")),
            Event::ConfigurationFailed { subdevice, reason } => {
                self.push(Priority::Error, format!("Slave configuration {} failed: {reason}", subdevice.0));
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
                    let text = format!("Domain {number}: Working counter changed to {}/{}.", now.0, now.1);
                    self.push(Priority::Info, text);
                }
            }
            Event::Skipped { .. } => self.skipped += 1,
            _ => {}
        }
    }

    /// A second is over.
    pub(super) fn summarise(&mut self, now: Counts) {
        let before = std::mem::replace(&mut self.counts, now);
        let skipped = std::mem::take(&mut self.skipped);
        let sums = [
            (now.timed_out.saturating_sub(before.timed_out), "TIMED OUT"),
            (now.unmatched.saturating_sub(before.unmatched), "UNMATCHED"),
            (skipped, "SKIPPED"),
        ];
        for (count, what) in sums.into_iter().filter(|(count, _)| *count > 0) {
            let plural = if count == 1 { "" } else { "s" };
            self.push(Priority::Warning, format!("WARNING: {count} datagram{plural} {what}!"));
        }
        for (number, counter) in &mut self.domains {
            let (changes, (wkc, expected)) = (std::mem::take(&mut counter.changes), counter.now);
            counter.is_shown = changes > 0;
            if changes > 0 {
                let plural = if changes == 1 { "" } else { "s" };
                let text = format!("Domain {number}: {changes} working counter change{plural} - now {wkc}/{expected}.");
                self.lines.push((Priority::Info, text));
            }
        }
    }

    /// Takes messages of the debug level, and how many there were beside them.
    pub(super) fn debug(&mut self, messages: impl Iterator<Item = String>, left_out: u64) {
        self.lines.extend(messages.map(|text| (Priority::Debug, text)));
        if left_out > 0 {
            self.push(Priority::Debug, format!("{left_out} messages were left out: there were too many."));
        }
    }

    /// Takes the lines that are to be printed.
    pub(super) fn pop(&mut self) -> Vec<Line> {
        std::mem::take(&mut self.lines)
    }
}

#[cfg(test)]
mod tests {
    use ringcat_engine::domain::{DomainId, DomainStatus};

    use super::*;

    fn at(ms: u64, event: Event) -> TimedEvent {
        TimedEvent::new(Instant(ms * 1_000_000), event)
    }

    /// The texts of all lines.
    fn texts(lines: &mut Lines) -> Vec<String> {
        lines.pop().into_iter().map(|(_, text)| text).collect()
    }

    // covers: c-interface, daemon
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
        assert_eq!(texts(&mut lines), wanted);
        lines.look(Sample { is_up: true, responding: 5, al_states: 2 });
        assert_eq!(texts(&mut lines), ["Slave states: PREOP."]);
        lines.take(&at(900, Event::Counted { main: 4, redundant: 0 }));
        lines.take(&at(920, Event::SegmentChanged { subdevices: 4, added: 0, removed: 1 }));
        let wanted = ["Slave(s) responding: 4.", "Scanning bus.", "Bus scanning completed in 20 ms."];
        assert_eq!(texts(&mut lines), wanted);
        lines.look(Sample { is_up: true, responding: 5, al_states: 2 });
        assert_eq!(texts(&mut lines), ["Slave(s) responding: 5."]);
        lines.look(Sample { is_up: true, responding: 5, al_states: 2 });
        (1..SILENT_LOOKS).for_each(|_| lines.look(Sample::default()));
        lines.look(Sample { is_up: true, responding: 5, al_states: 2 });
        assert!(texts(&mut lines).is_empty(), "nothing has changed");
        lines.look(Sample { is_up: true, responding: 5, al_states: 10 });
        (0..SILENT_LOOKS).for_each(|_| lines.look(Sample::default()));
        assert_eq!(
            texts(&mut lines),
            ["Slave states: PREOP, OP.", "Link state changed to DOWN.", "Slave(s) responding: 0."]
        );
    }

    // covers: c-interface, daemon
    #[test]
    fn the_loss_of_a_bus_is_printed_once_with_its_cause() {
        let mut lines = Lines::default();
        lines.own(Ownership::Held, "");
        lines.own(Ownership::TakenBack, "its process was stopped");
        lines.own(Ownership::TakenBack, "its process was stopped");
        let wanted = "The master was taken back by ringcatd: its process was stopped. Calls of this process have no \
                      effect until it is requested again.";
        assert_eq!(texts(&mut lines), [wanted]);
        lines.own(Ownership::Released, "");
        assert!(texts(&mut lines).is_empty());
    }

    // covers: daemon
    #[test]
    fn messages_of_the_debug_level_are_lines_and_what_is_left_out_is_counted() {
        let mut lines = Lines::default();
        lines.debug(["step".to_owned()].into_iter(), 0);
        lines.debug(std::iter::empty(), 7);
        let expected = ["step", "7 messages were left out: there were too many."];
        assert_eq!(lines.pop(), expected.map(|text| (Priority::Debug, text.to_owned())));
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
        assert_eq!(texts(&mut lines), ["Domain 0: Working counter changed to 5/5."]);
        lines.summarise(Counts { timed_out: 7, unmatched: 1 });
        let wanted = [
            "WARNING: 7 datagrams TIMED OUT!",
            "WARNING: 1 datagram UNMATCHED!",
            "WARNING: 4 datagrams SKIPPED!",
            "Domain 0: 3 working counter changes - now 3/5.",
        ];
        assert_eq!(texts(&mut lines), wanted);
        lines.summarise(Counts { timed_out: 7, unmatched: 1 });
        assert!(texts(&mut lines).is_empty());
    }
}
