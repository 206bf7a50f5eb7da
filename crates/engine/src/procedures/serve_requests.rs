//! Serves the requests of cyclic threads ([`crate::request`]).

use alloc::rc::Rc;
use alloc::vec::Vec;
use core::cell::RefCell;
use core::future::poll_fn;
use core::pin::pin;
use core::task::Poll;

use ringcat_wire::address::{RegisterAddress, StationAddress};
use ringcat_wire::mailbox::soe::{Idn, SoeElements};

use super::services::registers::{self, Urgency};
use super::shared_segment::SharedSegment;
use crate::declared::Address;
use crate::mail::coe::{self, SdoAddress, SdoError, SdoFailure};
use crate::mail::soe::{self, SoeAddress, SoeError, SoeFailure};
use crate::mail::voe::{self, Voe};
use crate::mail::{Limits, Mailbox, MailboxError};
use crate::request::{Access, AcyclicSide, Order, RequestFailure, RetryRequest, Subject};
use crate::request_counter::RequestCounter;
use crate::role::Function;
use crate::segment::Observation;
use crate::supervisor::{Bus, Signal};
use crate::time::Instant;

/// Open requests. A request whose handle was dropped is removed.
#[derive(Clone, Debug)]
pub(crate) struct Requests {
    all: Rc<RefCell<Vec<AcyclicSide>>>,
    retry: RetryRequest,
    request_counter: RequestCounter,
}

impl Default for Requests {
    fn default() -> Requests {
        let request_counter = RequestCounter::default();
        Requests { all: Rc::default(), retry: RetryRequest::new(request_counter.clone()), request_counter }
    }
}

impl Requests {
    pub(crate) fn add(&self, served: AcyclicSide) {
        let mut all = self.all.borrow_mut();
        all.retain(|served| !served.is_abandoned());
        all.push(served);
    }

    /// Signalled by requests that are started or cancelled.
    pub(crate) fn request_counter(&self) -> &RequestCounter {
        &self.request_counter
    }

    /// The request of a cyclic thread to repeat failed configurations.
    pub(crate) fn retry(&self) -> &RetryRequest {
        &self.retry
    }

    /// Fails the requests that wait or are under way. A request for another attempt ends with its application.
    pub(crate) fn end(&self) {
        self.retry.take();
        self.all.borrow().iter().for_each(AcyclicSide::end);
    }

    fn ordered(&self) -> Vec<(AcyclicSide, Order)> {
        let mut all = self.all.borrow_mut();
        all.retain(|served| !served.is_abandoned());
        all.iter().filter_map(|served| Some((served.clone(), served.take()?))).collect()
    }

    fn any_cancelled(&self) -> bool {
        self.all.borrow().iter().any(AcyclicSide::is_cancelled)
    }
}

/// Runs until the MainDevice stops.
pub(crate) async fn serve_requests(bus: Bus, segment: SharedSegment, requests: Requests) {
    let (cancelled, posted_requests) = (bus.signal(), bus.signal());
    loop {
        let posted = bus.posted();
        if requests.any_cancelled() {
            cancelled.notify();
        }
        if requests.retry.take() {
            segment.observe(Observation::Retried(None));
        }
        for (served, order) in requests.ordered() {
            match target(&segment, order.subdevice) {
                Some(target) => {
                    bus.spawn(serve(bus.clone(), segment.clone(), served, order, target, cancelled.clone()))
                }
                None => served.fail(RequestFailure::Failed),
            }
        }
        bus.until_posted(posted, Instant::NEVER, &posted_requests, || false).await;
    }
}

/// The station address and the mailbox of a SubDevice.
fn target(segment: &SharedSegment, subdevice: Address) -> Option<(StationAddress, Mailbox)> {
    let view = segment.view();
    let found = view.find(subdevice)?;
    view.station(found).zip(segment.mailbox_of(found))
}

/// Result of a successful request: data of a read, and the subject of the data.
type Done = (Option<Vec<u8>>, Option<Subject>);

async fn serve(
    bus: Bus,
    segment: SharedSegment,
    served: AcyclicSide,
    order: Order,
    target: (StationAddress, Mailbox),
    cancelled: Signal,
) {
    let result = {
        let mut work = pin!(bus.within(order.timeout, execute(&bus, &segment, &order, target)));
        let mut cancel = pin!(cancelled.until(|| served.is_cancelled().then_some(())));
        poll_fn(|context| {
            if cancel.as_mut().poll(context).is_ready() {
                return Poll::Ready(Err(RequestFailure::Cancelled));
            }
            work.as_mut().poll(context).map(|result| result.unwrap_or(Err(RequestFailure::Timeout)))
        })
        .await
    };
    match result {
        Ok((read, answered)) => served.succeed(read.as_deref(), answered),
        Err(failure) => served.fail(failure),
    }
}

