//! SDO requests that a cyclic thread makes and re-uses (000 5.8, seed 004): no allocation, no lock, no waiting.
//!
//! A request has its own memory of a size given at its creation. The cyclic side owns it while it is not busy: it may
//! change object and timeout, put in data, start it. The acyclic half takes it up, and gives it back with a result. Both
//! sides talk through words; whoever has the request is said by its state.

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::sync::atomic::{AtomicU8, AtomicU32, AtomicU64, Ordering};
use core::time::Duration;

use ringcat_wire::mailbox::sdo::AbortCode;

const UNUSED: u8 = 0;
const READ_ASKED: u8 = 1;
const WRITE_ASKED: u8 = 2;
const RUNNING: u8 = 3;
const SUCCESS: u8 = 4;
const ERROR: u8 = 5;

const ABORTED: u64 = 1;
const TIMEOUT: u64 = 2;
const TOO_LONG: u64 = 3;
const FAILED: u64 = 4;

/// How far a request is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RequestState {
    /// It was not started, or changed since.
    Unused,
    /// It is under way: nothing about it can be changed.
    Busy,
    /// It has worked; what was read is there.
    Success,
    /// It has failed.
    Error,
}

/// Why a request failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RequestFailure {
    /// The SubDevice aborted.
    Aborted(AbortCode),
    /// It took longer than its timeout.
    Timeout,
    /// The object has more bytes than the request has room for.
    TooLong,
    /// The SubDevice is not there, or its mailbox failed.
    Failed,
}

/// Why a request cannot be changed or started.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RequestRefused {
    /// It is under way.
    Busy,
    /// The data is longer than its memory.
    TooLong {
        /// Bytes of the data.
        bytes: usize,
        /// Bytes of the memory.
        limit: usize,
    },
}

#[derive(Debug)]
struct Slot {
    subdevice: usize,
    state: AtomicU8,
    /// Index, subindex, complete access: 16, 8, 1 bits.
    object: AtomicU32,
    timeout_us: AtomicU32,
    length: AtomicU32,
    /// Kind in the upper half, abort code in the lower.
    failure: AtomicU64,
    data: Box<[AtomicU8]>,
}

/// The side of the application. It may be moved to the cyclic thread.
#[derive(Debug)]
pub struct SdoRequest {
    slot: Arc<Slot>,
}

/// The side of the acyclic half.
#[derive(Clone, Debug)]
pub(crate) struct Served {
    slot: Arc<Slot>,
}

/// What is asked for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Order {
    pub subdevice: usize,
    pub index: u16,
    pub sub_index: u8,
    pub complete_access: bool,
    pub timeout: Duration,
    /// What to write; `None` reads.
    pub data: Option<Vec<u8>>,
    /// Bytes that fit.
    pub room: usize,
}

/// Time that a request takes at most where nothing else was said.
const DEFAULT_TIMEOUT: Duration = Duration::from_secs(1);

/// A request of `size` bytes for an object of a declared SubDevice, and its other side.
pub(crate) fn request(subdevice: usize, size: usize) -> (SdoRequest, Served) {
    let slot = Arc::new(Slot {
        subdevice,
        state: AtomicU8::new(UNUSED),
        object: AtomicU32::new(0),
        timeout_us: AtomicU32::new(DEFAULT_TIMEOUT.as_micros() as u32),
        length: AtomicU32::new(0),
        failure: AtomicU64::new(0),
        data: (0..size).map(|_| AtomicU8::new(0)).collect(),
    });
    (SdoRequest { slot: slot.clone() }, Served { slot })
}

impl SdoRequest {
    /// How far it is.
    pub fn state(&self) -> RequestState {
        match self.slot.state.load(Ordering::Acquire) {
            UNUSED => RequestState::Unused,
            SUCCESS => RequestState::Success,
            ERROR => RequestState::Error,
            _ => RequestState::Busy,
        }
    }

    fn check(&self) -> Result<(), RequestRefused> {
        if self.state() == RequestState::Busy { Err(RequestRefused::Busy) } else { Ok(()) }
    }

    /// Turns to another object of the same SubDevice.
    pub fn set_object(&mut self, index: u16, sub_index: u8, complete_access: bool) -> Result<(), RequestRefused> {
        self.check()?;
        let word = u32::from(index) << 16 | u32::from(sub_index) << 8 | u32::from(complete_access);
        self.slot.object.store(word, Ordering::Relaxed);
        self.slot.state.store(UNUSED, Ordering::Release);
        Ok(())
    }

    /// Sets the time that the request may take in all, for all later uses, up to an hour.
    pub fn set_timeout(&mut self, timeout: Duration) -> Result<(), RequestRefused> {
        self.check()?;
        let micros = timeout.as_micros().clamp(1, 3_600_000_000) as u32;
        self.slot.timeout_us.store(micros, Ordering::Relaxed);
        Ok(())
    }

    /// Starts to read.
    pub fn read(&mut self) -> Result<(), RequestRefused> {
        self.check()?;
        self.slot.state.store(READ_ASKED, Ordering::Release);
        Ok(())
    }

    /// Starts to write.
    pub fn write(&mut self, data: &[u8]) -> Result<(), RequestRefused> {
        self.check()?;
        self.slot.put(data)?;
        self.slot.state.store(WRITE_ASKED, Ordering::Release);
        Ok(())
    }

    /// Bytes that were read or written last.
    pub fn len(&self) -> usize {
        self.slot.length.load(Ordering::Relaxed) as usize
    }

    /// Whether nothing was read or written.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Copies the data out, as much as fits, and returns how much that is. Nothing while the request is busy.
    pub fn data(&self, out: &mut [u8]) -> usize {
        if self.state() == RequestState::Busy {
            return 0;
        }
        let count = self.len().min(out.len());
        for (to, from) in out[..count].iter_mut().zip(&self.slot.data) {
            *to = from.load(Ordering::Relaxed);
        }
        count
    }

