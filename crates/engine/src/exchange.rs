//! The cyclic half: process data and one supervision datagram.
//!
//! A cycle of the application is: [`Exchange::receive`] for every frame that came in, [`Exchange::process`] for each
//! domain, work on the images, [`Exchange::queue`] for each domain that is due, [`Exchange::send`]. None of them
//! allocates, locks or waits; the work is bounded by what was planned at activation.
//!
//! A frame is delivered when its working counters are as expected, or all its copies are in, or at its deadline. Inputs
//! are delivered per SubDevice: see [`domain`].

mod clocks;
pub mod copy;
pub mod counters;
pub mod domain;
pub mod entry;
mod flight;
pub mod foreign;

use alloc::sync::Arc;
use alloc::vec::Vec;
use core::time::Duration;

pub use clocks::{ClockSetup, ReferenceTime};
pub use copy::{CopyError, CopyRule, WhenStale};
pub use counters::CyclicCounters;
pub use domain::Domain;
pub use entry::Entry;
pub use foreign::ForeignFrame;

use crate::board::{Board, CyclicFrames, RingWord};
use crate::domain::{DomainId, DomainState, DomainStatus, Freshness};
use crate::event::CyclicEvent;
use crate::layout::Layout;
use crate::link::{Link, LinkSet};
use crate::queue::Producer;
use crate::ring::{Class, Classified, Identity, RingMonitor, RingState, Sequence};
use crate::time::Instant;
use clocks::Clocks;
use copy::Copies;
use flight::{CyclicFrame, Step};
use foreign::ForeignFrames;

/// No frame has this id.
const NO_FRAME: u16 = u16::MAX;

/// What became of a frame that was handed to [`Exchange::receive`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Received {
    /// A copy of a frame that is in flight.
    Taken,
    /// A frame of ours whose answer was given up, or a copy that was there already.
    Late,
    /// A frame of ours with other datagrams than were sent.
    Corrupt,
    /// A frame of the acyclic half.
    Acyclic,
    /// A frame of another MainDevice; kept for [`Exchange::pop_foreign`].
    Foreign,
    /// No EtherCAT frame.
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
    /// For each of the frames the one that takes its place when a SubDevice of it has its FMMUs, or that it has replaced.
    others: Vec<CyclicFrame>,
    domains: Vec<Domain>,
    to_send: Vec<u16>,
    monitor: RingMonitor,
    counters: CyclicCounters,
    foreign: ForeignFrames,
    copies: Copies,
    clocks: Clocks,
    cycle: u64,
}

impl Exchange {
    /// Builds the images and frames of a layout. This is the last time that memory is allocated.
    pub fn new(identity: Identity, links: LinkSet, layout: &Layout, board: Arc<Board>, events: Producer) -> Exchange {
        let (mut frames, mut others) = (Vec::new(), Vec::new());
        let mut domains = Vec::new();
        for (index, planned) in layout.domains.iter().enumerate() {
            let first = frames.len();
            for frame in &planned.frames {
                let whole = CyclicFrame::new(&identity, index, frame);
                frames.push(whole.vacant(&identity, frame));
                others.push(whole);
            }
            domains.push(Domain::new(planned, first..frames.len()));
        }
        Exchange {
            identity,
            links,
            board,
            events,
            sequence: Sequence::default(),
            by_id: [NO_FRAME; 256],
            to_send: Vec::with_capacity(frames.len()),
            frames,
            others,
            domains,
            monitor: RingMonitor::default(),
            counters: CyclicCounters::default(),
            foreign: ForeignFrames::new(),
            copies: Copies::default(),
            clocks: Clocks::default(),
            cycle: 0,
        }
    }

