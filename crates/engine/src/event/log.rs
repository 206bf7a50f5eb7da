//! Events of one half until the application fetches them. The queue is bounded: the oldest are dropped and counted.

use alloc::collections::VecDeque;
use alloc::vec::Vec;

use super::history::History;
use super::{Event, Occupant, TimedEvent};
use ringcat_wire::address::Position;

use crate::time::Instant;

/// Largest number of frames of other MainDevices among them: enough to detect a second MainDevice.
const FOREIGN_KEPT: usize = 8;
/// Events kept until the application fetches them; beyond, the oldest is dropped and counted.
const KEPT: usize = 4096;

/// Events of one half, oldest first.
#[derive(Debug, Default)]
pub struct EventLog {
    events: VecDeque<TimedEvent>,
    foreign: usize,
    dropped: u64,
    history: History,
    occupants: Vec<Occupant>,
}

impl EventLog {
    /// Sets the SubDevices by cabling position.
    pub fn set_occupants(&mut self, occupants: Vec<Occupant>) {
        self.occupants = occupants;
    }

    /// The SubDevices at cabling positions.
    pub fn occupants(&self, positions: [Option<Position>; 2]) -> [Option<Occupant>; 2] {
        positions.map(|position| self.occupants.get(usize::from(position?.0)).copied())
    }

    /// Appends an event, with the SubDevices at the cabling positions that it names.
    pub fn push(&mut self, at: Instant, event: Event) {
        let occupants = self.occupants(event.positions());
        self.push_of(at, event, occupants);
    }

    /// Appends an event with given SubDevices.
    pub fn push_of(&mut self, at: Instant, event: Event, occupants: [Option<Occupant>; 2]) {
        self.history.note(at, &event);
        if matches!(event, Event::ForeignFrame { .. }) {
            if self.foreign >= FOREIGN_KEPT {
                self.dropped += 1;
                return;
            }
            self.foreign += 1;
        }
        if self.events.len() >= KEPT {
            self.pop();
            self.dropped += 1;
        }
        self.events.push_back(TimedEvent { at, event, occupants });
    }

    /// The diagnosis history; its messages do not depend on fetched events.
    pub fn history(&mut self) -> &mut History {
        &mut self.history
    }

    /// Takes the oldest event.
    pub fn pop(&mut self) -> Option<TimedEvent> {
        let event = self.events.pop_front()?;
        if matches!(event.event, Event::ForeignFrame { .. }) {
            self.foreign -= 1;
        }
        Some(event)
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

    #[test]
    fn a_flood_of_foreign_frames_leaves_room_for_other_events() {
        let mut log = EventLog::default();
        for n in 0..100 {
            log.push(Instant(n), Event::ForeignFrame { arrived_on: Link::Main, bytes: alloc::vec![0; 60] });
        }
        log.push(Instant(100), Event::Skipped { domain: DomainId(0) });
        assert_eq!(log.dropped(), 100 - FOREIGN_KEPT as u64);
        let kept: Vec<_> = core::iter::from_fn(|| log.pop()).collect();
        assert_eq!(kept.len(), FOREIGN_KEPT + 1);
        log.push(Instant(101), Event::ForeignFrame { arrived_on: Link::Main, bytes: alloc::vec![0; 60] });
        assert!(log.pop().is_some());
    }

    #[test]
    fn the_log_keeps_the_newest() {
        let mut log = EventLog::default();
        for n in 0..KEPT + 3 {
            log.push(Instant(n as u64), Event::Skipped { domain: DomainId(n) });
        }
        assert_eq!(log.dropped(), 3);
        assert_eq!(log.pop().unwrap().event, Event::Skipped { domain: DomainId(3) });
    }
}
