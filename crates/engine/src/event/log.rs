//! Events in the order of their numbers: events that the application has not fetched, and the last fetched ones for
//! clients that were disconnected. The log is bounded: the oldest events are dropped, and dropped events that were not
//! fetched are counted.

use alloc::collections::{VecDeque, vec_deque};
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
/// Number of events of the cyclic half beyond which a full log drops the oldest of these, and no event of the acyclic
/// half.
const CYCLIC_KEPT: usize = KEPT / 4;

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

/// Kept events of one half, oldest first.
#[derive(Debug, Default)]
struct Kept {
    events: VecDeque<TimedEvent>,
    /// Number of events in front that the application has fetched.
    fetched: usize,
}

impl Kept {
    /// The numbers of the oldest event and of the oldest event that was not fetched; `u64::MAX` if there is none.
    fn fronts(&self) -> [u64; 2] {
        [0, self.fetched].map(|at| self.events.get(at).map_or(u64::MAX, |event| event.number))
    }

    fn from(&self, number: u64) -> vec_deque::Iter<'_, TimedEvent> {
        self.events.range(self.events.partition_point(|event| event.number < number)..)
    }

    /// Drops the oldest event; returns it if it was not fetched.
    fn drop_oldest(&mut self) -> Option<TimedEvent> {
        let oldest = self.events.pop_front();
        match self.fetched {
            0 => oldest,
            _ => {
                self.fetched -= 1;
                None
            }
        }
    }
}

