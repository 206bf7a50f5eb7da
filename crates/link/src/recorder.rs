//! Recording frames into a capture file without holding up the threads that send and receive them.
//!
//! In go frames, by one [`Tap`] per thread; out comes a pcapng file ([`crate::pcapng`]) that a thread of its own
//! writes. A tap copies a frame into a queue of fixed size and returns: no allocation, lock, file or system call.
//! Frames that find the queue full are left out of the file, counted, and told in its statistics (`isb_ifdrop`).

mod frame_queue;

use std::error::Error;
use std::fmt;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use crate::pcapng::{Direction, Statistics, Writer};
use crate::realtime;
use frame_queue::{Consumer, Note, Producer};

/// Memory of a tap: a tenth of a second of one direction at 1 Gbit/s, many seconds of usual traffic.
const QUEUE_BYTES: usize = 16 << 20;
/// The file is written so often.
const PERIOD: Duration = Duration::from_millis(5);

/// What went by on an interface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Recorded {
    /// Frames received that are in the file.
    pub received: u64,
    /// Frames sent that are in the file.
    pub sent: u64,
    /// Frames that are not in the file because a queue was full.
    pub lost: u64,
    /// Frames that are not in the file because the kernel lost them.
    pub lost_by_kernel: u64,
}

/// Why there is no capture, or only a part of one.
#[derive(Debug)]
pub struct RecorderError {
    path: PathBuf,
    error: io::Error,
}

impl fmt::Display for RecorderError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&words(&self.path, &self.error))
    }
}

/// Why a capture cannot be written, and what to do about it.
fn words(path: &Path, error: &io::Error) -> String {
    let advice = match error.kind() {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => "make room or take a file on another disk",
        io::ErrorKind::NotFound => "make its directory first",
        io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => "take a file that you may write",
        io::ErrorKind::IsADirectory => "name a file in it",
        _ => "what was written until then can be read",
    };
    format!("the capture {} cannot be written: {error}; {advice}", path.display())
}

impl Error for RecorderError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        Some(&self.error)
    }
}

#[derive(Debug)]
struct Shared {
    interfaces: usize,
    /// Queues of taps that the writing thread has not seen yet.
    new: Mutex<Vec<Consumer>>,
    /// Unix time minus that of the frames; zero where the clock was never set.
    clock: OnceLock<u64>,
    lost_by_kernel: Vec<AtomicU64>,
    end: AtomicBool,
    /// Why writing ended early.
    failure: OnceLock<String>,
}

/// A capture in the making. Dropped, it completes the file.
#[derive(Debug)]
pub struct Recorder {
    shared: Arc<Shared>,
    path: PathBuf,
    thread: Option<JoinHandle<io::Result<Vec<Recorded>>>>,
}

/// Where one thread puts its frames.
#[derive(Debug)]
pub struct Tap {
    shared: Arc<Shared>,
    frames: Producer,
    /// What makes Unix time of the frames' time.
    to_unix_ns: u64,
}

impl Recorder {
    /// Begins a capture of interfaces with these names and descriptions in a file, which is overwritten.
    pub fn start(path: &Path, interfaces: &[(&str, &str)]) -> Result<Recorder, RecorderError> {
        let failed = |error| RecorderError { path: path.to_owned(), error };
        let shared = Arc::new(Shared {
            interfaces: interfaces.len(),
            new: Mutex::default(),
            clock: OnceLock::new(),
            lost_by_kernel: interfaces.iter().map(|_| AtomicU64::new(0)).collect(),
            end: AtomicBool::new(false),
            failure: OnceLock::new(),
        });
        let file = BufWriter::with_capacity(1 << 18, File::create(path).map_err(failed)?);
        let mut writer = Writer::new(file, interfaces).map_err(failed)?;
        writer.flush().map_err(failed)?;
        let seen = shared.clone();
        let file_path = path.to_owned();
        let write = move || {
            realtime::leave();
            let in_words = |error: &io::Error| words(&file_path, error);
            Scribe { writer, shared: seen, queues: Vec::new(), frame: Vec::new(), recorded: Vec::new() }.write(in_words)
        };
        let thread = thread::Builder::new().name("capture".to_owned()).spawn(write).map_err(failed)?;
        Ok(Recorder { shared, path: path.to_owned(), thread: Some(thread) })
    }

    /// Where one more thread puts its frames. Takes memory: not for the cyclic path.
    pub fn tap(&self) -> Tap {
        self.tap_with(QUEUE_BYTES)
    }

    fn tap_with(&self, queue_bytes: usize) -> Tap {
        let (frames, consumer) = frame_queue::queue(queue_bytes, self.shared.interfaces);
        self.shared.new.lock().unwrap_or_else(PoisonError::into_inner).push(consumer);
        Tap { shared: self.shared.clone(), frames, to_unix_ns: 0 }
    }

    /// Tells how many frames of an interface the kernel has lost so far.
    pub fn set_lost_by_kernel(&self, interface: usize, frames: u64) {
        if let Some(lost) = self.shared.lost_by_kernel.get(interface) {
            lost.store(frames, Ordering::Relaxed);
        }
    }

    /// Why nothing is written any more, as soon as that is so. Not for the cyclic path.
    pub fn failure(&self) -> Option<&str> {
        self.shared.failure.get().map(String::as_str)
    }

