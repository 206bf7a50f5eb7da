//! Acyclic frames: packing requests, sending on all links, pairing and merging the copies, answering or giving up.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::Wkc;
use ringcat_wire::command::Command;
use ringcat_wire::datagram::HEADER_LEN;
use ringcat_wire::frame::{FrameBuilder, MAX_FRAME, MIN_FRAME, MacAddress};

use super::Received;
use super::bus::{BusError, Reply};
use super::flight::{Flight, Place};
use super::outbox::Rank;
use super::shared::Shared;
use super::stray::Stray;
use super::transfer::{Stage, TransferId, WITNESS_BYTES};
use crate::link::{Link, LinkSet};
use crate::ring::identity::DATAGRAMS_AT;
use crate::ring::{Class, FrameCopy, Identity, MAX_IN_FLIGHT, Sequence};
use crate::time::Instant;

/// Frames in flight at once: enough to fill the wire over the round trip of a thousand SubDevices (2 ms at 123 us a
/// frame), few enough that a full transmit queue is no reason to give a frame up.
const WINDOW: usize = 32;
/// A lost datagram is sent again so often; the retry index in the source address has three bits (facts SM-04).
pub(super) const MAX_RETRIES: u8 = 7;
/// A datagram that fits no send window goes out after this time all the same, and delays a cycle once.
const STARVED: Duration = Duration::from_millis(10);
/// Flights are found by the lower bits of their sequence number.
const SLOTS: usize = 128;

const _: () = assert!(WINDOW <= MAX_IN_FLIGHT && MAX_IN_FLIGHT <= SLOTS);

pub(crate) struct Flights {
    slots: Vec<Option<Flight>>,
    in_flight: usize,
    /// Of these, those that no longer count against the window.
    released: usize,
    sequence: Sequence,
    /// Flights that ended, for their memory.
    spare: Vec<Flight>,
    /// The redundant copy of the frame that is being sent.
    redundant: Box<[u8]>,
}

impl Flights {
    pub(crate) fn new() -> Flights {
        Flights {
            slots: (0..SLOTS).map(|_| None).collect(),
            in_flight: 0,
            released: 0,
            sequence: Sequence::default(),
            spare: Vec::new(),
            redundant: vec![0; MAX_FRAME].into_boxed_slice(),
        }
    }

    pub(crate) fn next_deadline(&self) -> Option<Instant> {
        if self.in_flight == 0 {
            return None;
        }
        self.slots.iter().flatten().map(|flight| flight.deadline).min()
    }

    fn slot(sequence: Sequence) -> usize {
        usize::from(sequence.frame_id()) % SLOTS
    }

    fn has_room(&self) -> bool {
        let room = self.in_flight < MAX_IN_FLIGHT && self.in_flight - self.released < WINDOW;
        room && self.slots[Self::slot(self.sequence.next())].is_none()
    }

    /// Whether frames are under way of which a copy may still come home, but for those on links that are silent.
    pub(super) fn are_under_way(&self, links: LinkSet, silent: u8) -> bool {
        let is_waited_for = |flight: &Flight| !flight.released && flight.misses(links) & !silent != 0;
        self.in_flight > self.released && self.slots.iter().flatten().any(is_waited_for)
    }

    fn release(&mut self, slot: usize) {
        if let Some(flight) = self.slots[slot].as_mut().filter(|flight| !flight.released) {
            flight.released = true;
            self.released += 1;
        }
    }

