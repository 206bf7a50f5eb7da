//! The cyclic half: process data and one supervision datagram.
//!
//! One cycle of the application: [`Exchange::receive`] for every received frame, [`Exchange::process`] for each domain,
//! work on the images, [`Exchange::queue`] for each domain that is due, [`Exchange::send`]. None of them allocates,
//! locks or waits; the work is bounded by the layout planned at activation.
//!
//! A flight (one round trip of a frame) ends when its working counters are as expected, when all its copies are
//! received, or at its deadline. Inputs are delivered as copies arrive, per SubDevice: see `place`.
//!
//! Each step has a fast path for the usual cycle: one frame on one link that returns with the results of the frame
//! before. Only the fast path is inlined (bins `cycle`, `socket_cycle`).

mod access;
mod again;
mod clocks;
pub mod copy;
pub mod counters;
pub mod domain;
pub mod entry;
mod evidence;
mod flight;
#[cfg(feature = "standby")]
pub(crate) mod following;
pub mod foreign;
mod image;
mod leaving;
#[cfg(feature = "standby")]
mod master_frames;
mod missed;
mod only_frame;
mod outcome;
mod place;
mod presence;
mod proved;
mod ready;
mod round_trip;
mod send_service;
mod service;
mod shares;
#[cfg(not(feature = "standby"))]
#[path = "exchange/no_standby.rs"]
mod standby;
#[cfg(feature = "standby")]
mod standby;
mod template;
mod tries;
mod usual;
mod words;

use alloc::sync::Arc;
use alloc::vec::Vec;
use core::ops::Range;

pub use clocks::{ClockDatagrams, ClockSetup, ReferenceTime};
pub use copy::{CopyError, CopyId, CopyRule, WhenStale};
pub use counters::CyclicCounters;
pub use domain::Domain;
pub use entry::Entry;
pub use foreign::ForeignFrame;
#[cfg(feature = "standby")]
pub use standby::PartnerMemory;
#[cfg(feature = "standby")]
pub use standby::state::StandbySetup;

use crate::board::Board;
use crate::domain::{DomainId, DomainState, DomainStatus};
use crate::event::CyclicEvent;
use crate::layout::Layout;
use crate::link::{Link, LinkSet};
use crate::queue::Producer;
use crate::ring::{Class, Classified, Identity, Sequence};
use crate::time::Instant;
use again::Again;
use copy::Copies;
use counters::Tally;
use evidence::Evidence;
use flight::{CyclicFrame, Step};
use foreign::ForeignFrames;
use image::InputNumber;
use leaving::{Leaving, send_twice};
use missed::{Missed, give_up_overdue};
use service::Service;
use shares::Shares;
#[cfg(not(feature = "standby"))]
use standby::Standby;
#[cfg(feature = "standby")]
use standby::state::Standby;

/// Id that no frame has.
const NO_FRAME: u16 = u16::MAX;

/// Classification of a frame handed to [`Exchange::receive`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Received {
    /// A copy of a frame that is in flight.
    Taken,
    /// A frame of this MainDevice that was given up, or a copy that was received before.
    Late,
    /// A frame of this MainDevice with other datagrams than were sent.
    Corrupt,
    /// A frame of the acyclic half.
    Acyclic,
    /// A frame of another MainDevice; kept for [`Exchange::pop_foreign`].
    Foreign,
    /// Not an EtherCAT frame.
    Other,
}

/// The cyclic half of the MainDevice.
#[derive(Debug)]
pub struct Exchange {
    identity: Identity,
    links: LinkSet,
    board: Arc<Board>,
    events: Producer,
    sequence: Sequence,
    by_id: [u16; 256],
    frames: Vec<CyclicFrame>,
    /// For each frame its replacement when one of its SubDevices gets its FMMUs, or the frame that it replaced.
    others: Vec<CyclicFrame>,
    domains: Vec<Domain>,
    evidence: Evidence,
    tally: Tally,
    foreign: ForeignFrames,
    missed: Missed,
    copies: Copies,
    service: Service,
    shares: Shares,
    /// The frame of the last copy taken.
    taken: u16,
    cycle: u64,
    /// For each frame the one of its further tries. Ids of these count on from those of the frames.
    again: Vec<Option<Again>>,
    /// The next check for lost frames.
    decide_at: Instant,
    /// There is one frame.
    is_alone: bool,
    /// The fast path of one frame exists ([`Exchange::load_only_frame`]).
    has_only_frame: bool,
    /// The frame that was sent last.
    newest: u16,
    /// When the next cycle is expected to begin.
    next_at: Instant,
    /// Shortest period of a domain that has one.
    base_ns: u64,
    /// The ring is closed, as far as round trips are concerned.
    is_closed: bool,
    /// MainDevice redundancy.
    standby: Standby,
}

