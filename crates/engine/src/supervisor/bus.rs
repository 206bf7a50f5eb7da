//! The interface of procedures: send datagrams, wait, start other procedures, report events.

mod future;
mod mail;
mod registers;
mod wait;

use alloc::boxed::Box;
use alloc::rc::Rc;
use alloc::string::String;
use alloc::vec;
use alloc::vec::Vec;
use core::fmt;
use core::future::Future;

use ringcat_wire::address::{Position, RegisterAddress, StationAddress, Wkc};
use ringcat_wire::al::{AlStatus, AlStatusCode};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::memory_write::MemoryWrite;

use super::counters::AcyclicCounters;
use super::long_transfers::{TransferKind, TransferProgress, UnderWayTransfer};
use super::memory_writes::UnderWayWrite;
use super::reply::{BusError, Reply};
use super::shared_cell::SharedCell;
use super::signal::Signal;
use super::transfer::Request;
use crate::board::Board;
use crate::event::history::History;
use crate::event::{Event, Notice, Occupant, Subject};
use crate::link::{LinkOrder, LinkSet};
use crate::ring::RingState;
use crate::role::{Function, NotPermitted};
use crate::time::Instant;
use future::TransferFuture;

/// The handle of a procedure on the bus.
#[derive(Clone)]
pub struct Bus {
    pub(super) shared: Rc<SharedCell>,
}

impl Bus {
    pub(super) fn new(shared: Rc<SharedCell>) -> Bus {
        Bus { shared }
    }

    /// The time of the current call.
    pub fn now(&self) -> Instant {
        self.shared.borrow().now
    }

    /// Notes that a write into the memory of a SubDevice is under way, until what is returned is dropped: meanwhile the
    /// role is not given up.
    pub(crate) fn begin_memory_write(&self, write: MemoryWrite) -> UnderWayWrite {
        self.shared.borrow().memory_writes.begin(write)
    }

    /// Notes that a transfer of a SubDevice is under way, until what is returned is dropped.
    pub(crate) fn begin_transfer(
        &self,
        station: StationAddress,
        kind: TransferKind,
        total: Option<u64>,
    ) -> UnderWayTransfer {
        self.shared.borrow().long_transfers.begin(station, kind, total)
    }

    /// Progress of the transfers of a SubDevice.
    pub(crate) fn transfers(&self, station: StationAddress) -> Vec<TransferProgress> {
        self.shared.borrow().long_transfers.of(station)
    }

    /// The links the MainDevice has.
    pub fn links(&self) -> LinkSet {
        self.shared.borrow().links
    }

    /// State of the ring: from the exchange once it runs, before that as acyclic frames show it.
    pub fn ring(&self) -> RingState {
        let shared = self.shared.borrow();
        match shared.board.as_ref().map(|board| board.ring().state) {
            None | Some(RingState::Unknown) => shared.monitor.state(),
            Some(state) => state,
        }
    }

    /// Whether the interfaces have carriers, by [`crate::link::Link::index`]; `None` if the links do not report it.
    pub fn carriers(&self) -> [Option<bool>; 2] {
        self.shared.borrow().carriers
    }

    /// Checks a function that begins and is the same in all phases.
    ///
    /// # Errors
    /// The role of the MainDevice does not allow it.
    pub fn permit(&self, function: Function) -> Result<(), NotPermitted> {
        function.check_role(self.shared.borrow().role.role())
    }

    /// The board of the exchange, once there is one.
    pub fn board(&self) -> Option<alloc::sync::Arc<Board>> {
        self.shared.borrow().board.clone()
    }

    /// Counters of the acyclic half.
    pub(crate) fn counters(&self) -> AcyclicCounters {
        self.shared.borrow().counters()
    }

    /// Posts an AL status that was read, for readers of the live status.
    pub(crate) fn post_al_status(&self, station: StationAddress, status: AlStatus, code: AlStatusCode) {
        if let Some(board) = &self.shared.borrow().board {
            board.live.post_al_status(station, status, code);
        }
    }

    /// Reports a notice of a procedure.
    pub(crate) fn notice(&self, notice: Notice) {
        self.report(notice.into());
    }

    /// Reports an event: an effect of an observation. Procedures report notices.
    pub fn report(&self, event: Event) {
        let shared = &mut *self.shared.borrow_mut();
        shared.events.push(shared.now, event);
    }

    /// Reports a step of a procedure as a message of level 1; `text` is called only where such messages are wanted.
    pub(crate) fn step(&self, subject: Subject, text: impl FnOnce() -> String) {
        if !self.shared.borrow_mut().events.messages().takes_step(subject) {
            return;
        }
        let text = text();
        let shared = &mut *self.shared.borrow_mut();
        shared.events.messages().step(shared.now, subject, text);
    }

    /// Whether datagrams with wrong working counters are reported.
    pub(crate) fn are_commands_reported(&self) -> bool {
        self.shared.borrow().command_reports.is_on()
    }

    /// Reports acyclic datagrams with wrong working counters that have waited.
    pub(crate) fn report_waiting_commands(&self) {
        let shared = &mut *self.shared.borrow_mut();
        let waiting = shared.command_reports.take_waiting(shared.now);
        waiting.into_iter().for_each(|wrong| shared.report_command(wrong));
    }

    /// Reports an event of a SubDevice.
    pub(crate) fn report_of(&self, event: Event, subdevice: Occupant) {
        let shared = &mut *self.shared.borrow_mut();
        shared.events.push_of(shared.now, event, [Some(subdevice), None]);
    }

