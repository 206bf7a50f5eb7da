//! Waiting for the reply to a datagram.

use alloc::rc::Rc;
use core::future::Future;
use core::pin::Pin;
use core::task::{Context, Poll};

use crate::supervisor::reply::{BusError, Reply};
use crate::supervisor::shared_cell::SharedCell;
use crate::supervisor::transfer::{Request, Stage, TransferId};

/// Waits for the reply to a datagram. When it is dropped earlier, the reply is discarded.
pub(in crate::supervisor) struct TransferFuture {
    shared: Rc<SharedCell>,
    request: Option<Request>,
    id: Option<TransferId>,
}

impl TransferFuture {
    pub(super) fn new(shared: Rc<SharedCell>, request: Request) -> TransferFuture {
        TransferFuture { shared, request: Some(request), id: None }
    }
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
