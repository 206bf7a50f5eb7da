//! Memory of a request, and the words through which both sides communicate; the state shows which side owns the
//! request.

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, AtomicU64, Ordering};
use core::time::Duration;

use ringcat_wire::mailbox::sdo::AbortCode;

use crate::declared::Address;
use crate::request_counter::RequestCounter;
use ringcat_wire::mailbox::soe::SoeErrorCode;

const UNUSED: u8 = 0;
const READ_REQUESTED: u8 = 1;
const DIRECT_READ_REQUESTED: u8 = 2;
const WRITE_REQUESTED: u8 = 3;
const RUNNING: u8 = 4;
const SUCCESS: u8 = 5;
const ERROR: u8 = 6;

const ABORTED: u64 = 1;
const TIMEOUT: u64 = 2;
const TOO_LONG: u64 = 3;
const FAILED: u64 = 4;
const REFUSED: u64 = 5;
const CANCELLED: u64 = 6;

/// State of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RequestState {
    /// It was not started, or was changed after its last use.
    Unused,
    /// It is in progress: it cannot be changed.
    Busy,
    /// It succeeded; read data is available.
    Success,
    /// It failed.
    Error,
}

/// Why a request failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum RequestFailure {
    /// The SubDevice aborted the SDO transfer.
    Aborted(AbortCode),
    /// The drive refused the access to the IDN.
    Refused(SoeErrorCode),
    /// It took longer than its timeout.
    Timeout,
    /// The read data is longer than the memory of the request.
    TooLong,
    /// The SubDevice is absent, or its mailbox failed.
    Failed,
    /// It was cancelled.
    Cancelled,
}

/// Why a request cannot be changed or started.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum RequestRefused {
    /// It is in progress.
    Busy,
    /// The data is longer than its memory.
    TooLong {
        /// Bytes of the data.
        bytes: usize,
        /// Bytes of the memory.
        limit: usize,
    },
}

/// Target of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Subject {
    Object { index: u16, sub_index: u8, complete_access: bool },
    Register { address: u16, length: u16 },
    Idn { drive: u8, idn: u16, elements: u8 },
    Vendor { id: u32, kind: u16 },
}

impl Subject {
    const fn pack(self) -> u64 {
        match self {
            Subject::Object { index, sub_index, complete_access } => {
                (complete_access as u64) | (sub_index as u64) << 8 | (index as u64) << 16
            }
            Subject::Register { address, length } => 1 << 56 | address as u64 | (length as u64) << 16,
            Subject::Idn { drive, idn, elements } => {
                2 << 56 | idn as u64 | (elements as u64) << 16 | (drive as u64) << 24
            }
            Subject::Vendor { id, kind } => 3 << 56 | id as u64 | (kind as u64) << 32,
        }
    }

    const fn unpack(word: u64) -> Subject {
        match word >> 56 {
            1 => Subject::Register { address: word as u16, length: (word >> 16) as u16 },
            2 => Subject::Idn { drive: (word >> 24) as u8, idn: word as u16, elements: (word >> 16) as u8 },
            3 => Subject::Vendor { id: word as u32, kind: (word >> 32) as u16 },
            _ => Subject::Object {
                index: (word >> 16) as u16,
                sub_index: (word >> 8) as u8,
                complete_access: word & 1 != 0,
            },
        }
    }
}

/// Action.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Access {
    Read,
    /// Read without polling the mailbox's status.
    ReadDirectly,
    Write(Vec<u8>),
}

/// Target and action.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Order {
    pub subdevice: Address,
    pub subject: Subject,
    pub access: Access,
    pub timeout: Duration,
    /// Size of the memory in bytes.
    pub capacity: usize,
}

#[derive(Debug)]
struct Slot {
    subdevice: Address,
    state: AtomicU8,
    cancelled: AtomicBool,
    subject: AtomicU64,
    /// Header data of the answer.
    answered: AtomicU64,
    timeout_us: AtomicU32,
    length: AtomicU32,
    /// Kind in the upper half, code in the lower.
    failure: AtomicU64,
    data: Box<[AtomicU8]>,
    request_counter: RequestCounter,
}