    /// Takes a flight that ends from its slot.
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

impl Shared {
    /// Packs what waits in the outbox into frames and sends them, within the budget and the window.
    pub(super) fn transmit(&mut self, budget: usize, transmit: &mut impl FnMut(Link, &[u8])) -> usize {
        let mut used = 0;
        while self.flights.has_room() && used < budget {
            let limit = (budget - used).min(MAX_FRAME);
            let flight = match self.alone.is_held() {
                true => self.next_alone().and_then(|(id, deaf)| self.pack_alone(id, deaf)),
                false if self.outbox.is_ready(self.now) => self.pack(limit),
                false => None,
            };
            let Some(flight) = flight else { break };
            self.blocked = None;
            used += flight.bytes.len();
            self.counters.sent += 1;
            self.counters.bytes += flight.bytes.len() as u64;
            self.counters.datagrams += flight.places.len() as u64;
            self.silence.sent(Link::Main, self.now);
            transmit(Link::Main, &flight.bytes);
            if self.links == LinkSet::Ring {
                self.silence.sent(Link::Redundant, self.now);
                let copy = &mut self.flights.redundant[..flight.bytes.len()];
                copy.copy_from_slice(&flight.bytes);
                Identity::mark_redundant(copy, true);
                adjust_auto_increment(copy, &flight.places, self.main_count);
                for place in &flight.places {
                    let Some(transfer) = self.transfers.find(place.transfer) else { continue };
                    if let Some(station) = transfer.request.redundant_station {
                        let at = place.header_at + 2;
                        copy[at..at + 2].copy_from_slice(&station.0.to_le_bytes());
                    }
                    if let Some(data) = &transfer.request.redundant {
                        let at = place.header_at + HEADER_LEN;
                        copy[at..at + place.length].copy_from_slice(data);
                    }
                }
                transmit(Link::Redundant, copy);
            }
            let slot = Flights::slot(flight.sequence);
            self.flights.slots[slot] = Some(flight);
            self.flights.in_flight += 1;
        }
        used
    }

    /// Whether a first datagram that is too long for the window has waited for so long that it goes out all the same:
    /// it may be too long for every window.
    fn is_starved(blocked: &mut Option<(TransferId, Instant)>, first: TransferId, now: Instant) -> bool {
        let (_, since) = *blocked.insert(blocked.filter(|(id, _)| *id == first).unwrap_or((first, now)));
        now.since(since) >= STARVED
    }

    /// Builds one frame of at most `limit` bytes from the front of the outbox; `None` where nothing fits.
    fn pack(&mut self, limit: usize) -> Option<Flight> {
        let sequence = self.flights.sequence.next();
        let mut flight = self.flights.fresh(sequence);
        flight.bytes.resize(MAX_FRAME, 0);
        let mut retry = 0;
        let length = {
            let source = self.identity.source();
            let mut builder = FrameBuilder::ethernet(&mut flight.bytes, MacAddress::ETHERCAT_GROUP, source)?;
            let (mut total, mut datagrams, mut is_alone) = (DATAGRAMS_AT, 0, false);
            let reads = self.outbox.may_read(self.now);
            while let Some((id, rank)) = self.outbox.front(reads, self.now) {
                let Some(transfer) = self.transfers.find(id) else {
                    self.outbox.pop(rank);
                    continue;
                };
                if transfer.abandoned {
                    self.outbox.pop(rank);
                    self.transfers.remove(id);
                    continue;
                }
                let request = &transfer.request;
                let bytes = request.bytes();
                let fills_up = is_alone || request.before > 0 || datagrams + request.datagrams() > self.max_datagrams;
                if fills_up && !flight.places.is_empty() {
                    break;
                }
                // Only the first datagram of a frame may be longer than the window.
                if (total + bytes).max(MIN_FRAME) > limit
                    && (!flight.places.is_empty() || !Shared::is_starved(&mut self.blocked, id, self.now))
                {
                    break;
                }
                let index = sequence.index(Class::Acyclic);
                if let Some((command, target, lead)) = &request.lead {
                    let Some(at) = builder.datagram(*command, index, *target, lead.len()) else { break };
                    if let Some(data) = builder.data_mut(at, lead.len()) {
                        data.copy_from_slice(lead);
                    }
                }
                is_alone = request.before > 0;
                for _ in 0..request.before {
                    builder.datagram(request.command, index, request.target, request.data.len());
                }
                let Some(data_at) = builder.datagram(request.command, index, request.target, request.data.len()) else {
                    break;
                };
                if let Some(data) = builder.data_mut(data_at, request.data.len()) {
                    data.copy_from_slice(&request.data);
                    request.let_run(data, self.now);
                }
                total += bytes;
                datagrams += request.datagrams();
                retry = retry.max(transfer.retries);
                flight.places.push(Place::new(id, request, data_at));
                transfer.stage = Stage::InFlight;
                self.outbox.pop(rank);
                if rank == Rank::Read {
                    flight.reads += bytes;
                    self.outbox.set_out(bytes);
                }
            }
            builder.finish()
        };
        self.launch(flight, length, retry)
    }

