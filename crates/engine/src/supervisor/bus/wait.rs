//! Waits for a time, with a time limit, or for several futures.

use alloc::vec::Vec;
use core::future::{Future, poll_fn};
use core::pin::{Pin, pin};
use core::task::Poll;
use core::time::Duration;

use ringcat_wire::address::Wkc;
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;

use super::Bus;
use super::future::TransferFuture;
use crate::supervisor::reply::{BusError, Elapsed, Reply};
use crate::supervisor::transfer::{Request, Rest};
use crate::time::Instant;

impl Bus {
    /// Waits.
    pub async fn sleep(&self, duration: Duration) {
        let until = self.now() + duration;
        self.sleep_until(until).await;
    }

    /// Waits until a time.
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

    /// Runs a future with a time limit; after the limit it is dropped, and its datagrams are abandoned.
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

    /// Runs two futures in parallel: their first datagrams are sent in one frame, if they fit, in their order.
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

    /// Sends datagrams in their order, possibly with other datagrams between them. Waits for all replies; returns the
    /// first error.
    pub async fn transfer_all(
        &self,
        datagrams: impl IntoIterator<Item = (Command, Target, Vec<u8>)>,
        expected: Option<Wkc>,
    ) -> Result<Vec<Reply>, BusError> {
        let requests = datagrams.into_iter().map(|(command, target, data)| Request {
            expected,
            resend: true,
            ..Request::once(command, target, data)
        });
        self.replies(requests).await
    }

    /// Sends datagrams in one frame, before all queued datagrams, and again in one frame if it is lost. Waits for all
    /// replies; returns the first error. Datagrams that do not fit into one frame, or are more than
    /// [`Bus::max_datagrams`], take several frames.
    pub(crate) async fn transfer_together(
        &self,
        datagrams: impl IntoIterator<Item = (Command, Target, Vec<u8>)>,
        expected: Option<Wkc>,
    ) -> Result<Vec<Reply>, BusError> {
        let mut requests: Vec<Request> = datagrams
            .into_iter()
            .map(|(command, target, data)| Request {
                expected,
                resend: true,
                urgent: true,
                ..Request::once(command, target, data)
            })
            .collect();
        let mut rest = Rest::NONE;
        for request in requests.iter_mut().rev() {
            request.rest = rest;
            rest = request.group();
        }
        self.replies(requests).await
    }

    async fn replies(&self, requests: impl IntoIterator<Item = Request>) -> Result<Vec<Reply>, BusError> {
        let mut waiting: Vec<TransferFuture> = requests.into_iter().map(|request| self.submit(request)).collect();
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
}

fn ready<T>(poll: Poll<T>) -> Option<T> {
    match poll {
        Poll::Ready(value) => Some(value),
        Poll::Pending => None,
    }
}