/// Application side of a request of any kind.
#[derive(Debug)]
pub struct Request {
    slot: Arc<Slot>,
}

/// Acyclic side of a request.
#[derive(Clone, Debug)]
pub(crate) struct AcyclicSide {
    slot: Arc<Slot>,
}

/// Default time limit of a request.
const DEFAULT_TIMEOUT: Duration = Duration::from_secs(1);

/// A request with `size` bytes of memory to a SubDevice, and its acyclic side.
pub(super) fn pair(
    subdevice: Address,
    size: usize,
    subject: Subject,
    request_counter: &RequestCounter,
) -> (Request, AcyclicSide) {
    let slot = Arc::new(Slot {
        subdevice,
        state: AtomicU8::new(UNUSED),
        cancelled: AtomicBool::new(false),
        subject: AtomicU64::new(subject.pack()),
        answered: AtomicU64::new(0),
        timeout_us: AtomicU32::new(DEFAULT_TIMEOUT.as_micros() as u32),
        length: AtomicU32::new(0),
        failure: AtomicU64::new(0),
        data: (0..size).map(|_| AtomicU8::new(0)).collect(),
        request_counter: request_counter.clone(),
    });
    (Request { slot: slot.clone() }, AcyclicSide { slot })
}

impl Request {
    /// Its state.
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

    pub(super) fn set_subject(&mut self, subject: Subject) -> Result<(), RequestRefused> {
        self.check()?;
        self.slot.subject.store(subject.pack(), Ordering::Relaxed);
        self.slot.state.store(UNUSED, Ordering::Release);
        Ok(())
    }

    /// Sets the total time limit of the request for all later uses, up to an hour.
    ///
    /// # Errors
    /// It is in progress.
    pub fn set_timeout(&mut self, timeout: Duration) -> Result<(), RequestRefused> {
        self.check()?;
        let micros = timeout.as_micros().clamp(1, 3_600_000_000) as u32;
        self.slot.timeout_us.store(micros, Ordering::Relaxed);
        Ok(())
    }

    fn start(&mut self, requested: u8) {
        self.slot.cancelled.store(false, Ordering::Relaxed);
        self.slot.state.store(requested, Ordering::Release);
        self.slot.request_counter.increment();
    }

    pub(super) fn start_read(&mut self) -> Result<(), RequestRefused> {
        self.check()?;
        self.start(READ_REQUESTED);
        Ok(())
    }

    pub(super) fn start_read_directly(&mut self) -> Result<(), RequestRefused> {
        self.check()?;
        self.start(DIRECT_READ_REQUESTED);
        Ok(())
    }

    pub(super) fn start_write(&mut self, data: &[u8]) -> Result<(), RequestRefused> {
        self.check()?;
        self.slot.put(data)?;
        self.start(WRITE_REQUESTED);
        Ok(())
    }

    /// Ends a request in progress with [`RequestFailure::Cancelled`], as soon as the acyclic half handles it.
    pub fn cancel(&self) {
        if self.state() == RequestState::Busy {
            self.slot.cancelled.store(true, Ordering::Release);
            self.slot.request_counter.increment();
        }
    }

    pub(super) fn capacity(&self) -> usize {
        self.slot.data.len()
    }

    /// Number of bytes last read or written.
    pub fn len(&self) -> usize {
        self.slot.length.load(Ordering::Relaxed) as usize
    }

    /// Whether nothing was read or written.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Copies the data out, as much as fits, and returns its length. 0 while the request is busy.
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

    pub(super) fn answered(&self) -> Option<Subject> {
        let word = self.slot.answered.load(Ordering::Relaxed);
        (word != 0 && self.state() == RequestState::Success).then_some(Subject::unpack(word))
    }

