//! What procedures do: ask the bus for datagrams, wait, start other procedures, report events.

mod future;
mod link;
mod mail;
mod registers;
mod wait;

use alloc::boxed::Box;
use alloc::rc::Rc;
use alloc::vec;
use alloc::vec::Vec;
use core::cell::RefCell;
use core::fmt;
use core::future::Future;

use ringcat_wire::address::{RegisterAddress, StationAddress, Wkc};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;

use super::reply::{BusError, Reply};
use super::shared::Shared;
use super::signal::Signal;
use super::transfer::Request;
use crate::board::Board;
use crate::event::history::History;
use crate::event::{Event, Occupant};
use crate::link::LinkSet;
use crate::ring::RingState;
use crate::time::Instant;
use future::TransferFuture;

/// The handle of a procedure to the bus.
#[derive(Clone)]
pub struct Bus {
    pub(super) shared: Rc<RefCell<Shared>>,
}

impl Bus {
    pub(super) fn new(shared: Rc<RefCell<Shared>>) -> Bus {
        Bus { shared }
    }

    /// The time of the call that lets the procedure run.
    pub fn now(&self) -> Instant {
        self.shared.borrow().now
    }

    /// The links the MainDevice has.
    pub fn links(&self) -> LinkSet {
        self.shared.borrow().links
    }

    /// State of the ring: as the exchange sees it once it runs, before that as acyclic frames show it.
    pub fn ring(&self) -> RingState {
        let shared = self.shared.borrow();
        match shared.board.as_ref().map(|board| board.ring().state) {
            None | Some(RingState::Unknown) => shared.monitor.state(),
            Some(state) => state,
        }
    }

    /// Whether the interfaces have carriers, by [`crate::link::Link::index`]; `None` where the links do not tell.
    pub fn carriers(&self) -> [Option<bool>; 2] {
        self.shared.borrow().carriers
    }

    /// What the exchange posts, once there is one.
    pub fn board(&self) -> Option<alloc::sync::Arc<Board>> {
        self.shared.borrow().board.clone()
    }

    /// Reports an event.
    pub fn report(&self, event: Event) {
        let shared = &mut *self.shared.borrow_mut();
        shared.events.push(shared.now, event);
    }

    /// Reports an event about a SubDevice of which it is known who it is.
    pub(crate) fn report_of(&self, event: Event, who: Occupant) {
        let shared = &mut *self.shared.borrow_mut();
        shared.events.push_of(shared.now, event, [Some(who), None]);
    }

    /// Says who is at the positions of the cabling: events that name some of these say whom they mean.
    pub(crate) fn set_occupants(&self, occupants: Vec<Occupant>) {
        self.shared.borrow_mut().events.set_occupants(occupants);
    }

    /// Who is at positions of the cabling.
    pub(crate) fn occupants(&self, positions: [Option<usize>; 2]) -> [Option<Occupant>; 2] {
        self.shared.borrow().events.occupants(positions)
    }

    /// What is remembered of the events.
    pub(crate) fn history<T>(&self, work: impl FnOnce(&mut History) -> T) -> T {
        work(self.shared.borrow_mut().events.history())
    }

    /// Sends a datagram as often as needed and returns what came back, whatever its working counter. `expected` is the
    /// working counter at which a second copy need not be waited for. Commands that read and write at once are sent
    /// once: a second time they would read what they wrote.
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

    /// Positions from here on live behind the redundant link (protocol CR-09). Broadcasts show it, too.
    pub(crate) fn set_main_count(&self, count: u16) {
        self.shared.borrow_mut().main_count = count;
    }

    /// Like [`Bus::transfer`], but sent once: for accesses that must not happen twice.
    pub fn transfer_once(
        &self,
        command: Command,
        target: Target,
        data: Vec<u8>,
    ) -> impl Future<Output = Result<Reply, BusError>> {
        self.submit(Request { expected: Some(Wkc(1)), ..Request::once(command, target, data) })
    }

    /// So many datagrams that read one byte of a register of all SubDevices, once, in a frame that holds nothing else.
    /// The reply is that of the last one.
    pub(crate) fn fill_frame(
        &self,
        register: RegisterAddress,
        datagrams: usize,
    ) -> impl Future<Output = Result<Reply, BusError>> {
        let before = datagrams.saturating_sub(1);
        self.submit(Request { before, ..Request::once(Command::Brd, Target::Broadcast(register), vec![0; 1]) })
    }

    /// How many datagrams a frame may hold as this MainDevice was told.
    pub(crate) fn max_datagrams(&self) -> usize {
        self.shared.borrow().max_datagrams
    }

    /// A datagram of the application's own: its answer is that of all copies, whatever its working counter. Where it
    /// may be sent again when its frame is lost, `resend` says so.
    pub fn datagram(
        &self,
        command: Command,
        target: Target,
        data: Vec<u8>,
        resend: bool,
    ) -> impl Future<Output = Result<Reply, BusError>> {
        self.submit(Request { resend, ..Request::once(command, target, data) })
    }

    /// Exchanges a register for other data: each SubDevice with this station address hands its old value on with the
    /// datagram, so that only the first one on each link gets what is sent there. Sent once.
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

    /// Hands the time of one SubDevice's clock to all others, once: on each link that of a station of its own. Where
    /// nobody on a link has the station, or before it does, SubDevices get `time`, which is right at `at`, as what it
    /// is when the frame leaves. `expected` as for [`Bus::transfer`].
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

    /// Something to wait for that another procedure brings about.
    pub fn signal(&self) -> Signal {
        Signal::new(self.shared.clone())
    }

    pub(super) fn submit(&self, mut request: Request) -> TransferFuture {
        // Clocks of both stubs are distributed on purpose: neither copy is the right one.
        if self.links() == LinkSet::Ring && request.redundant_station.is_none() && request.lead.is_none() {
            request.lead = request.witness();
        }
        TransferFuture::new(self.shared.clone(), request)
    }

    /// Starts a procedure that goes on by itself.
    pub fn spawn(&self, procedure: impl Future<Output = ()> + 'static) {
        self.shared.borrow_mut().spawn(Box::pin(procedure));
    }
}

impl fmt::Debug for Bus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Bus").finish_non_exhaustive()
    }
}
