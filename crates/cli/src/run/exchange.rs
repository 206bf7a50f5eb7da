//! The exchange of process data: until all SubDevices are in OP, and then until its end, with the events meanwhile.

use std::thread::sleep;
use std::time::Duration;

use ringcat::{CyclicThread, DomainId, DomainState, Instant, SubDeviceState};

use super::live::{self, Live};
use super::pace::Seen;
use super::services::RunServices;
use super::watched::Watched;
use crate::access::WireLinks;
use crate::ending::EndRequest;
use crate::interfaces::now;
use crate::output::{say, warn, write_event};
use crate::recording::Recording;
use crate::run_log::{RunLog, Shown};
use crate::times::in_words;

/// From OP to complete process data at the most, before incomplete process data is reported.
const COMPLETE_LIMIT: Duration = Duration::from_secs(1);
/// Pause between two checks of the threads.
const CHECK_PAUSE: Duration = Duration::from_millis(1);

/// Cycles that run, and what is printed about them.
pub struct Run {
    pub cycles: CyclicThread<WireLinks>,
    pub log: RunLog,
    pub live: Live,
    /// Distributed clocks are in use.
    pub clocks: bool,
    /// Number of domains.
    pub domains: usize,
    pub services: RunServices,
    /// Variables of a file.
    pub watched: Watched,
    pub recording: Recording,
}

impl Run {
    /// Prints what has happened since the last call.
    fn report_events(&mut self) {
        self.log.report(&self.cycles, now(), |shown| {
            self.live.clear();
            print(shown);
        });
        for words in self.services.lines().into_iter().chain(self.recording.failure()) {
            self.live.clear();
            warn(words);
        }
        for line in self.watched.changes(now()) {
            self.live.clear();
            say!("{line}");
            if let Shown::Event { time, text, .. } = self.log.words(now(), &line) {
                write_event(time, None, &text);
            }
        }
    }

    /// Whether all clocks are locked, where there are any.
    fn clocks_locked(&self) -> bool {
        let supervisor = self.cycles.supervisor();
        !self.clocks
            || supervisor.clocks_locked().unwrap_or(false)
            || supervisor.clocks().is_ok_and(|clocks| clocks.is_empty())
    }

    /// Until all SubDevices are in OP and all clocks are locked, and then until process data is complete, for a moment.
    ///
    /// # Errors
    /// Why that does not come, in words.
    pub fn reach_op(&mut self, limit: Duration, end: &EndRequest) -> Result<(), String> {
        let until = now() + limit;
        end.limit(until);
        let (mut in_op, mut complete_until) = (false, until);
        while !in_op || (!self.is_complete() && now() < complete_until) {
            if let Some(by) = end.by() {
                self.live.clear();
                return Err(format!("ended by {by} before all SubDevices were in OP"));
            }
            if self.cycles.has_ended() {
                return Err("the cycles ended before all SubDevices were in OP".to_owned());
            }
            if !in_op && now() >= until {
                self.report_events();
                self.live.clear();
                self.print_states(limit);
                return Err(self.what_is_missing(limit));
            }
            self.report_events();
            if !in_op && self.cycles.supervisor().all_settled() && self.clocks_locked() {
                (in_op, complete_until) = (true, now() + COMPLETE_LIMIT);
            }
            self.live.show(now(), self.cycles.cyclic_status(), self.cycles.supervisor(), self.log.events().names());
            sleep(CHECK_PAUSE);
        }
        let reached = now();
        self.report_events();
        self.live.clear();
        print(self.log.words(reached, "all SubDevices are in OP"));
        for words in self.incomplete() {
            print(self.log.words(reached, &format!("process data is not exchanged as declared: {words}")));
        }
        self.cycles.cyclic_status().restart_histograms();
        Ok(())
    }

    /// Domains whose last cycle was not complete, in words.
    pub fn incomplete(&self) -> Vec<String> {
        let status = |domain| Some((domain, self.cycles.cyclic_status().status(DomainId(domain)).ok()?));
        let statuses = (0..self.domains).filter_map(status);
        let incomplete = statuses.filter(|(_, status)| status.state != DomainState::Complete);
        incomplete
            .map(|(domain, status)| {
                let (wkc, expected) = (status.wkc, status.expected);
                format!("domain {domain}: {}, working counter {wkc} of {expected}", status.in_words())
            })
            .collect()
    }

    fn is_complete(&self) -> bool {
        self.incomplete().is_empty()
    }

    /// The reason why OP was not reached.
    fn what_is_missing(&self, limit: Duration) -> String {
        let limit = in_words(limit);
        let states = self.cycles.supervisor().states();
        let late = states.iter().filter(|state| !matches!(state, SubDeviceState::Settled(_))).count();
        if late == 0 {
            return format!("not all clocks are locked within {limit}");
        }
        let mut words = format!("{} of {} SubDevices not in OP within {limit}", late, states.len());
        // A cycle that is shorter than the round trip keeps SubDevices from OP: no frame comes back in time.
        if let Some(pace) = Seen::of(self.cycles.cyclic_status()).cycle_time_not_kept(&Seen::default()) {
            words += &format!("; {pace}");
        }
        words
    }

    fn print_states(&self, limit: Duration) {
        let what = if self.clocks_locked() { "reached OP" } else { "reached OP with all clocks locked" };
        say!("not all SubDevices {what} within {}:", in_words(limit));
        for (subdevice, state) in self.cycles.supervisor().states().iter().enumerate() {
            let state = live::word(*state);
            let name = self.log.events().names().0.get(subdevice).map_or("", String::as_str);
            say!("  SubDevice {subdevice} \"{name}\": {state}");
        }
        let clocks = self.cycles.supervisor().clocks().unwrap_or_default();
        for clock in clocks.iter().filter(|clock| clock.is_awaited()) {
            let difference = clock.difference_ns.map_or_else(|| "unknown".to_owned(), |ns| format!("{ns} ns"));
            let name = clock.subdevice.and_then(|subdevice| self.log.events().names().0.get(subdevice.0));
            let name = name.map_or_else(String::new, |name| format!(" \"{name}\""));
            let position = clock.position;
            say!("  the clock of position {position}{name} is not locked: its difference is {difference}");
        }
    }

    /// Prints events of the exchange, until a time or a request to end.
    pub fn exchange(&mut self, until: Instant, end: &EndRequest) {
        end.limit(until);
        while now() < until && !end.is_asked() && !self.cycles.has_ended() {
            self.report_events();
            self.live.show(now(), self.cycles.cyclic_status(), self.cycles.supervisor(), self.log.events().names());
            sleep(CHECK_PAUSE.min(until.since(now())));
        }
        self.report_events();
        self.live.clear();
    }
}

/// Prints an event, as a line for people or of JSON, or a warning.
fn print(shown: Shown) {
    match shown {
        Shown::Event { line, time, name, text } => {
            say!("{line}");
            write_event(time, name, &text);
        }
        Shown::Warning(words) => warn(words),
    }
}
