//! What procedures do: ask the bus for datagrams, wait, start other procedures, report events.

use alloc::boxed::Box;
use alloc::rc::Rc;
use alloc::vec;
use alloc::vec::Vec;
use core::cell::RefCell;
use core::fmt;
use core::future::{Future, poll_fn};
use core::pin::{Pin, pin};
use core::task::{Context, Poll};
use core::time::Duration;

use ringcat_wire::address::{Position, RegisterAddress, StationAddress, Wkc};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::{MAX_DATA, OVERHEAD, Target};

use super::shared::Shared;
use super::signal::Signal;
use super::stray::Stray;
use super::transfer::{Request, Stage, TransferId};
use crate::board::Board;
use crate::event::history::History;
use crate::event::{Event, Occupant};
use crate::link::LinkSet;
use crate::ring::{RingState, Sequence};
use crate::time::Instant;

/// What a datagram brought back, merged from all copies.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Reply {
    /// The data; for writes, what was sent.
    pub data: Vec<u8>,
    /// Working counter of the copy sent on the main link.
    pub main: Wkc,
    /// Working counter of the copy sent on the redundant link.
    pub redundant: Wkc,
    /// OR of the ECAT event requests.
    pub irq: u16,
    /// The frame that it came with: datagrams of one frame were met at the same time.
    pub frame: Sequence,
    /// When that was handed to the links.
    pub sent_at: Instant,
}

impl Reply {
    /// Sum of the working counters (facts CR-05).
    pub const fn wkc(&self) -> Wkc {
        self.main.plus(self.redundant)
    }
}

/// Why a datagram brought nothing back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BusError {
    /// Its frame was lost, also when it was sent again.
    Lost {
        /// Whom it addressed.
        target: Target,
        /// How often it was sent again.
        retries: u8,
    },
    /// It is longer than a frame can carry.
    TooLong {
        /// Whom it addresses.
        target: Target,
        /// Bytes of data.
        length: usize,
    },
    /// Not the expected number of SubDevices answered.
    Wkc {
        /// Whom it addressed.
        target: Target,
        /// Expected.
        expected: Wkc,
        /// Came.
        got: Wkc,
    },
    /// It was to be alone on the wire, and that was never empty.
    Busy {
        /// Whom it addressed.
        target: Target,
    },
    /// It was to be alone on the wire, and the cyclic half sent meanwhile.
    Disturbed {
        /// Whom it addressed.
        target: Target,
    },
    /// An LRW of which both copies met somebody: neither has what the other one read (facts 9.2.2).
    Split {
        /// Whom it addressed.
        target: Target,
    },
}

impl BusError {
    /// The same of a datagram that was asked for with another target.
    #[must_use]
    pub(crate) fn asked_of(mut self, asked: Target) -> BusError {
        let (BusError::Lost { target, .. }
        | BusError::TooLong { target, .. }
        | BusError::Wkc { target, .. }
        | BusError::Busy { target }
        | BusError::Disturbed { target }
        | BusError::Split { target }) = &mut self;
        *target = asked;
        self
    }
}

impl fmt::Display for BusError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fn target(f: &mut fmt::Formatter<'_>, target: Target) -> fmt::Result {
            match target {
                Target::None => f.write_str("nobody"),
                Target::Position(position, register) => write!(f, "position {position}, register {register}"),
                Target::Station(station, register) => write!(f, "station {station}, register {register}"),
                Target::Broadcast(register) => write!(f, "all SubDevices, register {register}"),
                Target::Logical(address) => write!(f, "logical address {address}"),
            }
        }
        match self {
            BusError::Lost { target: whom, retries } => {
                target(f, *whom)?;
                write!(f, ": the frame was lost, {} times", u16::from(*retries) + 1)
            }
            BusError::TooLong { target: whom, length } => {
                target(f, *whom)?;
                write!(f, ": {length} bytes, a datagram carries at most {MAX_DATA}")
            }
            BusError::Wkc { target: whom, expected, got } => {
                target(f, *whom)?;
                write!(f, ": expected working counter {expected}, got {got}")
            }
            BusError::Busy { target: whom } => {
                target(f, *whom)?;
                f.write_str(": other frames are on the wire all the time")
            }
            BusError::Disturbed { target: whom } => {
                target(f, *whom)?;
                f.write_str(": process data was on the wire beside the frame")
            }
            BusError::Split { target: whom } => {
                target(f, *whom)?;
                f.write_str(
                    ": an LRW on two links met SubDevices with both copies, so that half of them is missing in each",
                )
            }
        }
    }
}

impl core::error::Error for BusError {}

