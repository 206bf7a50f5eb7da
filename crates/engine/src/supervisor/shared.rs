//! Common state of the executor, the procedures and the frames.

use alloc::collections::{BinaryHeap, VecDeque};
use alloc::sync::Arc;
use core::cmp::Reverse;

use ringcat_wire::datagram::{MAX_DATA, Target};

use super::alone::Alone;
use super::command_reports::{CommandReports, WrongCommand};
use super::counters::AcyclicCounters;
use super::debug_message::DebugMessages;
use super::long_transfers::LongTransfers;
use super::memory_writes::MemoryWrites;
use super::outbox::{Outbox, Rank};
use super::posted::Watchers;
use super::reply::BusError;
use super::round_trip::RoundTrip;
use super::sent_frames::SentFrames;
use super::silence::Silence;
use super::stray::Strays;
use super::task::{Task, TaskId};
use super::transfer::{Request, Stage, Transfer, TransferId, Transfers};
use crate::board::Board;
use crate::event::{Event, EventLog, Occupant};
use crate::link::{LinkOrder, LinkSet};
use crate::request_counter::RequestCounter;
use crate::ring::{Identity, RingMonitor};
use crate::role::RoleControl;
use crate::time::Instant;

pub(crate) struct Shared {
    pub(crate) now: Instant,
    pub(crate) identity: Identity,
    pub(crate) links: LinkSet,
    pub(crate) board: Option<Arc<Board>>,
    pub(crate) monitor: RingMonitor,
    pub(crate) counters: AcyclicCounters,
    /// Link and source address of the last frame of another MainDevice.
    #[cfg(feature = "standby")]
    pub(crate) foreign: Option<(crate::link::Link, ringcat_wire::frame::MacAddress)>,
    /// When there is work beside procedures, and whether a frame of it is to be sent now.
    #[cfg(feature = "standby")]
    pub(crate) due_beside: (Instant, bool),
    pub(crate) events: EventLog,
    pub(crate) transfers: Transfers,
    pub(crate) command_reports: CommandReports,
    pub(crate) outbox: Outbox,
    pub(crate) debug_messages: DebugMessages,
    pub(crate) alone: Alone,
    pub(crate) sent_frames: SentFrames,
    pub(crate) silence: Silence,
    /// Carrier by link, if the links report it.
    pub(crate) carriers: [Option<bool>; 2],
    pub(crate) strays: Strays,
    pub(crate) round_trip: RoundTrip,
    /// Number of SubDevices that processed the main copy of the last broadcast: higher positions are on the redundant
    /// link.
    pub(crate) main_count: u16,
    /// The first datagram of the outbox and since when it waits, if it is too long for the send window.
    pub(crate) blocked: Option<(TransferId, Instant)>,
    /// The order to the link layer that waits for the runtime.
    pub(crate) link_order: Option<LinkOrder>,
    pub(super) watchers: Watchers,
    pub(super) request_counter: RequestCounter,
    /// Largest number of datagrams in a frame.
    pub(crate) max_datagrams: usize,
    pub(crate) role: RoleControl,
    pub(crate) memory_writes: MemoryWrites,
    pub(crate) long_transfers: LongTransfers,
    pub(crate) current: TaskId,
    pub(crate) spawned: VecDeque<Task>,
    ready: VecDeque<TaskId>,
    timers: BinaryHeap<Reverse<(Instant, TaskId)>>,
}

impl Shared {
    /// Notes a frame of another MainDevice.
    #[cfg(feature = "standby")]
    #[cold]
    pub(super) fn note_foreign(&mut self, arrived_on: crate::link::Link, bytes: &[u8]) {
        let source = bytes.get(6..).and_then(<[u8]>::first_chunk);
        self.foreign = source.map(|source| (arrived_on, ringcat_wire::frame::MacAddress(*source)));
    }

    pub(crate) fn new(identity: Identity, links: LinkSet, now: Instant) -> Shared {
        Shared {
            now,
            identity,
            links,
            board: None,
            monitor: RingMonitor::default(),
            counters: AcyclicCounters::default(),
            #[cfg(feature = "standby")]
            foreign: None,
            #[cfg(feature = "standby")]
            due_beside: (Instant::NEVER, false),
            events: EventLog::default(),
            transfers: Transfers::default(),
            command_reports: CommandReports::default(),
            outbox: Outbox::default(),
            debug_messages: DebugMessages::default(),
            alone: Alone::default(),
            sent_frames: SentFrames::new(),
            silence: Silence::default(),
            carriers: [None; 2],
            strays: Strays::default(),
            round_trip: RoundTrip::default(),
            main_count: 0,
            blocked: None,
            link_order: None,
            watchers: Watchers::default(),
            request_counter: RequestCounter::default(),
            max_datagrams: usize::MAX,
            role: RoleControl::default(),
            memory_writes: MemoryWrites::default(),
            long_transfers: LongTransfers::default(),
            current: TaskId(0),
            spawned: VecDeque::new(),
            ready: VecDeque::new(),
            timers: BinaryHeap::new(),
        }
    }

