//! What has happened to one of two MainDevices: a line for each event, and counters for the end.

use std::sync::{Arc, OnceLock};

use ringcat::event_log::EventLog;
use ringcat::standby::{RoleCause, StandbyEvent};
use ringcat::text::{Names, describe};
use ringcat::{Event, Instant, MainDeviceRole, SupervisorThread};

use crate::json::standby::Takeover;
use crate::output::{say, write_event};
use crate::run_log::name_of;

/// The events so far.
pub struct EventReport {
    begin: Instant,
    log: EventLog,
    /// Names of the SubDevices, when they are known.
    pub names: Arc<OnceLock<Names>>,
    /// What is counted.
    pub seen: Takeover,
    /// Why the role was not handed over.
    pub refused: Option<String>,
    /// Why this MainDevice last became INACTIVE.
    pub cause: Option<RoleCause>,
    /// How the configuration of the other MainDevice differs.
    pub difference: Option<String>,
    /// SubDevices whose watchdog is too short for a takeover, in words.
    pub short_watchdogs: Vec<String>,
}

impl EventReport {
    /// From this time on.
    pub fn new(begin: Instant) -> EventReport {
        let (log, seen) = (EventLog::new(begin, Names::default()), Takeover::default());
        let (names, short_watchdogs) = (Arc::default(), Vec::new());
        EventReport { begin, log, names, seen, refused: None, cause: None, difference: None, short_watchdogs }
    }

    /// Prints the events since the last call.
    pub fn report(&mut self, supervisor: &SupervisorThread, now: Instant) {
        if self.log.names().0.is_empty()
            && let Some(names) = self.names.get().filter(|names| names.0.iter().any(|name| !name.is_empty()))
        {
            self.log = EventLog::new(self.begin, names.clone());
        }
        while let Some(event) = supervisor.pop_event() {
            let line = match &event.event {
                // Of the other MainDevice; collisions have an event of their own.
                Event::ForeignFrame { .. } => continue,
                Event::Standby(about) => {
                    self.count(about);
                    Some(self.log.line(event.at, &describe(&event, self.log.names())))
                }
                _ => self.log.event(&event),
            };
            let Some(line) = line else { continue };
            say!("{line}");
            let text = describe(&event, self.log.names());
            if matches!(event.event, Event::Standby(StandbyEvent::WatchdogTooShort { .. })) {
                self.short_watchdogs.push(text.clone());
            }
            write_event(event.at.since(self.begin), Some(name_of(&event.event)), &text);
        }
        let before = self.log.line(now, "");
        for line in self.log.counts(now) {
            say!("{line}");
            write_event(now.since(self.begin), None, line.strip_prefix(&before).unwrap_or(&line));
        }
    }

    /// Prints a line that is no event of the MainDevice.
    pub fn say(&self, now: Instant, words: &str) {
        say!("{}", self.log.line(now, words));
        write_event(now.since(self.begin), None, words);
    }

    fn count(&mut self, event: &StandbyEvent) {
        let seen = &mut self.seen;
        match event {
            StandbyEvent::RoleChanged { role, cause } => {
                seen.role_changes += 1;
                if *role == MainDeviceRole::Inactive {
                    self.cause = Some(*cause);
                }
            }
            StandbyEvent::TookOver { is_hot, .. } => {
                seen.takeovers += 1;
                seen.warm_takeovers += u64::from(!is_hot);
            }
            StandbyEvent::Collision { .. } => seen.collisions += 1,
            StandbyEvent::ConfigurationDiffers { what, .. } => {
                seen.configuration_differences += 1;
                self.difference = Some(what.clone());
            }
            StandbyEvent::OtherVersion { got, least } => {
                self.difference = Some(format!("master frames of version {got}, at least {least} was expected"));
            }
            StandbyEvent::HandOverRefused(partner) => {
                self.refused = Some(format!("the other MainDevice refused the role: {partner}"));
            }
            StandbyEvent::NoActive { .. } => seen.alarms += 1,
            StandbyEvent::RoleRefused(write) => self.refused = Some(format!("the role was kept: {write}")),
            _ => {}
        }
    }

    /// What has failed.
    pub fn reasons(&self) -> Vec<String> {
        let mut reasons = Vec::new();
        let mut add = |count: u64, words: &str| {
            if count > 0 {
                reasons.push(format!("{words}: {count}"));
            }
        };
        add(self.seen.collisions, "collisions with another ACTIVE");
        add(self.seen.warm_takeovers, "takeovers through INIT");
        reasons.extend(self.difference.iter().map(|what| format!("the other MainDevice differs: {what}")));
        reasons
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    // covers: standby, REQ010
    #[test]
    fn a_takeover_in_op_holds_and_one_through_init_or_a_difference_does_not() {
        let mut events = EventReport::new(Instant(0));
        let took_over =
            |is_hot| StandbyEvent::TookOver { silence: Some(Duration::ZERO), in_state: 3, is_hot, cut: None };
        events.count(&took_over(true));
        assert_eq!((events.seen.takeovers, events.reasons().len()), (1, 0));
        events.count(&took_over(false));
        events.count(&StandbyEvent::ConfigurationDiffers { item: None, what: "SubDevice 3".to_owned() });
        let expected = ["takeovers through INIT: 1", "the other MainDevice differs: SubDevice 3"];
        assert_eq!(events.reasons(), expected);
    }
}