/// Events of both halves. A fault that causes an event in each cycle does not displace all other events.
#[derive(Debug, Default)]
pub struct EventLog {
    epoch: u64,
    acyclic: Kept,
    cyclic: Kept,
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
        self.append(at, event, occupants, false);
    }

    /// Appends an event of the cyclic half.
    pub fn push_cyclic(&mut self, at: Instant, event: Event) {
        let occupants = self.occupants(event.positions());
        self.append(at, event, occupants, true);
    }

    fn append(&mut self, at: Instant, event: Event, occupants: [Option<Occupant>; 2], is_cyclic: bool) {
        self.history.note(at, &event);
        let number = self.next;
        self.next += 1;
        if matches!(event, Event::ForeignFrame { .. }) {
            if self.foreign >= FOREIGN_KEPT {
                self.dropped += 1;
                self.clients.miss_one(&event);
                return;
            }
            self.foreign += 1;
        }
        if self.acyclic.events.len() + self.cyclic.events.len() >= KEPT {
            self.drop_oldest(is_cyclic);
        }
        let event = TimedEvent { number, at, event, occupants };
        self.clients.queue(&event);
        let kept = if is_cyclic { &mut self.cyclic } else { &mut self.acyclic };
        kept.events.push_back(event);
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

    /// Drops the oldest event; the oldest event of the cyclic half if that half would exceed [`CYCLIC_KEPT`] with the
    /// next event.
    fn drop_oldest(&mut self, is_next_cyclic: bool) {
        let [acyclic, cyclic] = [&self.acyclic, &self.cyclic].map(|kept| kept.fronts()[0]);
        let is_crowded = self.cyclic.events.len() + usize::from(is_next_cyclic) > CYCLIC_KEPT;
        let kept = if is_crowded || cyclic < acyclic { &mut self.cyclic } else { &mut self.acyclic };
        if let Some(unfetched) = kept.drop_oldest() {
            self.foreign -= usize::from(matches!(unfetched.event, Event::ForeignFrame { .. }));
            self.dropped += 1;
        }
    }

    /// Events that were lost before they reached the log: they get numbers, and the log has a gap there.
    pub fn skip(&mut self, lost: u64) {
        self.next += lost;
        self.dropped += lost;
        self.clients.miss(lost);
    }

    /// The diagnosis history; its messages do not depend on fetched events.
    pub fn history(&mut self) -> &mut History {
        &mut self.history
    }

    /// Takes the oldest unfetched event. It stays in the log for [`EventLog::since`].
    pub fn pop(&mut self) -> Option<TimedEvent> {
        let [acyclic, cyclic] = [&self.acyclic, &self.cyclic].map(|kept| kept.fronts()[1]);
        let kept = if cyclic < acyclic { &mut self.cyclic } else { &mut self.acyclic };
        let event = kept.events.get(kept.fetched)?.clone();
        kept.fetched += 1;
        if matches!(event.event, Event::ForeignFrame { .. }) {
            self.foreign -= 1;
        }
        Some(event)
    }

    /// The kept events from a number on, fetched or not. A number beyond the next one gives none.
    pub fn since(&self, number: u64) -> EventsSince {
        let [mut acyclic, mut cyclic] = [&self.acyclic, &self.cyclic].map(|kept| kept.from(number).peekable());
        let events: Vec<TimedEvent> = core::iter::from_fn(|| {
            let [of_acyclic, of_cyclic] =
                [&mut acyclic, &mut cyclic].map(|kept| kept.peek().map_or(u64::MAX, |event| event.number));
            if of_cyclic < of_acyclic { cyclic.next() } else { acyclic.next() }.cloned()
        })
        .collect();
        let missed = self.next.saturating_sub(number) - events.len() as u64;
        EventsSince { epoch: self.epoch, events, missed, next: self.next }
    }

    /// Number of events that were dropped because the application did not fetch them, and of those that were lost
    /// before they reached the log.
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
    fn a_client_learns_how_many_foreign_frames_it_missed_in_a_flood() {
        let mut log = EventLog::default();
        let all = log.add_client(Subjects::ALL, 200).expect("there is room");
        let others = log.add_client(Subjects::ALL.without(foreign().subject()), 200).expect("there is room");
        (0..100).for_each(|n| log.push(Instant(n), foreign()));
        let of_all = log.take_of_client(all).expect("it is there");
        assert_eq!((of_all.events.len(), of_all.missed), (FOREIGN_KEPT, 100 - FOREIGN_KEPT as u64));
        assert_eq!(log.take_of_client(others), Some(ClientEvents::default()));
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
    fn a_flood_of_cyclic_events_leaves_the_others_and_the_newest_of_its_own() {
        let mut log = EventLog::default();
        (0..100).for_each(|n| log.push(Instant(n), skipped(0)));
        (0..2 * KEPT).for_each(|n| log.push_cyclic(Instant(100), skipped(n)));
        (0..50).for_each(|n| log.push(Instant(n), skipped(0)));
        let since = log.since(0);
        let of_cyclic = since.events.iter().filter(|event| event.at == Instant(100)).count();
        assert_eq!((since.events.len(), of_cyclic, since.next), (KEPT, KEPT - 150, 150 + 2 * KEPT as u64));
        assert!(since.events.is_sorted_by_key(|event| event.number), "events of both halves are in order");
        assert_eq!((since.missed, log.dropped()), (since.next - KEPT as u64, since.next - KEPT as u64));
        (0..2 * KEPT).for_each(|n| log.push(Instant(n as u64), skipped(0)));
        (0..2 * KEPT).for_each(|n| log.push_cyclic(Instant(100), skipped(n)));
        let fetched: Vec<TimedEvent> = core::iter::from_fn(|| log.pop()).collect();
        let of_cyclic = fetched.iter().filter(|event| event.at == Instant(100)).count();
        assert_eq!((fetched.len(), of_cyclic), (KEPT, CYCLIC_KEPT));
        assert!(fetched.is_sorted_by_key(|event| event.number));
        assert_eq!(fetched.last().map(|event| event.number + 1), Some(log.since(0).next));
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
        assert_eq!((log.dropped(), log.pop().map(|event| event.number)), (7, Some(8)), "two were lost, five dropped");
        let log = log.end_session();
        assert_eq!((log.since(0).next, log.since(0).epoch), (8 + KEPT as u64, 7));
    }
}
