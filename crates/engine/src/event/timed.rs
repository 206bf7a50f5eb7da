//! Events with their times and numbers.

use super::{Event, Occupant};
use crate::time::Instant;

/// An event with its time.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct TimedEvent {
    /// Its number: events are numbered from 0 in the order in which the engine reports them. A jump means that events
    /// in between were not kept.
    pub number: u64,
    /// The `now` of the call in which the engine detected it.
    pub at: Instant,
    /// What happened.
    pub event: Event,
    /// The SubDevices at the cabling positions that the event names, if known, at that time; for a cable: at its near
    /// end, and at its far end.
    pub occupants: [Option<Occupant>; 2],
}

impl TimedEvent {
    /// An event without SubDevices at cabling positions, with number 0.
    pub const fn new(at: Instant, event: Event) -> TimedEvent {
        TimedEvent { number: 0, at, event, occupants: [None; 2] }
    }

    /// The same event with the SubDevices at its cabling positions.
    #[must_use]
    pub const fn with_occupants(mut self, occupants: [Option<Occupant>; 2]) -> TimedEvent {
        self.occupants = occupants;
        self
    }
}