    /// Completes the file: everything that was put into taps until now is in it. What there was, by interface.
    pub fn finish(mut self) -> Result<Vec<Recorded>, RecorderError> {
        self.end().map_err(|error| RecorderError { path: self.path.clone(), error })
    }

    fn end(&mut self) -> io::Result<Vec<Recorded>> {
        self.shared.end.store(true, Ordering::Release);
        let Some(thread) = self.thread.take() else { return Ok(Vec::new()) };
        thread.thread().unpark();
        thread.join().unwrap_or_else(|_| Err(io::Error::other("the writing thread has panicked")))
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        // `finish` returns the result.
        let _ = self.end();
    }
}

impl Tap {
    /// Tells what the clock shows now that the frames' times are of. The first tap that does so sets it for all;
    /// without, times are Unix time.
    pub fn set_clock(&mut self, now_ns: u64) {
        self.to_unix_ns = *self.shared.clock.get_or_init(|| unix_now_ns().wrapping_sub(now_ns));
    }

    /// Adds a frame of the interface at this place of those that the recorder was given. Does not allocate or wait.
    #[inline]
    pub fn record(&mut self, interface: usize, direction: Direction, time_ns: u64, frame: &[u8]) {
        self.record_beginning(interface, direction, time_ns, frame, frame.len());
    }

    /// As [`Tap::record`], of a frame of which only the beginning is at hand; `length` is that of the whole.
    pub fn record_beginning(
        &mut self,
        interface: usize,
        direction: Direction,
        time_ns: u64,
        beginning: &[u8],
        length: usize,
    ) {
        let time_ns = time_ns.wrapping_add(self.to_unix_ns);
        // What does not fit is counted over there.
        self.frames.push(Note { interface, direction, time_ns, length }, beginning);
    }
}

fn unix_now_ns() -> u64 {
    // A clock before 1970 was never set.
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.as_nanos() as u64)
}

/// The thread that writes.
struct Scribe<W: Write> {
    writer: Writer<W>,
    shared: Arc<Shared>,
    /// Each with how far it was a period ago.
    queues: Vec<(Consumer, u64)>,
    frame: Vec<u8>,
    recorded: Vec<Recorded>,
}

impl<W: Write> Scribe<W> {
    fn write(mut self, in_words: impl Fn(&io::Error) -> String) -> io::Result<Vec<Recorded>> {
        self.recorded = vec![Recorded::default(); self.shared.interfaces];
        let mut result = Ok(());
        loop {
            let end = self.shared.end.load(Ordering::Acquire);
            self.queues
                .extend(self.shared.new.lock().unwrap_or_else(PoisonError::into_inner).drain(..).map(|q| (q, 0)));
            let written = self.empty(end, result.is_ok());
            if let (Ok(()), Err(error)) = (&result, &written) {
                // Only this thread sets it, and once.
                let _ = self.shared.failure.set(in_words(error));
            }
            result = result.and(written);
            if end {
                break;
            }
            thread::park_timeout(PERIOD);
        }
        result?;
        let now = unix_now_ns();
        for (interface, recorded) in self.recorded.iter_mut().enumerate() {
            recorded.lost = self.queues.iter().map(|(queue, _)| queue.lost(interface)).sum();
            recorded.lost_by_kernel = self.shared.lost_by_kernel[interface].load(Ordering::Relaxed);
            let statistics = Statistics {
                seen: recorded.received + recorded.sent + recorded.lost,
                dropped: recorded.lost,
                dropped_by_kernel: recorded.lost_by_kernel,
            };
            self.writer.statistics(interface, now, statistics)?;
        }
        self.writer.flush()?;
        Ok(self.recorded)
    }

    /// Writes what was in the queues a period ago, in the order of time: an older frame of another thread has got into
    /// its queue meanwhile. All there is in the end; nothing where writing has failed before.
    fn empty(&mut self, all: bool, write: bool) -> io::Result<()> {
        let ends: Vec<u64> = self.queues.iter().map(|(queue, _)| queue.end()).collect();
        if all {
            for ((_, due), end) in self.queues.iter_mut().zip(&ends) {
                *due = *end;
            }
        }
        let mut any = false;
        while self.queues.iter().any(|(queue, due)| queue.is_before(*due)) {
            let ends_of = self.queues.iter_mut().zip(&ends);
            let oldest = ends_of.filter_map(|((queue, _), end)| Some((queue.oldest(*end)?, queue, *end)));
            let Some((_, queue, end)) = oldest.min_by_key(|(time, ..)| *time) else { break };
            let Some(note) = queue.pop(end, &mut self.frame) else { break };
            if !write {
                continue;
            }
            let Note { interface, direction, time_ns, length } = note;
            // Only a mistaken caller names an interface that is not there.
            let Some(recorded) = self.recorded.get_mut(interface) else { continue };
            match direction {
                Direction::In => recorded.received += 1,
                Direction::Out => recorded.sent += 1,
            }
            self.writer.beginning(interface, direction, time_ns, &self.frame, length)?;
            any = true;
        }
        for ((_, due), end) in self.queues.iter_mut().zip(&ends) {
            *due = *end;
        }
        if any { self.writer.flush() } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests;