    /// Reports a datagram with a wrong working counter, named by its SubDevice.
    pub(crate) fn report_command(&mut self, wrong: WrongCommand) {
        let WrongCommand { command, target, expected, got, count } = wrong;
        let station = if let Target::Station(station, _) = target { Some(station) } else { None };
        let occupant = match target {
            Target::Position(position, _) => self.events.occupants([Some(position), None])[0],
            _ => station.map(|it| self.events.occupant_at(it).unwrap_or(Occupant::new(it, None))),
        };
        let event = Event::AcyclicCommand { command, target, expected, got, count };
        self.events.push_of(self.now, event, [occupant, None]);
    }

    pub(crate) fn spawn(&mut self, task: Task) {
        self.spawned.push_back(task);
    }

    pub(crate) fn wake(&mut self, task: TaskId) {
        self.ready.push_back(task);
    }

    pub(crate) fn next_ready(&mut self) -> Option<TaskId> {
        self.ready.pop_front()
    }

    /// Wakes the current task at a time.
    pub(crate) fn wake_at(&mut self, at: Instant) {
        self.timers.push(Reverse((at, self.current)));
    }

    pub(crate) fn fire_timers(&mut self) {
        while let Some(&Reverse((at, task))) = self.timers.peek() {
            if at > self.now {
                return;
            }
            self.timers.pop();
            self.wake(task);
        }
    }

    /// When [`super::Supervisor::poll`] has work to do, received frames and words of other threads aside; never if it
    /// has none.
    pub(super) fn own_deadline(&self) -> Instant {
        if !self.ready.is_empty() || !self.spawned.is_empty() || self.has_carriers_to_show() {
            return self.now;
        }
        let timer = self.timers.peek().map_or(Instant::NEVER, |Reverse((at, _))| *at);
        let queue = match self.alone.is_held() {
            true => self.alone.next_deadline(self.now),
            false => self.outbox.next_deadline(self.now),
        };
        let timer = timer.min(self.sent_frames.next_deadline()).min(queue.unwrap_or(Instant::NEVER));
        #[cfg(feature = "standby")]
        let timer = timer.min(self.due_beside.0);
        timer
    }

    /// Counters of frames, datagrams and dropped mails so far.
    pub(super) fn counters(&self) -> AcyclicCounters {
        AcyclicCounters { mails_dropped: self.strays.dropped(), ..self.counters }
    }

    /// Whether there is work that does not wait for a time: a datagram to send, or a request to the link layer.
    pub(super) fn has_work(&self) -> bool {
        self.link_order.is_some() || self.wants_to_send()
    }

    pub(crate) fn wants_to_send(&self) -> bool {
        #[cfg(feature = "standby")]
        if self.due_beside.1 {
            return true;
        }
        match self.alone.is_held() {
            true => self.alone.next_deadline(self.now).is_some(),
            false => self.outbox.is_ready(self.now) || self.debug_messages.are_waiting(),
        }
    }

    /// Queues a datagram for the current task. If it is longer than a frame, it fails at once.
    pub(crate) fn request(&mut self, request: Request) -> TransferId {
        let length = request.data.len();
        let fits = length <= MAX_DATA;
        let stage =
            if fits { Stage::Queued } else { Stage::Done(Err(BusError::TooLong { target: request.target, length })) };
        let rank = match (request.urgent, request.mail) {
            (true, _) => Rank::Urgent,
            (false, Some(_)) => Rank::Read,
            (false, None) => Rank::First,
        };
        let (target, alone) = (request.target, request.alone);
        let bytes = request.bytes();
        let id = self.transfers.insert(Transfer { request, stage, task: self.current, retries: 0, abandoned: false });
        match alone {
            _ if !fits => self.wake(self.current),
            Some(no_return) => self.push_alone(id, no_return),
            None => self.outbox.push(id, rank, target, bytes, self.now),
        }
        id
    }

    /// The procedure gave up a transfer.
    pub(crate) fn abandon(&mut self, id: TransferId) {
        let Some(transfer) = self.transfers.find(id) else { return };
        match transfer.stage {
            Stage::Done(_) => {
                self.transfers.remove(id);
            }
            Stage::Queued | Stage::InFlight => transfer.abandoned = true,
        }
    }
}
