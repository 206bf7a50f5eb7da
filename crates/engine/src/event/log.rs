//! Events in the order of their numbers: events that the application has not fetched, and the last fetched ones for
//! clients that were disconnected. The log is bounded: the oldest events are dropped, and dropped events that were not
//! fetched are counted.

use alloc::collections::VecDeque;
use alloc::vec::Vec;

use super::clients::{ClientEvents, ClientId, Clients};
use super::history::History;
use super::messages::Messages;
use super::subject::Subjects;
use super::{Event, Occupant, TimedEvent};
use ringcat_wire::address::{Position, StationAddress};

use crate::time::Instant;

/// Largest number of unfetched frames of other MainDevices: enough to detect a second MainDevice.
const FOREIGN_KEPT: usize = 8;
/// Events kept, fetched or not; beyond, the oldest is dropped.
const KEPT: usize = 4096;

/// The events from a number on, as far as they are kept.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct EventsSince {
    /// Identifies the numbering: another epoch means that the MainDevice began anew, and that all is to be read again.
    pub epoch: u64,
    /// The events, oldest first.
    pub events: Vec<TimedEvent>,
    /// Number of events from that number on that are no longer kept.
    pub missed: u64,
    /// Number of the next event: the number to continue with.
    pub next: u64,
}

/// Events, oldest first.
#[derive(Debug, Default)]
pub struct EventLog {
    epoch: u64,
    kept: VecDeque<TimedEvent>,
    /// Number of events in front that the application has fetched.
    fetched: usize,
    /// Events since the beginning: the number of the next one.
    next: u64,
    foreign: usize,
    dropped: u64,
    history: History,
    occupants: Vec<Occupant>,
    clients: Clients,
    messages: Messages,
}

impl EventLog {
    /// An empty log with a numbering of its own.
    pub fn new(epoch: u64) -> EventLog {
        EventLog { epoch, ..EventLog::default() }
    }

    /// The same events and numbers, without diagnosis history and SubDevices: a session has ended.
    #[must_use]
    pub fn end_session(self) -> EventLog {
        EventLog { history: History::default(), occupants: Vec::new(), ..self }
    }

    /// Sets the SubDevices by cabling position.
    pub fn set_occupants(&mut self, occupants: Vec<Occupant>) {
        self.occupants = occupants;
    }

    /// The SubDevices at cabling positions.
    pub fn occupants(&self, positions: [Option<Position>; 2]) -> [Option<Occupant>; 2] {
        positions.map(|position| self.occupants.get(usize::from(position?.0)).copied())
    }

    /// The SubDevice with a station address, if its position is known.
    pub(crate) fn occupant_at(&self, station: StationAddress) -> Option<Occupant> {
        self.occupants.iter().find(|occupant| occupant.station == station).copied()
    }

    /// Appends an event, with the SubDevices at the cabling positions that it names.
    pub fn push(&mut self, at: Instant, event: Event) {
        let occupants = self.occupants(event.positions());
        self.push_of(at, event, occupants);
    }

    /// Appends an event with given SubDevices.
    pub fn push_of(&mut self, at: Instant, event: Event, occupants: [Option<Occupant>; 2]) {
        self.history.note(at, &event);
        let number = self.next;
        self.next += 1;
        if matches!(event, Event::ForeignFrame { .. }) {
            if self.foreign >= FOREIGN_KEPT {
                self.dropped += 1;
                return;
            }
            self.foreign += 1;
        }
        if self.kept.len() >= KEPT {
            self.drop_oldest();
        }
        let event = TimedEvent { number, at, event, occupants };
        self.clients.queue(&event);
        self.kept.push_back(event);
    }

    /// Messages beside the events.
    pub(crate) fn messages(&mut self) -> &mut Messages {
        &mut self.messages
    }

    /// Adds a client with a queue of its own; `None` if there are too many.
    pub fn add_client(&mut self, subjects: Subjects, size: usize) -> Option<ClientId> {
        self.clients.add(subjects, size)
    }

    /// Removes a client; false if there is no such client.
    pub fn remove_client(&mut self, client: ClientId) -> bool {
        self.clients.remove(client)
    }

    /// Sets the subjects of a client's further events; false if there is no such client.
    pub fn set_client_subjects(&mut self, client: ClientId, subjects: Subjects) -> bool {
        self.clients.set_subjects(client, subjects)
    }

    /// The events of a client since it fetched last; `None` if there is no such client.
    pub fn take_of_client(&mut self, client: ClientId) -> Option<ClientEvents> {
        self.clients.take(client)
    }