    /// Builds a frame that holds one datagram.
    fn pack_alone(&mut self, id: TransferId, deaf: u8) -> Option<Flight> {
        let sequence = self.flights.sequence.next();
        let mut flight = self.flights.fresh(sequence);
        flight.bytes.resize(MAX_FRAME, 0);
        flight.deaf = deaf;
        let length = {
            let source = self.identity.source();
            let mut builder = FrameBuilder::ethernet(&mut flight.bytes, MacAddress::ETHERCAT_GROUP, source)?;
            let transfer = self.transfers.find(id)?;
            let (request, index) = (&transfer.request, sequence.index(Class::Acyclic));
            let data_at = builder.datagram(request.command, index, request.target, request.data.len())?;
            builder.data_mut(data_at, request.data.len())?.copy_from_slice(&request.data);
            flight.places.push(Place::new(id, request, data_at));
            transfer.stage = Stage::InFlight;
            builder.finish()
        };
        self.launch(flight, length, 0)
    }

    /// A frame of so many bytes is ready to leave; `None` where nothing is in it.
    fn launch(&mut self, mut flight: Flight, length: usize, retry: u8) -> Option<Flight> {
        let sequence = flight.sequence;
        flight.bytes.truncate(length);
        self.identity.stamp(&mut flight.bytes, sequence, retry);
        if flight.places.is_empty() {
            self.flights.spare.push(flight);
            return None;
        }
        self.flights.sequence = sequence;
        flight.sent_at = self.now;
        let (begins, left_at) = self.outbox.hand_over(flight.bytes.len(), self.now);
        flight.left_at = left_at;
        flight.deadline = begins + self.round_trip.wait(retry);
        Some(flight)
    }

    /// Takes in a copy of an acyclic frame.
    pub(super) fn receive(&mut self, copy: FrameCopy, arrived_on: Link, bytes: &[u8]) -> Received {
        self.silence.came_back(copy.sent_on);
        let slot = Flights::slot(copy.sequence);
        let Some(flight) = self.flights.slots[slot].as_mut().filter(|flight| flight.sequence == copy.sequence) else {
            self.round_trip.was_late();
            self.counters.late += 1;
            self.strays.late(copy.sequence, bytes, self.now);
            return Received::Late;
        };
        if !flight.is_what_was_sent(bytes) {
            self.counters.corrupt += 1;
            return Received::Corrupt;
        }
        let first = flight.arrivals.arrived == 0;
        if !flight.arrivals.note(copy.sent_on, arrived_on) {
            self.counters.late += 1;
            return Received::Late;
        }
        self.round_trip.took(self.now.since(flight.sent_at));
        self.outbox.took(self.now.since(flight.left_at));
        for read in flight.second_reads() {
            if let Some(mail) = read.mail(bytes) {
                self.strays.keep(read.station, Stray { mail, sent_at: read.sent_at });
            }
        }
        flight.take(copy.sent_on, bytes, first);
        let finished = flight.has_all(self.links);
        let enough = finished || flight.has_all_but(self.silence.mask(self.now) | flight.deaf, self.links);
        self.answer(slot, enough);
        if finished {
            self.end(slot);
        } else if enough {
            self.flights.release(slot);
        }
        Received::Taken
    }

    /// Hands replies to procedures: those with the expected working counter at once, all when no further copy is
    /// waited for. What was met while the ring changed is lost.
    fn answer(&mut self, slot: usize, enough: bool) {
        let Some(mut flight) = self.flights.slots[slot].take() else { return };
        let straddled = flight.straddled_a_change();
        let stamp = (flight.sequence, flight.sent_at);
        if enough && !straddled {
            self.learn_main_count(&flight);
        }
        for place in flight.places.iter_mut().filter(|place| !place.answered) {
            let satisfied = place.satisfied();
            if !satisfied && !enough {
                continue;
            }
            place.answered = true;
            if satisfied || !straddled {
                let reply = place.reply(&flight.bytes, stamp);
                self.finish(place.transfer, Ok(reply));
            } else {
                self.lost(place.transfer);
            }
        }
        if !flight.answered && flight.places.iter().all(|place| place.answered) {
            flight.answered = true;
            self.counters.received += 1;
            self.outbox.came_back(core::mem::take(&mut flight.reads));
        }
        self.flights.slots[slot] = Some(flight);
    }