    /// Takes in a frame that arrived on a link. Any bytes are allowed.
    pub fn receive(&mut self, arrived_on: Link, bytes: &[u8], _now: Instant) -> Received {
        let copy = match self.identity.classify(bytes) {
            Classified::Ours(copy) if copy.class == Class::Cyclic => copy,
            Classified::Ours(_) => return Received::Acyclic,
            Classified::Foreign => {
                self.counters.foreign += 1;
                self.foreign.keep(arrived_on, bytes);
                return Received::Foreign;
            }
            Classified::Other => {
                self.counters.other += 1;
                return Received::Other;
            }
        };
        let index = self.by_id[usize::from(copy.sequence.frame_id())];
        let Some(frame) = self.frames.get_mut(usize::from(index)) else {
            self.counters.late += 1;
            return Received::Late;
        };
        let Some(domain) = self.domains.get_mut(frame.domain()) else { return Received::Other };
        match frame.receive(copy, arrived_on, bytes, self.links.mask(), domain.image_mut(), self.cycle) {
            Step::Waiting => {
                // Told at once: the other copy may never come.
                if frame.arrivals().returned != 0 && self.monitor.state() != RingState::Open {
                    observe(frame, &mut self.monitor, &self.board);
                }
                Received::Taken
            }
            Step::Finished => {
                self.counters.received += 1;
                close(frame, &mut self.monitor, &mut self.clocks, &self.board, &mut self.events);
                Received::Taken
            }
            Step::Late => {
                self.counters.late += 1;
                Received::Late
            }
            Step::Corrupt => {
                self.counters.corrupt += 1;
                Received::Corrupt
            }
        }
    }

    /// Judges a domain: gives up its overdue frames and sums its working counters.
    pub fn process(&mut self, id: DomainId, now: Instant) -> DomainStatus {
        let Some(domain) = self.domains.get_mut(id.0) else { return DomainStatus::default() };
        let frames = &mut self.frames[domain.frames()];
        let (mut wkc, mut waiting, mut complete) = (0, false, true);
        for frame in &*frames {
            waiting |= frame.is_waiting();
            complete &= frame.is_complete();
            wkc += frame.wkc();
        }
        let pending = waiting && give_up_overdue(frames, domain.image_mut(), now, self.cycle, &mut self.counters);
        if pending || !domain.was_queued() {
            return domain.status(pending);
        }
        let before = domain.state();
        let status = domain.judge(wkc, complete, self.cycle);
        if status.state != DomainState::Complete {
            self.counters.incomplete += 1;
        }
        if status.state != before {
            self.events.push(CyclicEvent::Domain { domain: id.0 as u16, status }.pack());
        }
        status
    }

    /// Puts a domain's outputs into its frames, to go out with the next [`Exchange::send`]. A domain whose frames are
    /// still out is skipped, counted and reported; false then. Queued twice, it leaves with its last outputs.
    pub fn queue(&mut self, id: DomainId, now: Instant) -> bool {
        let Some(domain) = self.domains.get_mut(id.0) else { return false };
        let range = domain.frames();
        let frames = &mut self.frames[range.clone()];
        if frames.iter().any(|frame| frame.is_waiting() && !frame.overdue(now)) {
            self.counters.skipped += 1;
            domain.count_skip();
            self.events.push(CyclicEvent::Skipped { domain: id.0 as u16 }.pack());
            return false;
        }
        let is_new = domain.note_queued();
        if domain.followed() != self.board.taking_part_changes() {
            self.follow_board(id);
        }
        if !self.copies.is_empty() {
            self.counters.stale_copies += self.copies.run(id.0, &mut self.domains, &self.frames, self.cycle);
        }
        let (domain, frames) = (&self.domains[id.0], &mut self.frames[range.clone()]);
        for (frame, index) in frames.iter_mut().zip(range.start as u16..) {
            if frame.is_open() {
                self.counters.copies_lost += 1;
                close(frame, &mut self.monitor, &mut self.clocks, &self.board, &mut self.events);
            }
            frame.load(domain.image());
            if is_new && self.to_send.len() < self.to_send.capacity() {
                self.to_send.push(index);
            }
        }
        true
    }