    /// Whether there is a client.
    pub fn has_clients(&self) -> bool {
        self.clients.is_any()
    }

    fn drop_oldest(&mut self) {
        if self.fetched == 0 {
            self.pop();
            self.dropped += 1;
        }
        self.kept.pop_front();
        self.fetched = self.fetched.saturating_sub(1);
    }

    /// Events that were lost before they reached the log: their numbers are missing.
    pub fn skip(&mut self, lost: u64) {
        self.next += lost;
    }

    /// The diagnosis history; its messages do not depend on fetched events.
    pub fn history(&mut self) -> &mut History {
        &mut self.history
    }

    /// Takes the oldest unfetched event. It stays in the log for [`EventLog::since`].
    pub fn pop(&mut self) -> Option<TimedEvent> {
        let event = self.kept.get(self.fetched)?.clone();
        self.fetched += 1;
        if matches!(event.event, Event::ForeignFrame { .. }) {
            self.foreign -= 1;
        }
        Some(event)
    }

    /// Number of unfetched events.
    pub fn unfetched(&self) -> usize {
        self.kept.len() - self.fetched
    }

    /// The kept events from a number on, fetched or not. A number beyond the next one gives none.
    pub fn since(&self, number: u64) -> EventsSince {
        let first = self.kept.partition_point(|event| event.number < number);
        let events: Vec<TimedEvent> = self.kept.range(first..).cloned().collect();
        let missed = self.next.saturating_sub(number) - events.len() as u64;
        EventsSince { epoch: self.epoch, events, missed, next: self.next }
    }

    /// Number of events that were dropped because the application did not fetch them.
    pub fn dropped(&self) -> u64 {
        self.dropped
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::DomainId;
    use crate::link::Link;

    fn foreign() -> Event {
        Event::ForeignFrame { arrived_on: Link::Main, bytes: alloc::vec![0; 60] }
    }

    fn skipped(domain: usize) -> Event {
        Event::Skipped { domain: DomainId(domain) }
    }

    #[test]
    fn a_flood_of_foreign_frames_leaves_room_for_other_events() {
        let mut log = EventLog::default();
        for n in 0..100 {
            log.push(Instant(n), foreign());
        }
        log.push(Instant(100), skipped(0));
        assert_eq!(log.dropped(), 100 - FOREIGN_KEPT as u64);
        let kept: Vec<_> = core::iter::from_fn(|| log.pop()).collect();
        assert_eq!(kept.len(), FOREIGN_KEPT + 1);
        assert_eq!(kept.last().map(|event| event.number), Some(100), "dropped events have numbers, too");
        log.push(Instant(101), foreign());
        assert!(log.pop().is_some());
    }

    #[test]
    fn the_log_keeps_the_newest() {
        let mut log = EventLog::default();
        for n in 0..KEPT + 3 {
            log.push(Instant(n as u64), skipped(n));
        }
        assert_eq!(log.dropped(), 3);
        assert_eq!(log.pop().unwrap().event, skipped(3));
    }

    #[test]
    fn events_since_a_number_are_complete_or_say_how_many_are_missing() {
        let mut log = EventLog::new(7);
        let numbers = |since: &EventsSince| since.events.iter().map(|event| event.number).collect::<Vec<_>>();
        assert_eq!(log.since(0), EventsSince { epoch: 7, ..EventsSince::default() });
        (0..5).for_each(|n| log.push(Instant(n), skipped(n as usize)));
        assert_eq!(log.pop().map(|event| event.number), Some(0));
        // Fetched events are among them.
        let all = log.since(0);
        assert_eq!((numbers(&all), all.missed, all.next), (alloc::vec![0, 1, 2, 3, 4], 0, 5));
        log.skip(2);
        log.push(Instant(9), skipped(9));
        let rest = log.since(3);
        assert_eq!((numbers(&rest), rest.missed, rest.next), (alloc::vec![3, 4, 7], 2, 8));
        assert_eq!((log.since(8).missed, log.since(u64::MAX).missed), (0, 0));
        // Beyond the capacity.
        (0..KEPT).for_each(|n| log.push(Instant(10), skipped(n)));
        let rest = log.since(3);
        assert_eq!((rest.events.len(), rest.missed), (KEPT, 5));
        assert_eq!((log.dropped(), log.pop().map(|event| event.number)), (5, Some(8)));
        let log = log.end_session();
        assert_eq!((log.since(0).next, log.since(0).epoch), (8 + KEPT as u64, 7));
    }
}