    /// Sets the SubDevices by cabling position, for events that name positions.
    pub(crate) fn set_occupants(&self, occupants: Vec<Occupant>) {
        self.shared.borrow_mut().events.set_occupants(occupants);
    }

    /// The SubDevices at cabling positions.
    pub(crate) fn occupants(&self, positions: [Option<Position>; 2]) -> [Option<Occupant>; 2] {
        self.shared.borrow().events.occupants(positions)
    }

    /// The diagnosis history.
    pub(crate) fn history<T>(&self, work: impl FnOnce(&mut History) -> T) -> T {
        work(self.shared.borrow_mut().events.history())
    }

    /// Sends a datagram, with retries, and returns the reply, whatever its working counter. `expected` is the working
    /// counter with which a second copy need not be awaited. Commands that both read and write are sent once: a retry
    /// would read the value that the first attempt wrote.
    pub fn transfer(
        &self,
        command: Command,
        target: Target,
        data: Vec<u8>,
        expected: Option<Wkc>,
    ) -> impl Future<Output = Result<Reply, BusError>> {
        let resend = !matches!(command, Command::Aprw | Command::Fprw | Command::Brw | Command::Lrw);
        self.submit(Request { expected, resend, ..Request::once(command, target, data) })
    }

    /// Leaves an order to the link layer for the runtime; none with `None`.
    pub(crate) fn order_link(&self, order: Option<LinkOrder>) {
        self.shared.borrow_mut().link_order = order;
    }

    /// Number of SubDevices on the main link: higher positions are on the redundant link (protocol CR-09). Broadcasts
    /// update it, too.
    pub(crate) fn set_main_count(&self, count: u16) {
        self.shared.borrow_mut().main_count = count;
    }

    /// Like [`Bus::transfer`], but sent once: for accesses that must not be repeated.
    pub fn transfer_once(
        &self,
        command: Command,
        target: Target,
        data: Vec<u8>,
    ) -> impl Future<Output = Result<Reply, BusError>> {
        self.submit(Request { expected: Some(Wkc(1)), ..Request::once(command, target, data) })
    }

    /// Sends this number of datagrams that read one byte of a register of all SubDevices, once, in a frame of their
    /// own. The reply is that of the last one.
    pub(crate) fn fill_frame(
        &self,
        register: RegisterAddress,
        datagrams: usize,
    ) -> impl Future<Output = Result<Reply, BusError>> {
        let before = datagrams.saturating_sub(1);
        self.submit(Request { before, ..Request::once(Command::Brd, Target::Broadcast(register), vec![0; 1]) })
    }

    /// Largest number of datagrams in a frame, as set for this MainDevice.
    pub(crate) fn max_datagrams(&self) -> usize {
        self.shared.borrow().max_datagrams
    }

    /// A datagram that the application composes: the answer combines all copies, whatever its working counter. `resend`
    /// allows a retry after a loss.
    pub fn datagram(
        &self,
        command: Command,
        target: Target,
        data: Vec<u8>,
        resend: bool,
    ) -> impl Future<Output = Result<Reply, BusError>> {
        self.submit(Request { resend, ..Request::once(command, target, data) })
    }

    /// Exchanges a register value: each SubDevice with this station address puts its old value into the datagram, so
    /// that only the first one on each link receives the sent data. Sent once.
    pub fn exchange(
        &self,
        station: StationAddress,
        register: RegisterAddress,
        main: Vec<u8>,
        redundant: Vec<u8>,
    ) -> impl Future<Output = Result<Reply, BusError>> {
        let target = Target::Station(station, register);
        let redundant = Some(redundant).filter(|data| data.len() == main.len());
        let (command, data) = (Command::Fprw, main);
        self.submit(Request { redundant, ..Request::once(command, target, data) })
    }

    /// Distributes a system time once with FRMW; `stations` is the reference clock on each link. SubDevices upstream of
    /// the reference clock, or on a link without it, receive `time`, which is valid at `at` and adjusted to the
    /// departure of the frame. `expected` as for [`Bus::transfer`].
    pub fn distribute_time(
        &self,
        stations: [StationAddress; 2],
        register: RegisterAddress,
        (time, at): (u32, Instant),
        expected: Wkc,
    ) -> impl Future<Output = Result<Reply, BusError>> {
        let [main, redundant] = stations;
        self.submit(Request {
            redundant_station: Some(redundant),
            expected: Some(expected),
            time_at: Some(at),
            ..Request::once(Command::Frmw, Target::Station(main, register), time.to_le_bytes().to_vec())
        })
    }

    /// A signal between procedures.
    pub fn signal(&self) -> Signal {
        Signal::new(self.shared.clone())
    }

    pub(super) fn submit(&self, mut request: Request) -> TransferFuture {
        // With a reference clock on each link, neither copy is preferred, so no witness is needed.
        if self.links() == LinkSet::Ring && request.redundant_station.is_none() && request.preceding.is_none() {
            request.preceding = request.witness();
        }
        TransferFuture::new(self.shared.clone(), request)
    }

    /// Starts an independent procedure.
    pub fn spawn(&self, procedure: impl Future<Output = ()> + 'static) {
        self.shared.borrow_mut().spawn(Box::pin(procedure));
    }
}

impl fmt::Debug for Bus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Bus").finish_non_exhaustive()
    }
}
