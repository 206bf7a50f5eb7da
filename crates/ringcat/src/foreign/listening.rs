//! What has arrived on the links of a segment before the first frame.

use std::fmt;
use std::hash::{BuildHasher, RandomState};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::{ForeignFrame, LISTEN};

/// Two MainDevices that begin at the same time do not listen equally long: the one that listens longer receives the
/// other. Up to this time is added.
const SPREAD: Duration = Duration::from_millis(250);
/// Interval of checks of a thread that waits.
const LOOK: Duration = Duration::from_millis(1);

/// The sockets with which a segment is listened to.
pub trait ListeningSockets: fmt::Debug + Send + Sync {
    /// The number of times that they were bound to an interface; `None` while one is not bound to an interface that is
    /// there, and receives nothing.
    fn binding(&self) -> Option<u32>;
}

/// Whether a segment may be driven.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ListeningPhase {
    /// No link has a carrier: no frame can arrive.
    NoCarrier,
    /// Frames are listened for.
    Listening,
    /// Another MainDevice drives it, whose first frame was this.
    Occupied(ForeignFrame),
    /// No frame has arrived for long enough: the segment is driven.
    Free,
}

/// What has arrived on the links of a segment; shared with other threads, and kept while the segment passes from one
/// process to another.
#[derive(Debug)]
pub struct ListeningState {
    phase: Mutex<ListeningPhase>,
    lasts: Duration,
}

impl Default for ListeningState {
    /// No frame has arrived yet.
    fn default() -> ListeningState {
        let random = RandomState::new().hash_one(0_u8);
        let spread = SPREAD.as_nanos() as u64;
        ListeningState::lasting(LISTEN + Duration::from_nanos(random % spread))
    }
}

impl ListeningState {
    /// No frame has arrived yet; the listening takes this time.
    pub fn lasting(lasts: Duration) -> ListeningState {
        ListeningState { phase: Mutex::new(ListeningPhase::NoCarrier), lasts }
    }

    /// A segment that nothing else can drive.
    pub fn not_shared() -> ListeningState {
        ListeningState { phase: Mutex::new(ListeningPhase::Free), lasts: Duration::ZERO }
    }

    fn lock(&self) -> MutexGuard<'_, ListeningPhase> {
        self.phase.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether the segment may be driven.
    pub fn phase(&self) -> ListeningPhase {
        *self.lock()
    }

    /// The first frame of the MainDevice that drives the segment.
    pub fn foreign_frame(&self) -> Option<ForeignFrame> {
        match self.phase() {
            ListeningPhase::Occupied(frame) => Some(frame),
            _ => None,
        }
    }

    /// Waits until the listening ends, up to this limit.
    pub fn wait(&self, limit: Duration) {
        let begin = Instant::now();
        while self.phase() == ListeningPhase::Listening && begin.elapsed() < limit {
            std::thread::sleep(LOOK);
        }
    }

    /// An application drives the segment from now on.
    pub fn set_free(&self) {
        self.set(ListeningPhase::Free);
    }

    /// Other links are used from now on.
    pub fn forget(&self) {
        self.set(ListeningPhase::NoCarrier);
    }

    pub(super) fn set(&self, phase: ListeningPhase) {
        *self.lock() = phase;
    }

    /// How long the listening takes.
    pub(super) const fn lasts(&self) -> Duration {
        self.lasts
    }
}
