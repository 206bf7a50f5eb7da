//! A count that another thread raises, so that the acyclic half need not look for its requests again and again.

use alloc::sync::Arc;
use core::sync::atomic::{AtomicU32, Ordering};

/// Rung by any thread, heard by the acyclic half when it is polled next.
#[derive(Clone, Debug, Default)]
pub(crate) struct Bell(Arc<AtomicU32>);

impl Bell {
    /// Rings.
    pub fn ring(&self) {
        self.0.fetch_add(1, Ordering::Release);
    }

    /// How often it was rung; goes on at 0 behind the largest number.
    pub fn rung(&self) -> u32 {
        self.0.load(Ordering::Acquire)
    }
}
