//! A counter that another thread increments, so that the acyclic half detects new requests without polling their slots.

use alloc::sync::Arc;
use core::sync::atomic::{AtomicU32, Ordering};

/// Incremented by any thread; the acyclic half compares it at its next poll.
#[derive(Clone, Debug, Default)]
pub(crate) struct RequestCounter(Arc<AtomicU32>);

impl RequestCounter {
    /// Increments the counter.
    pub fn increment(&self) {
        self.0.fetch_add(1, Ordering::Release);
    }

    /// The counter; it wraps around.
    #[inline]
    pub fn value(&self) -> u32 {
        self.0.load(Ordering::Acquire)
    }
}
