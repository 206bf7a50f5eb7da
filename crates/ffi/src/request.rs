//! Requests of C: a request of the engine with memory that C reads and writes.
//!
//! The memory stays in place as long as the handle lives. C fills it before a write, and finds read data in it once the
//! state is asked for.

use std::ops::DerefMut;
use std::sync::atomic::{AtomicU8, AtomicU32, AtomicUsize, Ordering};
use std::time::Duration;

use ringcat::{Request, RequestRefused, RequestState};

use crate::claim::Claim;
use crate::code::{Code, Outcome};

/// Limit without one: the longest that the engine keeps.
const NO_LIMIT: Duration = Duration::from_secs(3600);

/// A request with memory for C.
#[derive(Debug)]
pub struct Requested<T> {
    used: Claim<Used<T>>,
    memory: Box<[AtomicU8]>,
    length: AtomicUsize,
    state: AtomicU32,
}

#[derive(Debug)]
struct Used<T> {
    request: T,
    /// A read is under way: its data is still to be copied to C's memory.
    reads: bool,
    copy: Box<[u8]>,
}

impl<T: DerefMut<Target = Request>> Requested<T> {
    /// A request with `size` bytes.
    pub fn new(request: T, size: usize) -> Requested<T> {
        Requested {
            used: Claim::new(Used { request, reads: false, copy: vec![0; size].into() }),
            memory: (0..size).map(|_| AtomicU8::new(0)).collect(),
            length: AtomicUsize::new(size),
            state: AtomicU32::new(0),
        }
    }

    /// The memory.
    pub fn memory(&self) -> *mut u8 {
        self.memory.as_ptr().cast_mut().cast()
    }

    /// Bytes of the memory.
    pub fn capacity(&self) -> usize {
        self.memory.len()
    }

    /// Bytes of the last read or write; at first all.
    pub fn length(&self) -> usize {
        self.length.load(Ordering::Relaxed)
    }

    /// `ec_request_state_t`: 0 unused, 1 busy, 2 success, 3 error. While another thread uses the request, the state
    /// before.
    pub fn state(&self) -> u32 {
        let now = self.used.use_now(|used| {
            let state = used.request.state();
            if used.reads && state == RequestState::Success {
                used.reads = false;
                let length = used.request.data(&mut used.copy);
                for (to, from) in self.memory.iter().zip(&used.copy[..length]) {
                    to.store(*from, Ordering::Relaxed);
                }
                self.length.store(length, Ordering::Relaxed);
            }
            match state {
                RequestState::Unused => 0,
                RequestState::Busy => 1,
                RequestState::Success => 2,
                RequestState::Error => 3,
            }
        });
        match now {
            Ok(state) => {
                self.state.store(state, Ordering::Relaxed);
                state
            }
            Err(_) => self.state.load(Ordering::Relaxed),
        }
    }

    /// Changes the target of the request.
    ///
    /// # Errors
    /// It is in progress, or in use by another thread.
    pub fn change<R>(&self, change: impl FnOnce(&mut T) -> Result<R, RequestRefused>) -> Outcome<R> {
        self.used.use_now(|used| change(&mut used.request))?.map_err(refusal)
    }

    /// Reads something of the request.
    ///
    /// # Errors
    /// It is in use by another thread.
    pub fn look<R>(&self, look: impl FnOnce(&T) -> R) -> Outcome<R> {
        self.used.use_now(|used| look(&used.request))
    }

    /// Sets the limit of the request in milliseconds; 0: none, which is an hour here.
    ///
    /// # Errors
    /// As [`Requested::change`].
    pub fn set_timeout(&self, milliseconds: u32) -> Outcome {
        let limit = Duration::from_millis(milliseconds.into());
        self.change(|request| request.set_timeout(if limit.is_zero() { NO_LIMIT } else { limit }))
    }

    /// Starts a read.
    ///
    /// # Errors
    /// As [`Requested::change`].
    pub fn read(&self, start: impl FnOnce(&mut T) -> Result<(), RequestRefused>) -> Outcome {
        self.used.use_now(|used| {
            start(&mut used.request).map_err(refusal)?;
            used.reads = true;
            Ok(())
        })?
    }

    /// Starts a write of the first `length` bytes of the memory.
    ///
    /// # Errors
    /// As [`Requested::change`]; no bytes, or more than there are.
    pub fn write(&self, length: usize, start: impl FnOnce(&mut T, &[u8]) -> Result<(), RequestRefused>) -> Outcome {
        if length == 0 {
            return Err(Code::INVALID);
        }
        if length > self.memory.len() {
            return Err(Code::NO_SPACE);
        }
        self.used.use_now(|used| {
            for (to, from) in used.copy.iter_mut().zip(&self.memory) {
                *to = from.load(Ordering::Relaxed);
            }
            start(&mut used.request, &used.copy[..length]).map_err(refusal)?;
            used.reads = false;
            self.length.store(length, Ordering::Relaxed);
            Ok(())
        })?
    }
}

fn refusal(refused: RequestRefused) -> Code {
    match refused {
        RequestRefused::Busy => Code::BUSY,
        RequestRefused::TooLong { .. } => Code::NO_SPACE,
        _ => Code::INVALID,
    }
}
