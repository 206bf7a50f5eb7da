//! Serving the SDO requests of cyclic threads ([`crate::sdo_request`]).

use alloc::rc::Rc;
use alloc::vec::Vec;
use core::cell::RefCell;
use core::time::Duration;

use super::fleet::SharedFleet;
use crate::mail::coe::{self, SdoAddress, SdoError, SdoFailure};
use crate::mail::{Mailbox, MailboxError};
use crate::sdo_request::{Order, RequestFailure, Served};
use crate::supervisor::Bus;

/// Pause between two looks at the requests.
const PAUSE: Duration = Duration::from_micros(500);

/// The requests that exist. A request whose other side is gone is forgotten.
#[derive(Clone, Debug, Default)]
pub(crate) struct Requests {
    all: Rc<RefCell<Vec<Served>>>,
}

impl Requests {
    pub(crate) fn add(&self, served: Served) {
        self.all.borrow_mut().push(served);
    }

    /// Nobody serves them any more.
    pub(crate) fn end(&self) {
        self.all.borrow().iter().for_each(Served::end);
    }

    fn asked(&self) -> Vec<(Served, Order)> {
        let mut all = self.all.borrow_mut();
        all.retain(|served| !served.is_abandoned());
        all.iter().filter_map(|served| Some((served.clone(), served.take()?))).collect()
    }
}

/// Runs for ever.
pub(crate) async fn serve_requests(bus: Bus, fleet: SharedFleet, requests: Requests) {
    loop {
        bus.sleep(PAUSE).await;
        for (served, order) in requests.asked() {
            let mailbox = fleet.mailbox(order.subdevice);
            bus.spawn(serve(bus.clone(), served, order, mailbox));
        }
    }
}

async fn serve(bus: Bus, served: Served, order: Order, mailbox: Option<Mailbox>) {
    let Some(mailbox) = mailbox else { return served.fail(RequestFailure::Failed) };
    let timeout = order.timeout;
    let work = async {
        let Order { index, sub_index, complete_access, .. } = order;
        let object = SdoAddress { index, sub_index, complete_access };
        // The whole has a limit; no part of it needs a shorter one.
        let limits = (timeout, timeout);
        match &order.data {
            Some(data) => coe::write(&mailbox, object, data, limits).await.map(|()| None),
            None => coe::read(&mailbox, object, limits, order.room).await.map(Some),
        }
    };
    match bus.within(timeout, work).await {
        Ok(Ok(read)) => served.succeed(read.as_deref()),
        Ok(Err(error)) => served.fail(failure(&error)),
        Err(_) => served.fail(RequestFailure::Timeout),
    }
}

fn failure(error: &SdoError) -> RequestFailure {
    match error.cause {
        SdoFailure::Aborted(code) => RequestFailure::Aborted(code),
        SdoFailure::TooLong(_) => RequestFailure::TooLong,
        SdoFailure::Mailbox(MailboxError::NoAnswer { .. } | MailboxError::Full { .. }) => RequestFailure::Timeout,
        SdoFailure::Mailbox(_)
        | SdoFailure::Toggle
        | SdoFailure::EmptySegment
        | SdoFailure::Size { .. }
        | SdoFailure::UnknownSize
        | SdoFailure::SourceEnded { .. } => RequestFailure::Failed,
    }
}
