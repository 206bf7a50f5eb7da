//! Taps of all threads that see the frames of a MainDevice, and their one reader. The reader may come and go while the
//! threads run.
//!
//! In: frames, from one [`Tap`] per thread. Out: a [`FrameReader`], in any thread. A tap without a reader costs one
//! load per frame. The queues are allocated when the first reader comes, by the reader's thread, and kept for later
//! readers; a tap copies a frame into its queue and returns: no allocation, lock or system call. Frames that find it
//! full are counted.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{SystemTime, UNIX_EPOCH};

use super::frame_queue::{Consumer, FrameNote, Producer, Queue};
use crate::pcapng::Direction;

/// Memory of a tap: a tenth of a second of one direction at 1 Gbit/s, many seconds of usual traffic.
const QUEUE_BYTES: usize = 16 << 20;

/// The queue of a tap, once there was a reader.
#[derive(Debug)]
struct End {
    bytes: usize,
    queue: OnceLock<Arc<Queue>>,
}

#[derive(Debug)]
struct Shared {
    interfaces: usize,
    /// There is a reader, and its queues are allocated.
    is_on: AtomicBool,
    ends: Mutex<Ends>,
    /// Unix time minus the time of the frames; unset if the clock was never set.
    clock: OnceLock<u64>,
}

#[derive(Debug, Default)]
struct Ends {
    all: Vec<Arc<End>>,
    is_read: bool,
}

impl Shared {
    fn ends(&self) -> MutexGuard<'_, Ends> {
        self.ends.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn allocate(&self, end: &End) -> Arc<Queue> {
        end.queue.get_or_init(|| Arc::new(Queue::new(end.bytes, self.interfaces))).clone()
    }
}

/// The taps of a MainDevice. Clones are the same taps.
#[derive(Clone, Debug)]
pub struct Taps(Arc<Shared>);

/// Another reader reads these taps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AlreadyRead;

impl std::fmt::Display for AlreadyRead {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("another reader takes the frames of these taps: end it first")
    }
}

impl std::error::Error for AlreadyRead {}

impl Taps {
    /// Taps of a number of interfaces. Nothing is recorded until there is a reader.
    pub fn new(interfaces: usize) -> Taps {
        Taps(Arc::new(Shared {
            interfaces,
            is_on: AtomicBool::new(false),
            ends: Mutex::default(),
            clock: OnceLock::new(),
        }))
    }

    /// A tap for one more thread. Allocates: not for the cyclic path.
    pub fn tap(&self) -> Tap {
        self.tap_with(QUEUE_BYTES)
    }

    /// As [`Taps::tap`], with a queue of at least `bytes`.
    pub fn tap_with(&self, bytes: usize) -> Tap {
        let end = Arc::new(End { bytes, queue: OnceLock::new() });
        let mut ends = self.0.ends();
        if ends.is_read {
            self.0.allocate(&end);
        } else {
            // Taps that are gone. A reader still has their last frames.
            ends.all.retain(|end| Arc::strong_count(end) > 1);
        }
        ends.all.push(end.clone());
        drop(ends);
        Tap { shared: self.0.clone(), end, frames: None, to_unix_ns: 0 }
    }

    /// Number of interfaces.
    pub fn interfaces(&self) -> usize {
        self.0.interfaces
    }

    /// Begins to record, for one reader. Allocates the queues that are missing.
    ///
    /// # Errors
    /// There is a reader.
    pub fn read(&self) -> Result<FrameReader, AlreadyRead> {
        let mut ends = self.0.ends();
        if std::mem::replace(&mut ends.is_read, true) {
            return Err(AlreadyRead);
        }
        ends.all.retain(|end| Arc::strong_count(end) > 1);
        let queues = ends.all.iter().map(|end| Waiting::new(Consumer::new(self.0.allocate(end)))).collect();
        drop(ends);
        self.0.is_on.store(true, Ordering::Release);
        Ok(FrameReader { shared: self.0.clone(), queues, lost_with_taps: vec![0; self.0.interfaces] })
    }
}

/// Adds the frames of one thread.
#[derive(Debug)]
pub struct Tap {
    shared: Arc<Shared>,
    end: Arc<End>,
    /// Set at the first frame with a reader.
    frames: Option<Producer>,
    /// Offset from the time of the frames to Unix time.
    to_unix_ns: u64,
}

impl Tap {
    /// Sets the clock of the frame times by its current value. The first tap that does so sets it for all taps. Without
    /// it, times are Unix time.
    pub fn set_clock(&mut self, now_ns: u64) {
        self.to_unix_ns = *self.shared.clock.get_or_init(|| unix_now_ns().wrapping_sub(now_ns));
    }

    /// Whether there is a reader.
    #[inline]
    pub fn is_read(&self) -> bool {
        self.shared.is_on.load(Ordering::Relaxed)
    }

    /// Adds a frame of the interface at this position in the list of interfaces, if there is a reader. Does not
    /// allocate or wait.
    #[inline]
    pub fn record(&mut self, interface: usize, direction: Direction, time_ns: u64, frame: &[u8]) {
        if self.shared.is_on.load(Ordering::Relaxed) {
            self.add(interface, direction, time_ns, frame, frame.len());
        }
    }

