//! What happens while cycles run: the condensed log of the library, and warnings about frames of other MainDevices.

use std::time::Duration;

use ringcat::config::ObjectNames;
use ringcat::event_log::EventLog;
use ringcat::text::describe;
use ringcat::{CyclicThread, Event, Instant, Links};

use crate::surroundings::Surroundings;

/// What is shown.
#[derive(Debug)]
pub enum Shown {
    /// Something that happened.
    Event {
        /// The line for people, with the time.
        line: String,
        /// Time since the beginning.
        time: Duration,
        /// The variant of [`Event`]; `None` for a count of many.
        name: Option<String>,
        /// The words without the time.
        text: String,
    },
    /// Something that the user should act on.
    Warning(String),
}

/// The log of a run.
pub struct RunLog {
    begin: Instant,
    events: EventLog,
    surroundings: Surroundings,
    /// Names of the objects of each declared SubDevice.
    objects: Vec<ObjectNames>,
}

impl RunLog {
    /// A log over this one, whose times count from `begin`.
    pub fn new(begin: Instant, events: EventLog, surroundings: Surroundings) -> RunLog {
        RunLog { begin, events, surroundings, objects: Vec::new() }
    }

    /// The same with the names of the objects of each declared SubDevice.
    pub fn with_objects(self, objects: Vec<ObjectNames>) -> RunLog {
        RunLog { objects, ..self }
    }

    /// The log of events.
    pub fn events(&self) -> &EventLog {
        &self.events
    }

    /// What was noticed around the segment.
    pub fn surroundings(&self) -> &Surroundings {
        &self.surroundings
    }

    /// Words that are no event of the MainDevice.
    pub fn words(&self, at: Instant, text: &str) -> Shown {
        let (line, time) = (self.events.line(at, text), at.since(self.begin));
        Shown::Event { line, time, name: None, text: text.to_owned() }
    }

    /// Shows what has happened since the last call.
    pub fn report<L: Links + Send>(&mut self, cycles: &CyclicThread<L>, now: Instant, mut show: impl FnMut(Shown)) {
        let RunLog { begin, events, surroundings, objects } = self;
        if let Some((link, source)) = cycles.cyclic_status().foreign() {
            surroundings.note_sender(link, source).map(Shown::Warning).into_iter().for_each(&mut show);
        }
        while let Some(event) = cycles.supervisor().pop_event() {
            match surroundings.note(&event.event) {
                Some(words) => words.map(Shown::Warning).into_iter().for_each(&mut show),
                None => {
                    let Some(line) = events.event(&event) else { continue };
                    let (time, text) = (event.at.since(*begin), describe(&event, events.names()));
                    let [line, text] = with_objects(&event.event, objects, [line, text]);
                    show(Shown::Event { line, time, name: Some(name_of(&event.event)), text });
                }
            }
        }
        let counts = events.left_out(cycles.cyclic_status().pace().skipped, now).into_iter().chain(events.counts(now));
        let before = events.line(now, "");
        for line in counts {
            let text = line.strip_prefix(&before).unwrap_or(&line).to_owned();
            show(Shown::Event { line, time: now.since(*begin), name: None, text });
        }
    }
}

/// Texts of an event with the names of the objects that it mentions.
fn with_objects(event: &Event, objects: &[ObjectNames], texts: [String; 2]) -> [String; 2] {
    let (Event::ConfigurationFailed { subdevice, .. }
    | Event::DeclarationWarning { subdevice, .. }
    | Event::StartupRead { subdevice, .. }) = event
    else {
        return texts;
    };
    match objects.get(subdevice.0) {
        Some(names) => texts.map(|text| names.annotate(&text)),
        None => texts,
    }
}

/// The variant of an event; of one about the other MainDevice that of [`Event::Standby`].
pub fn name_of(event: &Event) -> String {
    #[cfg(feature = "standby")]
    if let Event::Standby(event) = event {
        return variant(event);
    }
    variant(event)
}

fn variant(event: &impl std::fmt::Debug) -> String {
    let text = format!("{event:?}");
    text.chars().take_while(char::is_ascii_alphanumeric).collect()
}

#[cfg(test)]
mod tests {
    use ringcat::SubDeviceId;
    use ringcat::config::network::model::{Entry, Pdo, SubDevice, SyncManager};

    use super::*;

    // covers: json
    #[test]
    fn an_event_is_named_by_its_variant() {
        assert_eq!(name_of(&Event::ScanFinished { subdevices: 3 }), "ScanFinished");
        assert_eq!(name_of(&Event::InterfacesSwapped), "InterfacesSwapped");
    }

    // covers: esi-use
    #[test]
    fn an_object_that_a_subdevice_refuses_is_named_with_its_name() {
        let names = |name: &str| {
            let entry = Entry { index: 0x6060, name: name.to_owned(), ..Entry::default() };
            let pdo = Pdo { index: 0x1600, entries: Some(vec![entry]), ..Pdo::default() };
            let sync_manager = SyncManager { pdo: vec![pdo], ..SyncManager::default() };
            let mut names = ObjectNames::default();
            names.add_declared(&SubDevice { sync_manager: vec![sync_manager], ..SubDevice::default() });
            names
        };
        let objects = [names("of another"), names("Modes of operation")];
        let text = "SubDevice 1: start-up command 0: SDO 0x6060:00 refused".to_owned();
        let event = Event::ConfigurationFailed { subdevice: SubDeviceId(1), reason: String::new() };
        let [line, named] = with_objects(&event, &objects, [format!("1 ms  {text}"), text.clone()]);
        assert!(named.contains("0x6060:00 \"Modes of operation\" refused") && line.ends_with(&named), "{line}");
        let other = Event::Lost { subdevice: SubDeviceId(1) };
        assert_eq!(with_objects(&other, &objects, [text.clone(), text.clone()]), [text.clone(), text]);
    }
}