    /// Sends what was queued, every frame on all links, and ends the cycle.
    pub fn send(&mut self, now: Instant, transmit: &mut impl FnMut(Link, &[u8])) {
        for position in 0..self.to_send.len() {
            let index = self.to_send[position];
            let Some(frame) = self.frames.get_mut(usize::from(index)) else { continue };
            self.sequence = self.sequence.next();
            self.by_id[usize::from(self.sequence.frame_id())] = index;
            let domain = &mut self.domains[frame.domain()];
            domain.note_sent();
            let timeout_ns = domain.timeout_ns();
            let clocks = frame.clocks_leave(now);
            let bytes = frame.depart(&self.identity, self.sequence, Instant(now.0.saturating_add(timeout_ns)));
            let mut redundant = None;
            if let Some(places) = clocks {
                let payloads = self.clocks.depart(&self.board, now);
                places.write(bytes, &payloads[0]);
                redundant = Some((places, payloads[1]));
            }
            self.counters.sent += 1;
            self.counters.bytes += bytes.len() as u64;
            transmit(Link::Main, bytes);
            if self.links == LinkSet::Ring {
                if let Some((places, payload)) = redundant {
                    places.write(bytes, &payload);
                }
                Identity::mark_redundant(bytes, true);
                transmit(Link::Redundant, bytes);
                Identity::mark_redundant(bytes, false);
            }
        }
        self.to_send.clear();
        self.cycle += 1;
        self.board.post_cycle(CyclicFrames { sent: self.counters.sent, lost: self.counters.lost });
    }

    /// Takes over who takes part in process data, which the supervisor has changed. A frame gets its process data with the
    /// first SubDevice, and keeps it: whoever comes back with its FMMUs is served at once.
    #[cold]
    fn follow_board(&mut self, id: DomainId) {
        let Some(domain) = self.domains.get_mut(id.0) else { return };
        let changes = self.board.taking_part_changes();
        let board = &self.board;
        for index in domain.frames() {
            let (frame, other) = (&mut self.frames[index], &mut self.others[index]);
            if frame.is_vacant() && frame.concerns(|s| board.takes_part(s)) {
                if frame.is_open() {
                    self.counters.copies_lost += 1;
                    close(frame, &mut self.monitor, &mut self.clocks, board, &mut self.events);
                }
                core::mem::swap(frame, other);
            }
            frame.recount(|s| board.takes_part(s), |s| board.is_optional(s));
        }
        let frames = &self.frames[domain.frames()];
        domain.follow(self.cycle, changes, |subdevice| board.takes_part(subdevice), frames);
    }

    /// Number of domains.
    pub fn domain_count(&self) -> usize {
        self.domains.len()
    }

    /// A domain's image: its SubDevices' outputs and inputs. Its address does not change.
    pub fn image(&self, id: DomainId) -> &[u8] {
        self.domains.get(id.0).map_or(&[], Domain::image)
    }

    /// A domain's image, to write outputs. What is written into inputs is overwritten by the next delivery.
    pub fn image_mut(&mut self, id: DomainId) -> &mut [u8] {
        self.domains.get_mut(id.0).map_or(&mut [], Domain::image_mut)
    }

    /// The last judgement of a domain.
    pub fn status(&self, id: DomainId) -> DomainStatus {
        let Some(domain) = self.domains.get(id.0) else { return DomainStatus::default() };
        let pending = self.frames[domain.frames()].iter().any(CyclicFrame::is_waiting);
        domain.status(pending)
    }

    /// How old a SubDevice's inputs in a domain are.
    pub fn freshness(&self, id: DomainId, subdevice: usize) -> Freshness {
        let Some(domain) = self.domains.get(id.0) else { return Freshness::Never };
        domain.freshness(subdevice, &self.frames[domain.frames()])
    }

    /// Sets the inputs that are copied to outputs in every cycle, in place of those that were before: when a domain is
    /// queued, behind everything that the application wrote. Not for the cyclic path: this allocates.
    ///
    /// # Errors
    /// Sources that are no inputs, targets that are no outputs or have two sources, different lengths; nothing is changed
    /// then.
    pub fn set_copies(&mut self, rules: &[CopyRule]) -> Result<(), CopyError> {
        self.copies = Copies::new(rules, &self.domains, &self.frames)?;
        Ok(())
    }

    /// Whether a copy, by its place in the table, was refused the last time because its source was stale.
    pub fn is_copy_stale(&self, rule: usize) -> bool {
        self.copies.is_stale(rule)
    }

    /// Overrides how long a domain's frames are waited for; the default is three quarters of its period.
    pub fn set_timeout(&mut self, id: DomainId, timeout: Duration) {
        if let Some(domain) = self.domains.get_mut(id.0) {
            domain.set_timeout(timeout);
        }
    }