    /// As [`Tap::record`], for a frame of which only the beginning is available; `length` is that of the whole frame.
    pub fn record_beginning(
        &mut self,
        interface: usize,
        direction: Direction,
        time_ns: u64,
        beginning: &[u8],
        length: usize,
    ) {
        if self.shared.is_on.load(Ordering::Relaxed) {
            self.add(interface, direction, time_ns, beginning, length);
        }
    }

    #[cold]
    fn add(&mut self, interface: usize, direction: Direction, time_ns: u64, beginning: &[u8], length: usize) {
        let time_ns = time_ns.wrapping_add(self.to_unix_ns);
        if self.frames.is_none() {
            self.frames = self.end.queue.get().cloned().map(Producer::new);
        }
        if let Some(frames) = &mut self.frames {
            // The queue counts frames that do not fit.
            frames.push(FrameNote { interface, direction, time_ns, length }, beginning);
        }
    }
}

pub(super) fn unix_now_ns() -> u64 {
    // A clock before 1970 was never set.
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.as_nanos() as u64)
}

/// A queue with its end one reading ago.
#[derive(Debug)]
struct Waiting {
    queue: Consumer,
    due: u64,
}

impl Waiting {
    fn new(queue: Consumer) -> Waiting {
        Waiting { due: 0, queue }
    }
}

/// Takes the frames of all taps. Nothing is recorded any more once it is dropped.
#[derive(Debug)]
pub struct FrameReader {
    shared: Arc<Shared>,
    /// The queues of all taps, in the order of the taps.
    queues: Vec<Waiting>,
    /// Lost frames of taps that are gone, by interface.
    lost_with_taps: Vec<u64>,
}

impl FrameReader {
    /// Takes the frames that have waited since the last call, in the order of their times: by now, older frames of
    /// other threads are in their queues too. Ends early with the first error of `take`; that frame is gone.
    ///
    /// # Errors
    /// The error of `take`.
    pub fn read<E>(&mut self, take: impl FnMut(FrameNote, &[u8]) -> Result<(), E>) -> Result<(), E> {
        self.take(false, take)
    }

    /// Takes all frames that wait, in the order of their times as far as they are there.
    ///
    /// # Errors
    /// The error of `take`.
    pub fn read_all<E>(&mut self, take: impl FnMut(FrameNote, &[u8]) -> Result<(), E>) -> Result<(), E> {
        self.take(true, take)
    }

    /// Number of taps that are read; those that are gone are read until their queues are empty.
    pub fn taps(&self) -> usize {
        self.queues.len()
    }

    /// Frames of an interface that did not fit since this reader began.
    pub fn lost(&self, interface: usize) -> u64 {
        let gone = self.lost_with_taps.get(interface).copied().unwrap_or(0);
        gone + self.queues.iter().map(|waiting| waiting.queue.lost(interface)).sum::<u64>()
    }

    fn take<E>(&mut self, all: bool, mut take: impl FnMut(FrameNote, &[u8]) -> Result<(), E>) -> Result<(), E> {
        self.follow_taps();
        let mut frame = Vec::new();
        let ends: Vec<u64> = self.queues.iter().map(|waiting| waiting.queue.end()).collect();
        if all {
            for (waiting, end) in self.queues.iter_mut().zip(&ends) {
                waiting.due = *end;
            }
        }
        let mut result = Ok(());
        while result.is_ok() && self.queues.iter().any(|waiting| waiting.queue.is_before(waiting.due)) {
            let ends_of = self.queues.iter_mut().zip(&ends);
            let oldest =
                ends_of.filter_map(|(waiting, end)| Some((waiting.queue.oldest(*end)?, &mut waiting.queue, *end)));
            let Some((_, queue, end)) = oldest.min_by_key(|(time, ..)| *time) else { break };
            let Some(note) = queue.pop(end, &mut frame) else { break };
            result = take(note, &frame);
        }
        for (waiting, end) in self.queues.iter_mut().zip(&ends) {
            waiting.due = *end;
        }
        result
    }

    /// Takes over the queues of new taps, and frees the empty ones of taps that are gone.
    fn follow_taps(&mut self) {
        let FrameReader { shared, queues, lost_with_taps } = self;
        let mut ends = shared.ends();
        for at in (0..queues.len()).rev() {
            // First the count: the last frames of a tap are in its queue when it is gone.
            let is_gone = Arc::strong_count(&ends.all[at]) == 1;
            if is_gone && !queues[at].queue.is_before(queues[at].queue.end()) {
                ends.all.remove(at);
                let gone = queues.remove(at).queue;
                lost_with_taps.iter_mut().enumerate().for_each(|(interface, lost)| *lost += gone.lost(interface));
            }
        }
        queues.extend(ends.all[queues.len()..].iter().map(|end| Waiting::new(Consumer::first(shared.allocate(end)))));
    }
}

impl Drop for FrameReader {
    fn drop(&mut self) {
        self.shared.is_on.store(false, Ordering::Release);
        self.shared.ends().is_read = false;
    }
}