/// A time limit ran out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Elapsed;

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
    /// working counter at which a second copy need not be waited for. Commands that read and write at once are sent once:
    /// a second time they would read what they wrote.
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

    /// Positions from here on live behind the redundant link (facts CR-09). Broadcasts show it, too.
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

    /// So many datagrams that read one byte of a register of all SubDevices, once, in a frame that holds nothing else. The
    /// reply is that of the last one.
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

    /// A datagram of the application's own: its answer is that of all copies, whatever its working counter. Where it may
    /// be sent again when its frame is lost, `resend` says so.
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

    /// Hands the time of one SubDevice's clock to all others, once: on each link that of a station of its own. Where nobody
    /// on a link has the station, or before it does, SubDevices get `time`, which is right at `at`, as what it is when the frame
    /// leaves. `expected` as for [`Bus::transfer`].
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

    /// Writes a mailbox of `size` bytes, once: its beginning and its last byte, which hands it over, in one frame
    /// (facts 6.1). The working counter is that of the last byte.
    pub fn write_mail(
        &self,
        station: StationAddress,
        register: RegisterAddress,
        mail: Vec<u8>,
        size: u16,
    ) -> impl Future<Output = Result<Reply, BusError>> {
        let at = |offset: u16| Target::Station(station, register.offset(offset));
        let (command, expected) = (Command::Fpwr, Some(Wkc(1)));
        // A second datagram has a cost of its own.
        let (lead, target, data) = if mail.len() + OVERHEAD < usize::from(size) {
            (Some((command, at(0), mail)), at(size - 1), vec![0; 1])
        } else {
            let mut whole = mail;
            whole.resize(usize::from(size), 0);
            (None, at(0), whole)
        };
        self.submit(Request { expected, lead, ..Request::once(command, target, data) })
    }

    /// Reads a mailbox, once. What a second copy reads, and what comes back late, is kept for [`Bus::stray_mail`].
    pub fn read_mail(
        &self,
        station: StationAddress,
        register: RegisterAddress,
        length: usize,
    ) -> impl Future<Output = Result<Reply, BusError>> {
        let (target, data) = (Target::Station(station, register), vec![0; length]);
        let (command, expected, mail) = (Command::Fprd, Some(Wkc(1)), Some(station));
        self.submit(Request { expected, mail, ..Request::once(command, target, data) })
    }

    /// The oldest mail of a SubDevice that came back when nobody waited for it any more.
    pub fn stray_mail(&self, station: StationAddress) -> Option<Stray> {
        self.shared.borrow_mut().strays.take(station)
    }

    /// Whether there is such a mail.
    pub fn has_stray_mail(&self, station: StationAddress) -> bool {
        self.shared.borrow().strays.has(station)
    }

    /// Stray mails of all SubDevices that nobody fetched in time.
    pub fn stray_mails_dropped(&self) -> u64 {
        self.shared.borrow().strays.dropped()
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
        TransferFuture { shared: self.shared.clone(), request: Some(request), id: None }
    }

    /// Reads registers of all SubDevices, ORed.
    pub async fn brd(&self, register: RegisterAddress, length: usize) -> Result<Reply, BusError> {
        self.transfer(Command::Brd, Target::Broadcast(register), vec![0; length], None).await
    }

    /// Writes registers of all SubDevices.
    pub async fn bwr(&self, register: RegisterAddress, data: &[u8]) -> Result<Reply, BusError> {
        self.transfer(Command::Bwr, Target::Broadcast(register), data.to_vec(), None).await
    }

    /// Reads registers of the SubDevice at a position, which must answer.
    pub async fn aprd(
        &self,
        position: Position,
        register: RegisterAddress,
        length: usize,
    ) -> Result<Vec<u8>, BusError> {
        self.one(Command::Aprd, Target::Position(position, register), vec![0; length]).await
    }

    /// Writes registers of the SubDevice at a position, which must answer.
    pub async fn apwr(&self, position: Position, register: RegisterAddress, data: &[u8]) -> Result<(), BusError> {
        self.one(Command::Apwr, Target::Position(position, register), data.to_vec()).await.map(drop)
    }

    /// Reads registers of a SubDevice, which must answer.
    pub async fn fprd(
        &self,
        station: StationAddress,
        register: RegisterAddress,
        length: usize,
    ) -> Result<Vec<u8>, BusError> {
        self.one(Command::Fprd, Target::Station(station, register), vec![0; length]).await
    }

    /// Reads `N` bytes of registers of a SubDevice, which must answer.
    pub async fn fprd_array<const N: usize>(
        &self,
        station: StationAddress,
        register: RegisterAddress,
    ) -> Result<[u8; N], BusError> {
        let data = self.fprd(station, register, N).await?;
        let mut array = [0; N];
        array.copy_from_slice(&data[..N]);
        Ok(array)
    }

    /// Writes registers of a SubDevice, which must answer.
    pub async fn fpwr(&self, station: StationAddress, register: RegisterAddress, data: &[u8]) -> Result<(), BusError> {
        self.one(Command::Fpwr, Target::Station(station, register), data.to_vec()).await.map(drop)
    }

    async fn one(&self, command: Command, target: Target, data: Vec<u8>) -> Result<Vec<u8>, BusError> {
        let expected = Wkc(1);
        let reply = self.transfer(command, target, data, Some(expected)).await?;
        if reply.wkc() == expected { Ok(reply.data) } else { Err(BusError::Wkc { target, expected, got: reply.wkc() }) }
    }

    /// Waits.
    pub async fn sleep(&self, duration: Duration) {
        let until = self.now() + duration;
        self.sleep_until(until).await;
    }

    /// Waits until a point of time.
    pub async fn sleep_until(&self, until: Instant) {
        let mut armed = false;
        poll_fn(|_| {
            let shared = &mut *self.shared.borrow_mut();
            if shared.now >= until {
                return Poll::Ready(());
            }
            if !armed {
                shared.wake_at(until);
                armed = true;
            }
            Poll::Pending
        })
        .await;
    }

    /// Lets a future run at most for a time; then it is dropped, and what it asked of the bus is abandoned.
    pub async fn within<F: Future>(&self, limit: Duration, future: F) -> Result<F::Output, Elapsed> {
        let mut future = pin!(future);
        let until = self.now() + limit;
        let mut armed = false;
        poll_fn(|context| {
            if let Poll::Ready(output) = future.as_mut().poll(context) {
                return Poll::Ready(Ok(output));
            }
            let shared = &mut *self.shared.borrow_mut();
            if shared.now >= until {
                return Poll::Ready(Err(Elapsed));
            }
            if !armed {
                shared.wake_at(until);
                armed = true;
            }
            Poll::Pending
        })
        .await
    }

    /// Runs two futures at once: what both ask of the bus first leaves in one frame, if it fits, in their order.
    pub async fn both<A: Future, B: Future>(&self, first: A, second: B) -> (A::Output, B::Output) {
        let (mut first, mut second) = (pin!(first), pin!(second));
        let (mut a, mut b) = (None, None);
        poll_fn(|context| {
            if a.is_none() {
                a = ready(first.as_mut().poll(context));
            }
            if b.is_none() {
                b = ready(second.as_mut().poll(context));
            }
            match (a.take(), b.take()) {
                (Some(first), Some(second)) => Poll::Ready((first, second)),
                (one, other) => {
                    (a, b) = (one, other);
                    Poll::Pending
                }
            }
        })
        .await
    }

    /// Sends datagrams at once, in one frame if they fit, and waits for all replies; the first error counts.
    pub async fn transfer_all(
        &self,
        datagrams: impl IntoIterator<Item = (Command, Target, Vec<u8>)>,
        expected: Option<Wkc>,
    ) -> Result<Vec<Reply>, BusError> {
        let mut waiting: Vec<TransferFuture> = Vec::new();
        for (command, target, data) in datagrams {
            waiting.push(self.submit(Request { expected, resend: true, ..Request::once(command, target, data) }));
        }
        let mut results: Vec<Option<Result<Reply, BusError>>> = waiting.iter().map(|_| None).collect();
        poll_fn(|context| {
            for (future, result) in waiting.iter_mut().zip(&mut results) {
                if result.is_none() {
                    *result = ready(Pin::new(future).poll(context));
                }
            }
            if results.iter().all(Option::is_some) { Poll::Ready(()) } else { Poll::Pending }
        })
        .await;
        results.into_iter().flatten().collect()
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

fn ready<T>(poll: Poll<T>) -> Option<T> {
    match poll {
        Poll::Ready(value) => Some(value),
        Poll::Pending => None,
    }
}

/// Waits for the reply to a datagram. Dropped before, the reply is thrown away when it comes.
pub(super) struct TransferFuture {
    shared: Rc<RefCell<Shared>>,
    request: Option<Request>,
    id: Option<TransferId>,
}

impl Future for TransferFuture {
    type Output = Result<Reply, BusError>;

    fn poll(mut self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<Self::Output> {
        let this = &mut *self;
        let shared = &mut *this.shared.borrow_mut();
        if let Some(request) = this.request.take() {
            this.id = Some(shared.request(request));
            return Poll::Pending;
        }
        let Some(id) = this.id else { return Poll::Pending };
        let Some(transfer) = shared.transfers.find(id) else { return Poll::Pending };
        if !matches!(transfer.stage, Stage::Done(_)) {
            // The future may have moved to another task since it was first polled.
            transfer.task = shared.current;
            return Poll::Pending;
        }
        this.id = None;
        match shared.transfers.remove(id).map(|transfer| transfer.stage) {
            Some(Stage::Done(result)) => Poll::Ready(result),
            _ => Poll::Pending,
        }
    }
}

impl Drop for TransferFuture {
    fn drop(&mut self) {
        if let Some(id) = self.id {
            self.shared.borrow_mut().abandon(id);
        }
    }
}
