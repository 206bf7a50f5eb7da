//! State of one mailbox, shared by its tasks and handles.

mod work;

use alloc::rc::Rc;
use core::cell::{Cell, Ref, RefCell, RefMut};

use ringcat_wire::address::{RegisterAddress, StationAddress};
use ringcat_wire::mailbox::next_counter;
use ringcat_wire::register::{SyncManager, map};
use ringcat_wire::sii::MailboxLayout;

use super::answer_time::ShortestTrip;
use super::counters::MailCounters;
use super::emergencies::EmergencyRing;
use super::eoe::Traffic;
use super::lane::LaneState;
use super::lanes::Lanes;
use super::recent::Recent;
use super::unsolicited::UnsolicitedQueues;
use crate::declared::Address;
use crate::supervisor::{Bus, Signal};
use crate::time::Instant;

/// Parameters of a session. A session lasts from PREOP to INIT, also while the SubDevice does not answer.
#[derive(Clone, Copy, Debug)]
pub(super) struct Session {
    pub station: StationAddress,
    pub layout: MailboxLayout,
    /// SyncManager of the send mailbox (SubDevice to MainDevice).
    pub send_manager: u8,
    /// Counter of the last message sent.
    pub counter: u8,
    /// This counter may be any: the next message gets counter 0, which a SubDevice compares with none (protocol 6.1).
    pub is_stale: bool,
    /// Start of the session.
    pub since: Instant,
}

/// The mutable state.
#[derive(Debug)]
pub(super) struct MailboxState {
    pub session: Option<Session>,
    /// The last accepted mails of the session.
    pub recent: Recent,
    /// The session may be used.
    pub open: bool,
    /// Counts openings and closings, so that tasks and conversations of an earlier epoch end.
    pub epoch: u32,
    pub lanes: Lanes,
    /// Lane with the next turn to write.
    pub next_lane: usize,
    pub next_id: u32,
    /// The epoch in which a writer and a reader run.
    pub writer: Option<u32>,
    pub reader: Option<u32>,
    /// The send mailbox is known to be full.
    pub full: bool,
    /// A poll of the send mailbox's status is requested.
    pub poll_requested: bool,
    /// Presumed time at which the mail being read became available.
    pub available_at: Instant,
    /// Shortest duration of a poll and of a read.
    pub trips: [ShortestTrip; 2],
    /// The receive mailbox is full, and may stay full until the send mailbox is read.
    pub blocked: bool,
    /// A read was lost: its mail must be requested again.
    pub repeat: bool,
    /// A read is on the wire.
    pub reading: bool,
    /// Number of times that work was given to the reader.
    pub tasks: u32,
    /// A repeat may bring mail that was received before.
    pub repeated: bool,
    pub emergencies: EmergencyRing,
    pub unsolicited: UnsolicitedQueues,
    pub ethernet: Traffic,
    pub counters: MailCounters,
    /// Code of the last error that the SubDevice reported; 0 for none.
    pub last_error: u32,
    /// A download to an object of PDO assignment or mapping was queued.
    pub has_written_pdos: bool,
}

/// One mailbox, shared by its handles, conversations and tasks.
#[derive(Debug)]
pub(super) struct SharedMailbox {
    pub bus: Bus,
    /// Index in the declaration, before activation the position; for events.
    pub subdevice: Cell<Address>,
    state: RefCell<MailboxState>,
    /// Notifies conversations and receivers.
    pub changed: Signal,
    /// Notifies the reader.
    pub work: Signal,
}

impl SharedMailbox {
    pub(super) fn new(bus: &Bus, subdevice: Address) -> Rc<SharedMailbox> {
        let state = MailboxState {
            session: None,
            recent: Recent::default(),
            open: false,
            epoch: 0,
            lanes: Lanes::default(),
            next_lane: 0,
            next_id: 0,
            writer: None,
            reader: None,
            full: false,
            poll_requested: false,
            available_at: Instant::default(),
            trips: Default::default(),
            blocked: false,
            repeat: false,
            reading: false,
            tasks: 0,
            repeated: false,
            emergencies: EmergencyRing::new(EmergencyRing::DEFAULT_SIZE),
            unsolicited: UnsolicitedQueues::new(),
            ethernet: Traffic::new(),
            counters: MailCounters::default(),
            last_error: 0,
            has_written_pdos: false,
        };
        let (changed, work) = (bus.signal(), bus.signal());
        let subdevice = Cell::new(subdevice);
        Rc::new(SharedMailbox { bus: bus.clone(), subdevice, state: RefCell::new(state), changed, work })
    }

    pub(super) fn state_mut(&self) -> RefMut<'_, MailboxState> {
        self.state.borrow_mut()
    }

    pub(super) fn state(&self) -> Ref<'_, MailboxState> {
        self.state.borrow()
    }

    /// The session, if it is open and `epoch` is the current one.
    pub(super) fn session(&self, epoch: u32) -> Option<Session> {
        let state = self.state();
        if state.open && state.epoch == epoch { state.session } else { None }
    }

    /// Opens the mailbox with a new session.
    pub(super) fn open(&self, session: Session) {
        {
            let state = &mut *self.state_mut();
            state.session = Some(session);
            state.begin(true);
        }
        self.notify_all();
    }

    /// Closes the mailbox: its content is lost, and all requests end.
    pub(super) fn close(&self) {
        {
            let state = &mut *self.state_mut();
            state.session = None;
            state.recent = Recent::default();
            if !state.open {
                return;
            }
            state.begin(false);
        }
        self.notify_all();
    }

    /// Closes the mailbox until it is resumed; all requests end. If a read may be lost, its mail is requested again
    /// later.
    pub(super) fn suspend(&self) {
        {
            let state = &mut *self.state_mut();
            if !state.open {
                return;
            }
            let repeat = state.repeat || state.reading;
            let now = self.bus.now();
            state.begin_epoch(false);
            state.repeat = repeat;
            state.lanes.iter_mut().for_each(|lane| lane.suspend(now));
        }
        self.notify_all();
    }

    pub(super) fn notify_all(&self) {
        self.changed.notify();
        self.work.notify();
    }
}

impl MailboxState {
    fn begin(&mut self, open: bool) {
        self.begin_epoch(open);
        self.lanes.iter_mut().for_each(LaneState::reset);
    }

    fn begin_epoch(&mut self, open: bool) {
        self.epoch = self.epoch.wrapping_add(1);
        self.open = open;
        self.full = false;
        self.poll_requested = false;
        self.blocked = false;
        self.repeat = false;
        self.reading = false;
        self.ethernet.reset();
    }

    /// Whether a conversation waits for mail.
    pub(super) fn waiting(&self) -> bool {
        self.blocked || self.lanes.iter().any(|lane| lane.waiting().is_some())
    }
}

impl Session {
    /// A session with a SubDevice that has just entered PREOP or BOOT.
    pub(super) fn new(station: StationAddress, layout: MailboxLayout, send_manager: u8, since: Instant) -> Session {
        Session { station, layout, send_manager, counter: 0, is_stale: false, since }
    }

    /// The counter of the next message.
    pub(super) fn count(&mut self) {
        self.counter = if core::mem::take(&mut self.is_stale) { 0 } else { next_counter(self.counter) };
    }

    /// Status of the send mailbox.
    pub(super) const fn send_status(&self) -> RegisterAddress {
        map::sync_manager(self.send_manager).offset(SyncManager::STATUS)
    }
}
