//! The acyclic half: an executor for [`crate::procedures`], and the frames with their datagrams.
//!
//! [`Supervisor::receive`] takes received frames, [`Supervisor::poll`] runs procedures, [`Supervisor::transmit`] sends
//! their datagrams within a byte budget, [`Supervisor::next_deadline`] gives the latest time of the next poll.
//! Procedures see time only through the `now` of these calls.

mod alone;
pub mod bus;
mod command_reports;
mod counters;
mod debug_message;
mod executor;
mod group;
pub(crate) mod long_transfers;
pub(crate) mod memory_writes;
mod outbox;
mod posted;
mod received;
mod reply;
mod round_trip;
mod sent_frame;
mod sent_frames;
mod shared;
mod shared_cell;
mod signal;
mod silence;
mod stray;
mod task;
mod transfer;
mod turns;
mod watching;

use alloc::rc::Rc;
use alloc::sync::Arc;
use core::future::Future;

use ringcat_wire::frame::MacAddress;
#[cfg(feature = "standby")]
use ringcat_wire::memory_write::MemoryWrite;

pub(crate) use alone::Turn;
pub use bus::Bus;
pub use counters::AcyclicCounters;
pub(crate) use debug_message::MOST_WAITING as MOST_DEBUG_MESSAGES;
pub(crate) use group::{TURN, TURN_PAUSE};
pub(crate) use posted::Posted;
pub use received::Received;
pub use reply::{BusError, Reply};
pub use signal::Signal;

use crate::board::Board;
use crate::event::{Event, EventLog, EventsSince, TimedEvent};
use crate::link::{Link, LinkOrder, LinkSet};
use crate::request_counter::RequestCounter;
use crate::ring::{Class, Classified, Identity, RingMonitor, RingState, Sequence};
use crate::role::{MainDeviceRole, RoleControl};
use crate::time::Instant;
use shared::Shared;
use shared_cell::SharedCell;

/// The acyclic half of the MainDevice.
pub struct Supervisor {
    shared: Rc<SharedCell>,
    executor: executor::Executor,
}

impl Supervisor {
    /// A supervisor without procedures.
    pub fn new(identity: Identity, links: LinkSet, now: Instant) -> Supervisor {
        let shared = Rc::new(SharedCell::new(Shared::new(identity, links, now)));
        Supervisor { executor: executor::Executor::new(shared.clone()), shared }
    }

    /// The handle with which procedures use the bus.
    pub fn bus(&self) -> Bus {
        Bus::new(self.shared.clone())
    }

    /// Starts a procedure.
    pub fn spawn(&mut self, procedure: impl Future<Output = ()> + 'static) {
        self.shared.borrow_mut().spawn(alloc::boxed::Box::pin(procedure));
    }

    /// Sequence number of the last frame.
    pub(crate) fn sequence(&self) -> Sequence {
        self.shared.borrow().sent_frames.sequence()
    }

    /// Goes on with the sequence numbers of another supervisor, before the first frame: a frame of that one that comes
    /// back late is none of this one.
    pub(crate) fn go_on_from(&mut self, sequence: Sequence) {
        self.shared.borrow_mut().sent_frames.go_on_from(sequence);
    }

    /// Goes on with the state of the ring that another process has known, before the first frame.
    pub(crate) fn assume_ring(&mut self, ring: RingState) {
        self.shared.borrow_mut().monitor = RingMonitor::of(ring);
    }

    /// Number of a frame that is sent beside those of procedures.
    #[cfg(feature = "standby")]
    pub(crate) fn take_sequence(&mut self) -> Sequence {
        self.shared.borrow_mut().sent_frames.take_sequence()
    }

    /// Sets when there is work beside procedures: at a time, and whether a frame is to be sent now.
    #[cfg(feature = "standby")]
    pub(crate) fn set_due_beside(&mut self, at: Instant, is_now: bool) {
        if self.shared.borrow().due_beside != (at, is_now) {
            self.shared.borrow_mut().due_beside = (at, is_now);
        }
    }

    /// Attaches the board of the exchange; from now on [`Bus::ring`] returns the ring state that the exchange posts.
    pub fn attach(&mut self, board: Arc<Board>) {
        let shared = &mut *self.shared.borrow_mut();
        board.live.post_carriers(shared.carriers);
        shared.board = Some(board);
    }

    /// Attaches the request counter of cyclic threads: procedures wake when it changes.
    pub(crate) fn attach_request_counter(&mut self, request_counter: RequestCounter) {
        self.shared.borrow_mut().request_counter = request_counter;
    }

    /// Attaches the role of the MainDevice: as INACTIVE nothing is sent.
    pub(crate) fn attach_role(&mut self, role: RoleControl) {
        self.shared.borrow_mut().role = role;
    }

    /// Sets the largest number of datagrams in a frame.
    pub fn set_max_datagrams(&mut self, most: usize) {
        self.shared.borrow_mut().max_datagrams = most;
    }

    /// Sets the carrier states that the links report.
    #[inline]
    pub fn set_carriers(&mut self, carriers: [Option<bool>; 2]) {
        if self.shared.borrow().carriers != carriers {
            self.change_carriers(carriers);
        }
    }

    #[cold]
    fn change_carriers(&mut self, carriers: [Option<bool>; 2]) {
        let shared = &mut *self.shared.borrow_mut();
        shared.carriers = carriers;
        if let Some(board) = &shared.board {
            board.live.post_carriers(carriers);
        }
    }

