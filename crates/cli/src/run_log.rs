//! What happens while cycles run, in lines: the condensed log of the library, and warnings about frames of other
//! MainDevices.

use ringcat::event_log::EventLog;
use ringcat::{CyclicThread, Instant, Links};

use crate::surroundings::Surroundings;

/// What is shown.
#[derive(Debug)]
pub enum Shown {
    /// Something that happened, with its time.
    Line(String),
    /// Something that the user should do something about.
    Warning(String),
}

/// The log of a run.
pub struct RunLog {
    events: EventLog,
    surroundings: Surroundings,
}

impl RunLog {
    /// A log over this one.
    pub fn new(events: EventLog, surroundings: Surroundings) -> RunLog {
        RunLog { events, surroundings }
    }

    /// The log of events.
    pub fn events(&self) -> &EventLog {
        &self.events
    }

    /// What was noticed around the segment.
    pub fn surroundings(&self) -> &Surroundings {
        &self.surroundings
    }

    /// Shows what has happened since the last call.
    pub fn news<L: Links + Send>(&mut self, cycles: &CyclicThread<L>, now: Instant, mut show: impl FnMut(Shown)) {
        let RunLog { events, surroundings } = self;
        if let Some((link, source)) = cycles.news().foreign() {
            surroundings.note_sender(link, source).map(Shown::Warning).into_iter().for_each(&mut show);
        }
        while let Some(event) = cycles.supervisor().pop_event() {
            match surroundings.note(&event.event) {
                Some(words) => words.map(Shown::Warning).into_iter().for_each(&mut show),
                None => events.event(&event).map(Shown::Line).into_iter().for_each(&mut show),
            }
        }
        events.left_out(cycles.news().pace().skipped, now).map(Shown::Line).into_iter().for_each(&mut show);
        events.counts(now).into_iter().map(Shown::Line).for_each(&mut show);
    }
}