async fn execute(
    bus: &Bus,
    segment: &SharedSegment,
    order: &Order,
    target: (StationAddress, Mailbox),
) -> Result<Done, RequestFailure> {
    let (station, mailbox) = target;
    // The request as a whole has a limit; its parts need no shorter one.
    let limits = Limits::new(order.timeout, order.timeout);
    let read = match order.subject {
        Subject::Object { index, sub_index, complete_access } => {
            object(&mailbox, SdoAddress { index, sub_index, complete_access }, order, limits).await?
        }
        Subject::Register { address, length } => {
            register(bus, segment, station, RegisterAddress(address), length, order).await?
        }
        Subject::Idn { drive, idn, elements } => {
            let address = SoeAddress { drive, idn: Idn(idn), elements: SoeElements(elements) };
            element(&mailbox, address, order, limits).await?
        }
        Subject::Vendor { id, kind } => return message(&mailbox, (id, kind), order).await,
    };
    Ok((read, None))
}

async fn object(
    mailbox: &Mailbox,
    object: SdoAddress,
    order: &Order,
    limits: Limits,
) -> Result<Option<Vec<u8>>, RequestFailure> {
    let result = match &order.access {
        Access::Write(data) => coe::write(mailbox, object, data, limits).await.map(|()| None),
        Access::Read | Access::ReadDirectly => coe::read(mailbox, object, limits, order.capacity).await.map(Some),
    };
    result.map_err(|error| of_object(&error))
}

async fn register(
    bus: &Bus,
    segment: &SharedSegment,
    station: StationAddress,
    address: RegisterAddress,
    length: u16,
    order: &Order,
) -> Result<Option<Vec<u8>>, RequestFailure> {
    bus.permit(Function::Registers).map_err(|_| RequestFailure::Failed)?;
    let result = match &order.access {
        Access::Write(data) => {
            registers::write(bus, segment, station, address, data, Urgency::InOrder).await.map(|()| None)
        }
        Access::Read | Access::ReadDirectly => registers::read(bus, station, address, length.into()).await.map(Some),
    };
    result.map_err(|_| RequestFailure::Failed)
}

async fn element(
    mailbox: &Mailbox,
    address: SoeAddress,
    order: &Order,
    limits: Limits,
) -> Result<Option<Vec<u8>>, RequestFailure> {
    let result = match &order.access {
        Access::Write(data) => soe::write(mailbox, address, data, limits).await.map(|()| None),
        Access::Read | Access::ReadDirectly => soe::read(mailbox, address, limits, order.capacity).await.map(Some),
    };
    result.map_err(|error| of_element(&error))
}

async fn message(mailbox: &Mailbox, (id, kind): (u32, u16), order: &Order) -> Result<Done, RequestFailure> {
    let received = match &order.access {
        Access::Write(data) => {
            let message = Voe { vendor_id: id, vendor_type: kind, data: data.clone() };
            voe::send(mailbox, &message, order.timeout).await.map_err(of_mailbox)?;
            return Ok((None, None));
        }
        Access::Read => voe::receive(mailbox, order.timeout).await,
        Access::ReadDirectly => voe::receive_directly(mailbox, order.timeout).await,
    };
    let Voe { vendor_id, vendor_type, data } = received.map_err(of_mailbox)?;
    Ok((Some(data), Some(Subject::Vendor { id: vendor_id, kind: vendor_type })))
}

fn of_object(error: &SdoError) -> RequestFailure {
    match error.cause {
        SdoFailure::Aborted(code) => RequestFailure::Aborted(code),
        SdoFailure::TooLong(_) => RequestFailure::TooLong,
        SdoFailure::Mailbox(error) => of_mailbox(error),
        SdoFailure::Toggle
        | SdoFailure::EmptySegment
        | SdoFailure::Size { .. }
        | SdoFailure::UnknownSize
        | SdoFailure::SourceEnded { .. } => RequestFailure::Failed,
    }
}

fn of_element(error: &SoeError) -> RequestFailure {
    match error.cause {
        SoeFailure::Refused(code) => RequestFailure::Refused(code),
        SoeFailure::TooLong(_) => RequestFailure::TooLong,
        SoeFailure::Mailbox(error) => of_mailbox(error),
        SoeFailure::Drive | SoeFailure::Fragments { .. } => RequestFailure::Failed,
    }
}

fn of_mailbox(error: MailboxError) -> RequestFailure {
    match error {
        MailboxError::NoAnswer { .. } | MailboxError::Full { .. } => RequestFailure::Timeout,
        MailboxError::Bus(_)
        | MailboxError::NotPermitted(_)
        | MailboxError::Closed
        | MailboxError::TooLong { .. }
        | MailboxError::Error(_) => RequestFailure::Failed,
    }
}
