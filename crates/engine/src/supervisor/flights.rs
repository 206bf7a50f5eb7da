//! Acyclic frames on the wire: packing and sending (`send`), receiving (`receive`).

mod receive;
mod send;

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use ringcat_wire::frame::MAX_FRAME;

use super::flight::Flight;
use crate::link::LinkSet;
use crate::ring::{MAX_IN_FLIGHT, Sequence};
use crate::time::Instant;

/// Frames on the wire at once: enough to fill the wire over the round trip of a thousand SubDevices (2 ms at 123 us a
/// frame), few enough that no frame times out in a full transmit queue.
const WINDOW: usize = 32;
/// Flights are indexed by the lower bits of their sequence number.
const SLOTS: usize = 128;

const _: () = assert!(WINDOW <= MAX_IN_FLIGHT && MAX_IN_FLIGHT <= SLOTS);

pub(crate) struct Flights {
    slots: Vec<Option<Flight>>,
    in_flight: usize,
    /// No deadline is earlier.
    earliest: Instant,
    /// No flight that awaits repeatable replies was sent earlier.
    oldest: Instant,
    /// When the newest frame was sent of which a copy has come back, by the link on which this was sent.
    newest_back: [Instant; 2],
    /// Number of flights that no longer count against the window.
    released: usize,
    sequence: Sequence,
    /// Ended flights, kept for reuse of their memory.
    spare: Vec<Flight>,
    /// The frame being built, then its redundant copy.
    buffer: Box<[u8]>,
}

impl Flights {
    pub(crate) fn new() -> Flights {
        Flights {
            slots: (0..SLOTS).map(|_| None).collect(),
            in_flight: 0,
            earliest: Instant::NEVER,
            oldest: Instant::NEVER,
            newest_back: [Instant::default(); 2],
            released: 0,
            sequence: Sequence::default(),
            spare: Vec::new(),
            buffer: vec![0; MAX_FRAME].into_boxed_slice(),
        }
    }

    /// Number of the last frame.
    pub(super) fn sequence(&self) -> Sequence {
        self.sequence
    }

    /// Takes the number of a frame that is sent beside the flights.
    #[cfg(feature = "standby")]
    pub(super) fn take_sequence(&mut self) -> Sequence {
        self.sequence = self.sequence.next();
        self.sequence
    }

    /// The numbers go on behind this one: no frame is on the wire.
    pub(super) fn go_on_from(&mut self, sequence: Sequence) {
        self.sequence = sequence;
    }

    /// No flight has an earlier deadline; never if there is none. It may be that of an ended flight.
    #[inline]
    pub(super) fn next_deadline(&self) -> Instant {
        if self.in_flight == 0 { Instant::NEVER } else { self.earliest }
    }

    /// A flight begins.
    fn put(&mut self, flight: Flight) {
        self.earliest = self.next_deadline().min(flight.deadline);
        self.oldest = if self.in_flight == 0 { flight.sent_at } else { self.oldest.min(flight.sent_at) };
        let slot = Flights::slot(flight.sequence);
        self.slots[slot] = Some(flight);
        self.in_flight += 1;
    }

    /// Flights have ended or not: determines the earliest deadline, and when the oldest was sent.
    fn find_earliest(&mut self) {
        let flights = self.slots.iter().flatten();
        self.earliest = flights.clone().map(|flight| flight.deadline).min().unwrap_or(Instant::NEVER);
        let repeatable = flights.filter(|flight| flight.awaits_repeatable());
        self.oldest = repeatable.map(|flight| flight.sent_at).min().unwrap_or(Instant::NEVER);
    }

    fn slot(sequence: Sequence) -> usize {
        usize::from(sequence.frame_id()) % SLOTS
    }

    fn has_room(&self) -> bool {
        let room = self.in_flight < MAX_IN_FLIGHT && self.in_flight - self.released < WINDOW;
        room && self.slots[Self::slot(self.sequence.next())].is_none()
    }

    /// Whether copies of frames on the wire may still return, those on silent links excepted.
    pub(super) fn are_under_way(&self, links: LinkSet, silent: u8) -> bool {
        let is_waited_for = |flight: &Flight| !flight.released && flight.missing_links(links) & !silent != 0;
        self.in_flight > self.released && self.slots.iter().flatten().any(is_waited_for)
    }

    fn release(&mut self, slot: usize) {
        if let Some(flight) = self.slots[slot].as_mut().filter(|flight| !flight.released) {
            flight.released = true;
            self.released += 1;
        }
    }

    /// Takes an ending flight from its slot.
    fn take(&mut self, slot: usize) -> Option<Flight> {
        let flight = self.slots[slot].take()?;
        self.in_flight -= 1;
        self.released -= usize::from(flight.released);
        Some(flight)
    }

    fn fresh(&mut self, sequence: Sequence) -> Flight {
        let mut flight = self.spare.pop().unwrap_or_default();
        flight.begin(sequence);
        flight
    }
}
