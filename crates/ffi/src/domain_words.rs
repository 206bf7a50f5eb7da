//! State of a domain for readers in any thread, and its memory.

use std::sync::atomic::{AtomicBool, AtomicPtr, AtomicU32, AtomicUsize, Ordering};

use ringcat::{DomainState as EngineState, DomainStatus};

use crate::types::DomainState;

/// Words of a domain.
#[derive(Debug, Default)]
pub struct DomainWords {
    working_counter: AtomicU32,
    state: AtomicU32,
    is_open_ring: AtomicBool,
    memory: AtomicPtr<u8>,
    bytes: AtomicUsize,
}

impl DomainWords {
    /// Posts the result of a cycle.
    #[inline(always)]
    pub fn post(&self, status: &DomainStatus, is_open_ring: bool) {
        let state = match status.state {
            _ if status.wkc == 0 => 0,
            EngineState::Complete => 2,
            EngineState::Incomplete | EngineState::Zero => 1,
        };
        self.working_counter.store(status.wkc, Ordering::Relaxed);
        self.state.store(state, Ordering::Relaxed);
        self.is_open_ring.store(is_open_ring, Ordering::Relaxed);
    }

    /// The result of the last cycle.
    pub fn state(&self) -> DomainState {
        DomainState {
            working_counter: self.working_counter.load(Ordering::Relaxed),
            wc_state: self.state.load(Ordering::Relaxed) as i32,
            redundancy_active: self.is_open_ring.load(Ordering::Relaxed).into(),
        }
    }

    /// Sets the memory of the image.
    pub fn set_memory(&self, memory: *mut u8) {
        self.memory.store(memory, Ordering::Release);
    }

    /// The memory of the image; null while no application is active, and for an empty image.
    pub fn memory(&self) -> *mut u8 {
        self.memory.load(Ordering::Acquire)
    }

    /// Sets the size of the image.
    pub fn set_bytes(&self, bytes: usize) {
        self.bytes.store(bytes, Ordering::Release);
    }

    /// Bytes of the image, as registered so far.
    pub fn bytes(&self) -> usize {
        self.bytes.load(Ordering::Acquire)
    }
}
