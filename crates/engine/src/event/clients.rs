//! Clients of events: each has a queue of its own, of a size and with subjects that it chose.
//!
//! A client that does not fetch loses its oldest events and gets their number; it takes nothing from other clients or
//! from the application.

use alloc::collections::VecDeque;
use alloc::vec::Vec;

use super::subject::Subjects;
use super::{Event, TimedEvent};

/// Largest number of clients: each event is copied for each of them.
const MOST_CLIENTS: usize = 64;
/// Largest queue.
const LARGEST_QUEUE: usize = 4096;

/// A client of events. It stays valid until it is removed, also after a stop or an activation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ClientId(u32);

/// The events of a client since it fetched last.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct ClientEvents {
    /// The events, oldest first, with the numbers that all clients see.
    pub events: Vec<TimedEvent>,
    /// Number of events that did not fit. Events that the cyclic half could not keep are counted as well, whatever
    /// their subject.
    pub missed: u64,
}

#[derive(Debug)]
struct Client {
    id: ClientId,
    subjects: Subjects,
    size: usize,
    queue: VecDeque<TimedEvent>,
    missed: u64,
}

/// All clients.
#[derive(Debug, Default)]
pub(super) struct Clients {
    all: Vec<Client>,
    next: u32,
}

impl Clients {
    /// Adds a client with a queue of `size` events, 1 to [`LARGEST_QUEUE`]; `None` if there are [`MOST_CLIENTS`].
    pub fn add(&mut self, subjects: Subjects, size: usize) -> Option<ClientId> {
        if self.all.len() >= MOST_CLIENTS {
            return None;
        }
        let id = ClientId(self.next);
        self.next = self.next.wrapping_add(1);
        let size = size.clamp(1, LARGEST_QUEUE);
        self.all.push(Client { id, subjects, size, queue: VecDeque::new(), missed: 0 });
        Some(id)
    }

    /// Removes a client; false if there is no such client.
    pub fn remove(&mut self, id: ClientId) -> bool {
        let before = self.all.len();
        self.all.retain(|client| client.id != id);
        self.all.len() < before
    }

    /// Sets the subjects of further events.
    pub fn set_subjects(&mut self, id: ClientId, subjects: Subjects) -> bool {
        let client = self.all.iter_mut().find(|client| client.id == id);
        client.map(|client| client.subjects = subjects).is_some()
    }

    /// The events of a client since it fetched last.
    pub fn take(&mut self, id: ClientId) -> Option<ClientEvents> {
        let client = self.all.iter_mut().find(|client| client.id == id)?;
        let missed = core::mem::take(&mut client.missed);
        Some(ClientEvents { events: client.queue.drain(..).collect(), missed })
    }

    /// Events of unknown subjects were lost.
    pub fn miss(&mut self, lost: u64) {
        self.all.iter_mut().for_each(|client| client.missed += lost);
    }

    /// An event that is not kept is counted as missed for clients that have requested its subject.
    pub fn miss_one(&mut self, event: &Event) {
        let subject = event.subject();
        self.all.iter_mut().filter(|client| client.subjects.has(subject)).for_each(|client| client.missed += 1);
    }

    /// Queues an event for each client that asked for its subject.
    pub fn queue(&mut self, event: &TimedEvent) {
        let subject = event.event.subject();
        for client in self.all.iter_mut().filter(|client| client.subjects.has(subject)) {
            if client.queue.len() >= client.size {
                client.queue.pop_front();
                client.missed += 1;
            }
            client.queue.push_back(event.clone());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Event;
    use super::super::subject::Subject;
    use super::*;
    use crate::domain::DomainId;
    use crate::link::Link;
    use crate::time::Instant;

    fn skipped(number: u64) -> TimedEvent {
        TimedEvent { number, ..TimedEvent::new(Instant(number), Event::Skipped { domain: DomainId(0) }) }
    }

    fn numbers(events: &ClientEvents) -> Vec<u64> {
        events.events.iter().map(|event| event.number).collect()
    }

    // covers: jobs
    #[test]
    fn each_client_gets_its_subjects_and_loses_only_its_own_oldest_events() {
        let mut clients = Clients::default();
        let all = clients.add(Subjects::ALL, 3).expect("there is room");
        let links = clients.add(Subjects::NONE.with(Subject::Links), 100).expect("there is room");
        (0..5).for_each(|number| clients.queue(&skipped(number)));
        clients.queue(&TimedEvent { number: 5, ..TimedEvent::new(Instant(5), Event::LinkUp { link: Link::Main }) });
        let events = clients.take(all).expect("it is registered");
        assert_eq!((numbers(&events), events.missed), (alloc::vec![3, 4, 5], 3));
        assert_eq!(clients.take(all), Some(ClientEvents::default()));
        clients.miss(2);
        assert_eq!(clients.take(all), Some(ClientEvents { missed: 2, ..ClientEvents::default() }));
        let events = clients.take(links).expect("it is registered");
        assert_eq!((numbers(&events), events.missed), (alloc::vec![5], 2));
        assert!(clients.set_subjects(links, Subjects::NONE.with(Subject::Domains)));
        clients.queue(&skipped(6));
        assert_eq!(clients.take(links).map(|events| numbers(&events)), Some(alloc::vec![6]));
        assert!(clients.remove(all) && !clients.remove(all) && clients.take(all).is_none());
        assert!(!clients.set_subjects(all, Subjects::ALL));
    }

    #[test]
    fn the_number_of_clients_and_their_queues_are_bounded() {
        let mut clients = Clients::default();
        let ids: Vec<ClientId> = core::iter::from_fn(|| clients.add(Subjects::ALL, usize::MAX)).collect();
        assert_eq!(ids.len(), MOST_CLIENTS);
        (0..LARGEST_QUEUE as u64 + 9).for_each(|number| clients.queue(&skipped(number)));
        let events = clients.take(ids[0]).expect("it is registered");
        assert_eq!((events.events.len(), events.missed), (LARGEST_QUEUE, 9));
        assert!(clients.remove(ids[1]) && clients.add(Subjects::ALL, 0).is_some());
    }
}