impl Exchange {
    /// Builds the images and frames of a layout. This is the last memory allocation.
    pub fn new(identity: Identity, links: LinkSet, layout: &Layout, board: Arc<Board>, events: Producer) -> Exchange {
        let (mut frames, mut others) = (Vec::new(), Vec::new());
        let mut domains = Vec::new();
        for (index, planned) in layout.domains.iter().enumerate() {
            let first = frames.len();
            for _ in 0..planned.under_way.max(1) {
                let mut next = InputNumber { datagram: 0, part: 0 };
                for frame in &planned.frames {
                    let whole = CyclicFrame::new(&identity, links.mask(), index, frame, next);
                    next.datagram += whole.datagrams();
                    next.part += whole.parts().sum::<usize>();
                    frames.push(whole.vacant(&identity, frame));
                    others.push(whole);
                }
            }
            domains.push(Domain::new(planned, first, &frames));
        }
        let service = Service::new(&identity, links.mask(), layout, &mut frames);
        let shares = Shares::new(layout, &board);
        let mut exchange = Exchange {
            identity,
            links,
            board,
            events,
            service,
            shares,
            sequence: Sequence::default(),
            by_id: [NO_FRAME; 256],
            frames,
            others,
            domains,
            evidence: Evidence::default(),
            tally: Tally::default(),
            foreign: ForeignFrames::new(),
            missed: Missed::default(),
            copies: Copies::default(),
            taken: NO_FRAME,
            cycle: 0,
            again: Vec::new(),
            decide_at: Instant::NEVER,
            is_alone: false,
            has_only_frame: false,
            newest: NO_FRAME,
            next_at: Instant::NEVER,
            base_ns: 0,
            is_closed: false,
            standby: Standby::default(),
        };
        exchange.find_only_frame();
        exchange
    }

    /// Takes a received frame. Any bytes are allowed.
    #[inline(always)]
    pub fn receive(&mut self, arrived_on: Link, bytes: &[u8], _now: Instant) -> Received {
        if self.receive_usual(bytes) {
            return Received::Taken;
        }
        self.receive_any(arrived_on, bytes)
    }

    /// Takes a frame that came back on the only link with the same results as the previous one, which is the usual
    /// case. In all other cases the result is false, and nothing has changed.
    #[inline(always)]
    fn receive_usual(&mut self, bytes: &[u8]) -> bool {
        if self.links != LinkSet::Single {
            return false;
        }
        let Some(sequence) = self.identity.main_cyclic(bytes) else { return false };
        let index = self.by_id[usize::from(sequence.frame_id())];
        let Some(frame) = self.frames.get_mut(usize::from(index)) else { return false };
        let Some(domain) = self.domains.get_mut(frame.domain()) else { return false };
        if !frame.is_back_as_usual(sequence, bytes, domain.inputs_mut()) || !self.evidence.ends_as_usual(frame) {
            return false;
        }
        self.taken = index;
        let supervision = frame.take_usual(bytes, domain.inputs_mut(), self.cycle);
        self.board.traffic.post_home(sequence);
        self.tally.counters.received += 1;
        if let Some(supervision) = supervision {
            self.board.post_supervision(supervision);
        }
        true
    }

    /// As [`Exchange::receive`], for any frame.
    #[inline(never)]
    fn receive_any(&mut self, arrived_on: Link, bytes: &[u8]) -> Received {
        let copy = match self.identity.classify(bytes) {
            Classified::Ours(copy) if copy.class == Class::Cyclic => copy,
            Classified::Ours(_) => return Received::Acyclic,
            Classified::Foreign => {
                self.tally.disturbed().foreign += 1;
                self.foreign.keep(arrived_on, bytes);
                self.note_foreign(arrived_on, bytes);
                return Received::Foreign;
            }
            Classified::Other => {
                self.tally.disturbed().other += 1;
                return Received::Other;
            }
        };
        let index = self.by_id[usize::from(copy.sequence.frame_id())];
        let Some(frame) = self.frames.get_mut(usize::from(index)) else {
            let received = self.receive_master(index, copy, bytes);
            return received.unwrap_or_else(|| self.receive_again(copy, arrived_on, bytes));
        };
        let domain = self.domains.get_mut(frame.domain());
        let image = domain.map_or_else(|| self.service.image_mut(), Domain::inputs_mut);
        self.taken = index;
        match frame.receive(copy, arrived_on, bytes, image, self.cycle, &mut self.tally) {
            Step::Waiting => {
                self.board.traffic.post_half_home(copy.sent_on, frame.sequence());
                self.evidence.receive_first(frame, &self.board);
                Received::Taken
            }
            Step::Finished => {
                self.board.traffic.post_home(frame.sequence());
                self.tally.counters.received += 1;
                self.evidence.close(frame, &self.board, &mut self.events);
                Received::Taken
            }
            Step::Late => {
                self.missed.late(copy.sequence, self.tally.disturbed());
                Received::Late
            }
            Step::Corrupt => {
                self.tally.disturbed().corrupt += 1;
                self.missed.damaged(copy.sequence);
                Received::Corrupt
            }
        }
    }

