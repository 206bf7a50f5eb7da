//! Asks, from any thread, that failed configurations are repeated.

use alloc::sync::Arc;
use core::sync::atomic::{AtomicBool, Ordering};

use crate::bell::Bell;

/// Requests another attempt of failed configurations, for a cyclic thread.
#[derive(Clone, Debug, Default)]
pub struct RetryRequest {
    wanted: Arc<AtomicBool>,
    bell: Bell,
}

impl RetryRequest {
    pub(crate) fn new(bell: Bell) -> RetryRequest {
        RetryRequest { wanted: Arc::default(), bell }
    }

    /// Requests it: two atomic words, no allocation, no lock, no waiting. The acyclic half repeats the failed
    /// configurations of all SubDevices in one of its next turns, once for all requests until then.
    pub fn start(&self) {
        self.wanted.store(true, Ordering::Release);
        self.bell.ring();
    }

    /// Takes the request.
    pub(crate) fn take(&self) -> bool {
        self.wanted.load(Ordering::Relaxed) && self.wanted.swap(false, Ordering::Acquire)
    }
}