    /// Reason of its failure, if it failed.
    pub fn failure(&self) -> Option<RequestFailure> {
        if self.state() != RequestState::Error {
            return None;
        }
        let word = self.slot.failure.load(Ordering::Relaxed);
        Some(match word >> 32 {
            ABORTED => RequestFailure::Aborted(AbortCode(word as u32)),
            REFUSED => RequestFailure::Refused(SoeErrorCode(word as u16)),
            TIMEOUT => RequestFailure::Timeout,
            TOO_LONG => RequestFailure::TooLong,
            CANCELLED => RequestFailure::Cancelled,
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

impl AcyclicSide {
    /// Whether the application side was dropped.
    pub(crate) fn is_abandoned(&self) -> bool {
        Arc::strong_count(&self.slot) == 1
    }

    /// Whether the application has cancelled a request in progress.
    pub(crate) fn is_cancelled(&self) -> bool {
        self.slot.cancelled.load(Ordering::Acquire)
    }

    /// Takes the request for execution, if it was started.
    pub(crate) fn take(&self) -> Option<Order> {
        let slot = &*self.slot;
        let length = slot.length.load(Ordering::Relaxed) as usize;
        let access = match slot.state.load(Ordering::Acquire) {
            READ_REQUESTED => Access::Read,
            DIRECT_READ_REQUESTED => Access::ReadDirectly,
            WRITE_REQUESTED => {
                Access::Write(slot.data[..length].iter().map(|byte| byte.load(Ordering::Relaxed)).collect())
            }
            _ => return None,
        };
        slot.state.store(RUNNING, Ordering::Relaxed);
        Some(Order {
            subdevice: slot.subdevice,
            subject: Subject::unpack(slot.subject.load(Ordering::Relaxed)),
            access,
            timeout: Duration::from_micros(slot.timeout_us.load(Ordering::Relaxed).into()),
            capacity: slot.data.len(),
        })
    }

    /// Returns the request as successful, with the read data (`None` for a write) and the header data of the answer.
    pub(crate) fn succeed(&self, read: Option<&[u8]>, answered: Option<Subject>) {
        let fits = read.is_none_or(|data| self.slot.put(data).is_ok());
        if fits {
            self.slot.answered.store(answered.map_or(0, Subject::pack), Ordering::Relaxed);
            self.slot.state.store(SUCCESS, Ordering::Release);
        } else {
            self.fail(RequestFailure::TooLong);
        }
    }

    /// Returns the request as failed.
    pub(crate) fn fail(&self, failure: RequestFailure) {
        let word = match failure {
            RequestFailure::Aborted(code) => ABORTED << 32 | u64::from(code.0),
            RequestFailure::Refused(code) => REFUSED << 32 | u64::from(code.0),
            RequestFailure::Timeout => TIMEOUT << 32,
            RequestFailure::TooLong => TOO_LONG << 32,
            RequestFailure::Failed => FAILED << 32,
            RequestFailure::Cancelled => CANCELLED << 32,
        };
        self.slot.failure.store(word, Ordering::Relaxed);
        self.slot.state.store(ERROR, Ordering::Release);
    }

    /// Returns a waiting or running request as failed: it will not be executed any more.
    pub(crate) fn end(&self) {
        let state = self.slot.state.load(Ordering::Acquire);
        if matches!(state, READ_REQUESTED | DIRECT_READ_REQUESTED | WRITE_REQUESTED | RUNNING) {
            self.fail(RequestFailure::Failed);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_target_of_a_request_fits_into_a_word() {
        for subject in [
            Subject::Object { index: 0x1C12, sub_index: 0xFE, complete_access: true },
            Subject::Object { index: 0, sub_index: 0, complete_access: false },
            Subject::Register { address: 0xFFFF, length: 0xFFFE },
            Subject::Idn { drive: 7, idn: 0xFEDC, elements: 0xFF },
            Subject::Vendor { id: 0xFFFF_FFFE, kind: 0xFFFD },
        ] {
            assert_eq!(Subject::unpack(subject.pack()), subject);
        }
    }
}