    /// Takes a frame received on a link. Any bytes are allowed.
    pub fn receive(&mut self, arrived_on: Link, bytes: &[u8], now: Instant) -> Received {
        let shared = &mut *self.shared.borrow_mut();
        shared.now = now;
        match shared.identity.classify(bytes) {
            Classified::Ours(copy) if copy.class == Class::Acyclic => shared.receive(copy, arrived_on, bytes),
            Classified::Ours(_) => Received::Cyclic,
            Classified::Foreign => {
                shared.counters.foreign += 1;
                #[cfg(feature = "standby")]
                shared.note_foreign(arrived_on, bytes);
                shared.events.push(now, Event::ForeignFrame { arrived_on, bytes: bytes.to_vec() });
                Received::Foreign
            }
            Classified::Other => Received::Other,
        }
    }

    /// Takes link and source address of the last frame of another MainDevice since the last call.
    #[cfg(feature = "standby")]
    pub(crate) fn take_foreign(&mut self) -> Option<(Link, MacAddress)> {
        self.shared.borrow_mut().foreign.take()
    }

    /// The oldest write into the memory of a SubDevice that is under way.
    #[cfg(feature = "standby")]
    pub(crate) fn memory_write(&self) -> Option<MemoryWrite> {
        self.shared.borrow().memory_writes.oldest()
    }

    /// Gives up overdue frames, fires expired timers, and runs procedures until all of them wait.
    pub fn poll(&mut self, now: Instant) {
        {
            let shared = &mut *self.shared.borrow_mut();
            shared.now = now;
            shared.expire_sent_frames();
            shared.expire_alone();
            shared.fire_timers();
            shared.wake_watchers();
        }
        self.executor.run();
    }

    /// Sends the datagrams of procedures, about `budget` bytes at most (without overhead on the wire), every frame on
    /// all links. Returns the bytes sent per link.
    pub fn transmit(&mut self, now: Instant, budget: usize, transmit: &mut impl FnMut(Link, &[u8])) -> usize {
        let shared = &mut *self.shared.borrow_mut();
        shared.now = now;
        match shared.role.role() {
            MainDeviceRole::Active => shared.transmit(budget, transmit),
            // The cyclic half has just changed the role: procedures end with the next poll.
            MainDeviceRole::Inactive => 0,
        }
    }

    /// Latest time at which [`Supervisor::poll`] has work to do, received frames aside.
    pub fn next_deadline(&self) -> Option<Instant> {
        Some(self.shared.next_deadline()).filter(|at| *at != Instant::NEVER)
    }

    /// When there is work: for [`Supervisor::poll`], a datagram to send, or a request to the link layer. In the distant
    /// past for work that does not wait for a time, never without work. Cheap while nothing changes.
    #[inline(always)]
    pub fn due_at(&self) -> Instant {
        self.shared.due_at()
    }

    /// The order to the link layer that waits for the runtime.
    pub(crate) fn take_link_order(&mut self) -> Option<LinkOrder> {
        self.shared.borrow_mut().link_order.take()
    }

    /// Whether datagrams of procedures wait to be sent.
    pub fn wants_to_send(&self) -> bool {
        self.shared.borrow().wants_to_send()
    }

    /// Takes the oldest event.
    pub fn pop_event(&mut self) -> Option<TimedEvent> {
        self.shared.borrow_mut().events.pop()
    }

    /// The events, to be continued by another supervisor; this one begins anew.
    pub(crate) fn take_events(&mut self) -> EventLog {
        core::mem::take(&mut self.shared.borrow_mut().events)
    }

    /// Continues events.
    pub(crate) fn set_events(&mut self, events: EventLog) {
        self.shared.borrow_mut().events = events;
    }

    /// Appends an event.
    #[cfg(feature = "standby")]
    pub(crate) fn append_event(&mut self, at: Instant, event: Event) {
        self.shared.borrow_mut().events.push(at, event);
    }

    /// Works with the log of events.
    pub(crate) fn with_events<T>(&self, work: impl FnOnce(&mut EventLog) -> T) -> T {
        work(&mut self.shared.borrow_mut().events)
    }

    /// Begins or ends reports of acyclic datagrams with wrong working counters.
    pub(crate) fn set_command_reports(&self, is_on: bool) {
        self.shared.borrow_mut().command_reports.set_on(is_on);
    }

    /// Queues an Ethernet debug message, from the addresses of the links; false if too many wait.
    pub(crate) fn queue_debug_message(&self, sources: [Option<MacAddress>; 2], ethertype: u16, text: &[u8]) -> bool {
        let shared = &mut *self.shared.borrow_mut();
        shared.debug_messages.queue(sources, ethertype, text, shared.now)
    }

    /// The kept events from a number on.
    pub fn events_since(&self, number: u64) -> EventsSince {
        self.shared.borrow().events.since(number)
    }

    /// Number of events that were dropped because the application did not fetch them, or lost before they had
    /// numbers.
    pub fn events_dropped(&self) -> u64 {
        self.shared.borrow().events.dropped()
    }

    /// The state of the ring as the acyclic frames show it.
    pub fn ring(&self) -> RingState {
        self.shared.borrow().monitor.state()
    }

    /// Work in progress.
    pub fn under_way(&self) -> UnderWay {
        UnderWay { procedures: self.executor.count(), datagrams: self.shared.borrow().transfers.count() }
    }

    /// Counters since the beginning.
    pub fn counters(&self) -> AcyclicCounters {
        self.shared.borrow().counters()
    }
}

/// Work in progress in the acyclic half. All of it ends: numbers that grow between idle moments show a leak.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct UnderWay {
    /// Procedures, including those that never end.
    pub procedures: usize,
    /// Datagrams that a procedure waits for, or that were given up while they are in a frame.
    pub datagrams: usize,
}

impl core::fmt::Debug for Supervisor {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Supervisor").field("counters", &self.counters()).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests;