    /// Why it failed, where it did.
    pub fn failure(&self) -> Option<RequestFailure> {
        if self.state() != RequestState::Error {
            return None;
        }
        let word = self.slot.failure.load(Ordering::Relaxed);
        Some(match word >> 32 {
            ABORTED => RequestFailure::Aborted(AbortCode(word as u32)),
            TIMEOUT => RequestFailure::Timeout,
            TOO_LONG => RequestFailure::TooLong,
            _ => RequestFailure::Failed,
        })
    }
}

impl Slot {
    fn put(&self, data: &[u8]) -> Result<(), RequestRefused> {
        let limit = self.data.len();
        if data.len() > limit {
            return Err(RequestRefused::TooLong { bytes: data.len(), limit });
        }
        for (to, from) in self.data.iter().zip(data) {
            to.store(*from, Ordering::Relaxed);
        }
        self.length.store(data.len() as u32, Ordering::Relaxed);
        Ok(())
    }
}

impl Served {
    /// Whether nobody has the other side any more.
    pub(crate) fn is_abandoned(&self) -> bool {
        Arc::strong_count(&self.slot) == 1
    }

    /// Takes the request up, where it was started.
    pub(crate) fn take(&self) -> Option<Order> {
        let slot = &*self.slot;
        let asked = slot.state.load(Ordering::Acquire);
        if asked != READ_ASKED && asked != WRITE_ASKED {
            return None;
        }
        slot.state.store(RUNNING, Ordering::Relaxed);
        let object = slot.object.load(Ordering::Relaxed);
        let length = slot.length.load(Ordering::Relaxed) as usize;
        let data = || slot.data[..length].iter().map(|byte| byte.load(Ordering::Relaxed)).collect();
        Some(Order {
            subdevice: slot.subdevice,
            index: (object >> 16) as u16,
            sub_index: (object >> 8) as u8,
            complete_access: object & 1 != 0,
            timeout: Duration::from_micros(slot.timeout_us.load(Ordering::Relaxed).into()),
            data: (asked == WRITE_ASKED).then(data),
            room: slot.data.len(),
        })
    }

    /// Gives the request back: with what was read, empty for a write.
    pub(crate) fn succeed(&self, read: Option<&[u8]>) {
        let fits = read.is_none_or(|data| self.slot.put(data).is_ok());
        if fits {
            self.slot.state.store(SUCCESS, Ordering::Release);
        } else {
            self.fail(RequestFailure::TooLong);
        }
    }

    /// Gives the request back.
    pub(crate) fn fail(&self, failure: RequestFailure) {
        let word = match failure {
            RequestFailure::Aborted(code) => ABORTED << 32 | u64::from(code.0),
            RequestFailure::Timeout => TIMEOUT << 32,
            RequestFailure::TooLong => TOO_LONG << 32,
            RequestFailure::Failed => FAILED << 32,
        };
        self.slot.failure.store(word, Ordering::Relaxed);
        self.slot.state.store(ERROR, Ordering::Release);
    }

    /// Gives the request back where it waits or runs: nobody will serve it any more.
    pub(crate) fn end(&self) {
        if matches!(self.slot.state.load(Ordering::Acquire), READ_ASKED | WRITE_ASKED | RUNNING) {
            self.fail(RequestFailure::Failed);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec;

    #[test]
    fn a_request_goes_to_the_other_side_and_comes_back_with_what_was_read() {
        let (mut request, served) = request(3, 8);
        assert_eq!((request.state(), served.take()), (RequestState::Unused, None));
        request.set_object(0x2000, 7, true).unwrap();
        request.set_timeout(Duration::from_millis(5)).unwrap();
        request.read().unwrap();
        assert_eq!(request.state(), RequestState::Busy);
        let order = served.take().unwrap();
        assert_eq!((order.subdevice, order.index, order.sub_index, order.complete_access), (3, 0x2000, 7, true));
        assert_eq!((order.timeout, order.data, order.room), (Duration::from_millis(5), None, 8));
        assert_eq!(served.take(), None, "once");
        assert_eq!(request.read(), Err(RequestRefused::Busy));
        assert_eq!(request.set_object(1, 1, false), Err(RequestRefused::Busy));
        served.succeed(Some(&[1, 2, 3]));
        let mut out = [0; 8];
        assert_eq!((request.state(), request.data(&mut out)), (RequestState::Success, 3));
        assert_eq!(out[..3], [1, 2, 3]);
        request.set_object(0x2001, 0, false).unwrap();
        assert_eq!(request.state(), RequestState::Unused);
    }

    #[test]
    fn data_that_has_no_room_is_refused_and_failures_are_named() {
        let (mut request, served) = request(0, 2);
        assert_eq!(request.write(&[1, 2, 3]), Err(RequestRefused::TooLong { bytes: 3, limit: 2 }));
        request.write(&[1, 2]).unwrap();
        assert_eq!(served.take().unwrap().data, Some(vec![1, 2]));
        served.fail(RequestFailure::Aborted(AbortCode::READ_ONLY));
        assert_eq!(request.failure(), Some(RequestFailure::Aborted(AbortCode::READ_ONLY)));
        request.read().unwrap();
        served.take().unwrap();
        served.succeed(Some(&[1, 2, 3]));
        assert_eq!(request.failure(), Some(RequestFailure::TooLong));
        request.read().unwrap();
        served.end();
        assert_eq!(request.failure(), Some(RequestFailure::Failed));
        assert!(!served.is_abandoned());
        drop(request);
        assert!(served.is_abandoned());
    }
}