    /// Reads an entry's value from its image, zero-extended.
    pub fn read(&self, entry: &Entry) -> u64 {
        entry.read(self.image(entry.domain))
    }

    /// Writes an entry's value into its image, truncated to the entry's bits.
    pub fn write(&mut self, entry: &Entry, value: u64) {
        entry.write(self.image_mut(entry.domain), value);
    }

    /// Whether frames are out that have not returned as expected. Those that are overdue count until they are given up.
    pub fn in_flight(&self) -> bool {
        self.frames.iter().any(CyclicFrame::is_waiting)
    }

    /// State of the ring as the cyclic frames show it.
    pub fn ring(&self) -> RingState {
        self.monitor.state()
    }

    /// Says what the application chose about distributed clocks.
    pub fn set_up_clocks(&mut self, setup: ClockSetup) {
        self.clocks.set_up(setup);
    }

    /// The application's time now, in nanoseconds of system time: what bus shift leads the reference clock to. Without
    /// it, host time plus the epoch of the configuration counts.
    pub fn set_application_time(&mut self, time: u64, now: Instant) {
        self.clocks.set_application_time(time, now);
    }

    /// The application's time.
    pub fn application_time(&self, now: Instant) -> u64 {
        self.clocks.application_time(now)
    }

    /// The next frame steers the reference clock towards this time, once. What follows it follows.
    pub fn sync_reference_to(&mut self, time: u64) {
        self.clocks.want_reference_at(time);
    }

    /// The last reading of the reference clock; `None` before the first and without distributed clocks.
    pub fn reference_time(&self) -> Option<ReferenceTime> {
        self.clocks.reference_time()
    }

    /// OR of all |0x092C| in nanoseconds as the last cycle saw it: at most twice the largest.
    pub fn clock_spread_ns(&self) -> Option<u32> {
        self.clocks.spread_ns()
    }

    /// Counters since activation.
    pub fn counters(&self) -> &CyclicCounters {
        &self.counters
    }

    /// Takes the oldest kept frame of another MainDevice (facts MR-10).
    pub fn pop_foreign(&mut self) -> Option<ForeignFrame<'_>> {
        self.foreign.pop()
    }
}

/// Gives up those frames that are overdue. True where others are still waited for.
#[cold]
fn give_up_overdue(
    frames: &mut [CyclicFrame],
    image: &mut [u8],
    now: Instant,
    cycle: u64,
    counters: &mut CyclicCounters,
) -> bool {
    let mut pending = false;
    for frame in frames.iter_mut().filter(|frame| frame.is_waiting()) {
        if !frame.overdue(now) {
            pending = true;
        } else if frame.give_up(image, cycle) {
            counters.lost += 1;
        } else {
            counters.half += 1;
        }
    }
    pending
}

/// A flight is over: what it proves about the ring and what its supervision datagram saw go on the board.
fn close(
    frame: &mut CyclicFrame,
    monitor: &mut RingMonitor,
    clocks: &mut Clocks,
    board: &Board,
    events: &mut Producer,
) {
    if let Some(seen) = frame.clocks_seen() {
        clocks.observe(seen, frame.arrivals(), board, events);
    }
    // Counts first: whoever sees the change finds those that belong to it.
    if let Some(supervision) = frame.supervision() {
        board.post_supervision(supervision);
    }
    if monitor.observe(frame.arrivals()) {
        post_ring(frame, monitor, board);
    }
    frame.close();
}

#[cold]
fn observe(frame: &CyclicFrame, monitor: &mut RingMonitor, board: &Board) {
    if monitor.observe(frame.arrivals()) {
        post_ring(frame, monitor, board);
    }
}

#[cold]
fn post_ring(frame: &CyclicFrame, monitor: &RingMonitor, board: &Board) {
    let link = if frame.arrivals().returned & Link::Main.bit() != 0 { Link::Main } else { Link::Redundant };
    let seen = frame.supervision().filter(|_| frame.arrivals().returned != 0);
    let returned = seen.map(|seen| (link, if link == Link::Main { seen.main.0 } else { seen.redundant.0 }));
    board.post_ring(RingWord { state: monitor.state(), returned, dead_way: monitor.dead_way(), changes: 0 });
}

#[cfg(test)]
mod tests;