    /// Evaluates a domain: gives up its overdue frames and sums its working counters. With several cycles on the wire
    /// it evaluates each that has come back, in the order of departure; the state of the newest one stays.
    #[inline(always)]
    pub fn process(&mut self, id: DomainId, now: Instant) -> DomainStatus {
        if id.0 == 0 && self.process_unchanged() {
            return self.domains.first().map_or_else(DomainStatus::default, |domain| domain.status(false));
        }
        let Some(domain) = self.domains.get_mut(id.0) else { return DomainStatus::default() };
        // The usual case of a ring and of several domains: one frame per cycle, one cycle on the wire, the same results
        // as in the previous cycle.
        if let Some(frame) = domain.only().and_then(|at| self.frames.get(at))
            && frame.is_complete()
            && !frame.is_waiting()
            && domain.evaluate_repeated(frame.wkc(), frame.left())
        {
            return domain.status(false);
        }
        self.process_all(id, now)
    }

    /// As [`Exchange::process`], whatever the frames show.
    #[inline(never)]
    fn process_all(&mut self, id: DomainId, now: Instant) -> DomainStatus {
        let Some(domain) = self.domains.get_mut(id.0) else { return DomainStatus::default() };
        let mut evaluated = false;
        while let Some(set) = domain.oldest() {
            let frames = &self.frames[set.clone()];
            let (mut wkc, mut waiting, mut complete, mut left) = (0, false, true, self.cycle + 1);
            let (mut saved, mut was_sent) = (false, false);
            for (index, frame) in set.clone().zip(frames) {
                let outcome = outcome::outcome(frame, self.again.get(index));
                waiting |= outcome.waiting;
                complete &= outcome.complete;
                saved |= outcome.saved;
                was_sent |= outcome.was_sent;
                wkc += outcome.wkc;
                left = frame.left();
            }
            let is_unsent = domain.has_not_left(&set);
            if is_unsent && domain.evaluated() == left {
                // It was evaluated without an answer, and is evaluated again when it has left.
                return domain.status(false);
            }
            if waiting {
                let (missed, counters) = (&mut self.missed, self.tally.disturbed());
                let pending = give_up_overdue(domain, &mut self.frames, set.clone(), now, missed, counters);
                self.board.post_lost(self.tally.counters.lost);
                if pending {
                    return domain.status(!evaluated);
                }
            }
            evaluated = true;
            if saved && complete {
                self.tally.disturbed().saved += 1;
            }
            domain.count_tries(was_sent, complete);
            if !domain.evaluate(wkc, complete, left) {
                let returned = outcome::has_returned(set.clone(), &self.frames, &self.again);
                let result = (wkc, complete, returned);
                note_change(id, domain, result, &self.board, self.tally.disturbed(), &mut self.events);
                for (index, frame) in set.clone().zip(&self.frames[set.clone()]) {
                    self.shares.post(frame, self.again.get(index).and_then(Option::as_ref), &self.board);
                }
                if !complete && !is_unsent {
                    outcome::count_errors(set, &self.frames, &self.again, &self.board);
                }
            }
            if is_unsent {
                domain.await_departure();
                break;
            }
        }
        domain.status(false)
    }

    /// Copies a domain's outputs into its frames, which leave with the next [`Exchange::send`]. A domain with all its
    /// cycles still on the wire is skipped, counted and reported; the result is false then. A domain that is queued
    /// twice sends its latest outputs.
    #[inline(always)]
    pub fn queue(&mut self, id: DomainId, now: Instant) -> bool {
        if self.copies.is_empty()
            && !self.standby.is_inactive()
            && let Some(domain) = self.domains.get_mut(id.0)
            && let Some(at) = domain.next_alone()
            && let Some(frame) = self.frames.get_mut(at)
            && frame.is_ready(self.board.taking_part_changes())
        {
            frame.load(domain.image(), self.cycle);
            domain.note_loaded(at);
            return true;
        }
        self.queue_any(id, now)
    }