    /// A broadcast shows how many SubDevices the main copy meets (facts CR-09).
    fn learn_main_count(&mut self, flight: &Flight) {
        let is_broadcast = |place: &&Place| matches!(place.command, Command::Brd | Command::Bwr);
        // One that no SubDevice has processed shows nothing.
        let met = |place: &&Place| place.total() != Wkc(0);
        if let Some(place) = flight.places.iter().rfind(is_broadcast).filter(met) {
            self.main_count = place.wkc[Link::Main.index()].0;
        }
    }

    fn end(&mut self, slot: usize) {
        let Some(flight) = self.flights.take(slot) else { return };
        self.monitor.observe(flight.arrivals);
        self.flights.spare.push(flight);
    }

    pub(super) fn finish(&mut self, id: TransferId, result: Result<Reply, BusError>) {
        let result = self.judge_alone(id, result);
        let Some(transfer) = self.transfers.find(id) else { return };
        if transfer.abandoned {
            self.transfers.remove(id);
            return;
        }
        transfer.stage = Stage::Done(result);
        let task = transfer.task;
        self.wake(task);
    }

    /// Gives up flights whose deadline is over.
    pub(super) fn expire_flights(&mut self) {
        if self.flights.in_flight == 0 {
            return;
        }
        for slot in 0..SLOTS {
            let overdue = |flight: &Flight| flight.deadline <= self.now;
            if self.flights.slots[slot].as_ref().is_some_and(overdue) {
                self.expire(slot);
            }
        }
    }

    /// Datagrams that one copy answered as expected are done, and those to one SubDevice that has answered (CR-06); the
    /// others count as lost: the copy that is missing may have been the one that reached the SubDevice.
    fn expire(&mut self, slot: usize) {
        let Some(flight) = self.flights.take(slot) else { return };
        self.monitor.observe(flight.arrivals);
        self.outbox.came_back(flight.reads);
        flight.mail_reads().for_each(|read| self.strays.remember(read));
        if !flight.answered {
            if flight.arrivals.arrived == 0 {
                self.counters.lost += 1;
            } else {
                self.counters.half += 1;
            }
            let enough = flight.has_all_but(self.silence.mask(self.now), self.links);
            if enough {
                self.learn_main_count(&flight);
            }
            for place in flight.places.iter().filter(|place| !place.answered) {
                if enough || (place.is_answered_by_one() && !self.is_apart(place.transfer)) {
                    let reply = place.reply(&flight.bytes, (flight.sequence, flight.sent_at));
                    self.finish(place.transfer, Ok(reply));
                } else {
                    self.lost(place.transfer);
                }
            }
        }
        self.flights.spare.push(flight);
    }

    /// Whether the copies of a datagram say different things, so that none can stand for the other.
    fn is_apart(&mut self, id: TransferId) -> bool {
        let transfer = self.transfers.find(id);
        transfer.is_some_and(|it| it.request.redundant.is_some() || it.request.redundant_station.is_some())
    }

    fn lost(&mut self, id: TransferId) {
        let Some(transfer) = self.transfers.find(id) else { return };
        if transfer.request.resend && transfer.retries < MAX_RETRIES && !transfer.abandoned {
            transfer.retries += 1;
            transfer.stage = Stage::Queued;
            self.counters.resent += 1;
            let target = transfer.request.target;
            self.outbox.push(id, Rank::First, target, 0, self.now);
            return;
        }
        let error = BusError::Lost { target: transfer.request.target, retries: transfer.retries };
        self.counters.timed_out += 1;
        self.finish(id, Err(error));
    }
}

/// In an open ring the SubDevice at position `p` behind the break is the one at `p - main_count` on the redundant link;
/// in a closed one nobody is addressed twice (facts CR-09).
fn adjust_auto_increment(frame: &mut [u8], places: &[Place], main_count: u16) {
    for place in places {
        if !matches!(place.command, Command::Aprd | Command::Apwr | Command::Aprw | Command::Armw) {
            continue;
        }
        let witness = place.witness.then(|| place.header_at - WITNESS_BYTES);
        for at in [Some(place.header_at), witness].into_iter().flatten() {
            let adp = at + 2;
            let shifted = u16::from_le_bytes([frame[adp], frame[adp + 1]]).wrapping_add(main_count);
            frame[adp..adp + 2].copy_from_slice(&shifted.to_le_bytes());
        }
    }
}
