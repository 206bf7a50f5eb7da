//! A request, from any thread, to repeat failed configurations.

use alloc::sync::Arc;
use core::sync::atomic::{AtomicBool, Ordering};

use crate::request_counter::RequestCounter;

/// Requests another attempt of failed configurations, for a cyclic thread.
#[derive(Clone, Debug)]
pub struct RetryRequest {
    requested: Arc<AtomicBool>,
    request_counter: RequestCounter,
}

impl RetryRequest {
    pub(crate) fn new(request_counter: RequestCounter) -> RetryRequest {
        RetryRequest { requested: Arc::default(), request_counter }
    }

    /// Requests it: two atomic words, no allocation, no lock, no waiting. The acyclic half repeats the failed
    /// configurations of all SubDevices in one of its next turns, once for all requests until then.
    pub fn start(&self) {
        self.requested.store(true, Ordering::Release);
        self.request_counter.increment();
    }

    /// Takes the request.
    pub(crate) fn take(&self) -> bool {
        self.requested.load(Ordering::Relaxed) && self.requested.swap(false, Ordering::Acquire)
    }
}