    /// As [`Exchange::queue`], for any domain.
    #[inline(never)]
    fn queue_any(&mut self, id: DomainId, now: Instant) -> bool {
        if self.standby.is_inactive() {
            return false;
        }
        let Some(domain) = self.domains.get_mut(id.0) else { return false };
        let set = domain.next();
        let frames = &mut self.frames[set.clone()];
        let changes = self.board.taking_part_changes();
        if self.copies.is_empty() && frames.iter().all(|frame| frame.is_ready(changes)) {
            domain.load(set.start, frames, self.cycle);
            return true;
        }
        if !self.make_ready(id, set.clone(), now) {
            return false;
        }
        if !self.copies.is_empty() {
            let stale = self.copies.run(id.0, &mut self.domains, self.cycle);
            if stale > 0 {
                self.tally.disturbed().stale_copies += stale;
            }
        }
        self.domains[id.0].load(set.start, &mut self.frames[set], self.cycle);
        true
    }

    /// Sends the queued frames, each on all links, and ends the cycle. Supervision and distributed clocks leave in each
    /// call, also where no domain is queued, unless a frame with them is still on the wire.
    #[inline(always)]
    pub fn send(&mut self, now: Instant, transmit: &mut impl FnMut(Link, &[u8])) {
        if self.leave_alone() {
            self.send_only_frame(now, &mut |bytes| transmit(Link::Main, bytes));
        } else {
            self.send_any(now, transmit);
        }
    }

    /// As [`Exchange::send`], for any frames.
    #[inline(always)]
    fn send_any(&mut self, now: Instant, transmit: &mut impl FnMut(Link, &[u8])) {
        if self.standby.is_inactive() {
            return;
        }
        let before = self.sequence;
        self.board.traffic.post_departure(self.cycle);
        if !self.service.leaves_at_home(&self.domains) {
            self.send_service(now, transmit);
        }
        for domain in &mut self.domains {
            let Some(set) = domain.leave() else { continue };
            let deadline = Instant(now.0.saturating_add(domain.timeout_ns()));
            for index in set {
                let Some(frame) = self.frames.get_mut(index) else { continue };
                self.sequence = self.sequence.next();
                self.by_id[usize::from(self.sequence.frame_id())] = index as u16;
                let bytes = if frame.clocks().is_some() {
                    let leaving = Leaving { identity: &self.identity, links: self.links, board: &self.board, now };
                    leaving.send(frame, self.sequence, deadline, &mut self.evidence, transmit)
                } else if self.links == LinkSet::Ring {
                    send_twice(&self.identity, frame, self.sequence, deadline, transmit)
                } else {
                    let bytes = frame.depart(&self.identity, self.sequence, deadline);
                    transmit(Link::Main, bytes);
                    bytes.len()
                };
                self.tally.counters.sent += 1;
                self.tally.counters.bytes += bytes as u64;
            }
        }
        self.send_master_frames(before, transmit);
        self.cycle += 1;
        self.board.post_cycle(self.cycle, self.tally.counters.sent);
    }

    /// Applies the supervisor's changes to the participation in process data, for frames of a domain that are not on
    /// the wire. A frame gets its process data with the first SubDevice, and keeps it: a SubDevice that returns with
    /// its FMMUs set takes part at once.
    #[cold]
    fn follow_board(&mut self, set: Range<usize>, changes: u32) {
        let board = &self.board;
        for (frame, other) in self.frames[set.clone()].iter_mut().zip(&mut self.others[set]) {
            if frame.is_vacant() && frame.concerns(|s| board.takes_part(s)) {
                core::mem::swap(frame, other);
            }
            frame.follow(changes, board);
            if !frame.is_vacant() {
                frame.post_leaving(board, self.cycle);
            }
        }
    }
}

/// A cycle of a domain was incomplete, or is the first complete one. Reports changes of state, and once that a domain
/// has been silent since activation.
#[cold]
fn note_change(
    id: DomainId,
    domain: &mut Domain,
    (wkc, complete, returned): (u32, bool, bool),
    board: &Board,
    counters: &mut CyclicCounters,
    events: &mut Producer,
) {
    let is_awaited = domain.is_awaited(|subdevice| board.takes_part(subdevice));
    let changed = domain.change_state(wkc, complete, returned, is_awaited);
    if domain.state() != DomainState::Complete {
        counters.incomplete += 1;
    }
    let incomplete = domain.count_interruption();
    if changed {
        events.push(CyclicEvent::Domain { domain: id.0 as u16, status: domain.status(false), incomplete }.pack());
    }
}

#[cfg(test)]
mod tests;
