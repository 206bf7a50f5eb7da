//! Records frames into a capture file without delaying the threads that send and receive them.
//!
//! Input: frames, by one [`Tap`] per thread. Output: a pcapng file ([`crate::pcapng`]) written by a separate thread. A
//! tap copies a frame into a queue of fixed size and returns: no allocation, lock, file or system call. If the queue is
//! full, the frame is not recorded; the file's statistics count it (`isb_ifdrop`).

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
/// Interval at which the file is written.
const PERIOD: Duration = Duration::from_millis(5);

/// Totals of an interface.
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

/// Why there is no capture, or only a partial capture.
#[derive(Debug)]
#[non_exhaustive]
pub struct RecorderError {
    path: PathBuf,
    error: io::Error,
}

impl fmt::Display for RecorderError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&describe(&self.path, &self.error))
    }
}

/// Describes why a capture cannot be written, with advice.
fn describe(path: &Path, error: &io::Error) -> String {
    let advice = match error.kind() {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => "make room or take a file on another disk",
        io::ErrorKind::NotFound => "make its directory first",
        io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => "take a file that you may write",
        io::ErrorKind::IsADirectory => "name a file in it",
        _ => "what was written until then can be read",
    };
    format!("the capture {} cannot be written: {error}; {advice}", path.display())
}

impl Error for RecorderError {}

#[derive(Debug)]
struct Shared {
    interfaces: usize,
    /// Queues of taps that the writing thread has not taken over yet.
    new: Mutex<Vec<Consumer>>,
    /// Unix time minus the time of the frames; zero if the clock was never set.
    clock: OnceLock<u64>,
    lost_by_kernel: Vec<AtomicU64>,
    end: AtomicBool,
    /// Why writing ended early.
    failure: OnceLock<String>,
}

/// A running capture. Dropping it completes the file.
#[derive(Debug)]
pub struct Recorder {
    shared: Arc<Shared>,
    path: PathBuf,
    thread: Option<JoinHandle<io::Result<Vec<Recorded>>>>,
}

/// Adds the frames of one thread.
#[derive(Debug)]
pub struct Tap {
    shared: Arc<Shared>,
    frames: Producer,
    /// Offset from the time of the frames to Unix time.
    to_unix_ns: u64,
}

impl Recorder {
    /// Begins a capture of interfaces with these names and descriptions; an existing file is overwritten.
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
            let describe_error = |error: &io::Error| describe(&file_path, error);
            WritingThread { writer, shared: seen, queues: Vec::new(), frame: Vec::new(), recorded: Vec::new() }
                .write(describe_error)
        };
        let thread = thread::Builder::new().name("capture".to_owned()).spawn(write).map_err(failed)?;
        Ok(Recorder { shared, path: path.to_owned(), thread: Some(thread) })
    }

    /// A tap for one more thread. Allocates: not for the cyclic path.
    pub fn tap(&self) -> Tap {
        self.tap_with(QUEUE_BYTES)
    }

    fn tap_with(&self, queue_bytes: usize) -> Tap {
        let (frames, consumer) = frame_queue::queue(queue_bytes, self.shared.interfaces);
        self.shared.new.lock().unwrap_or_else(PoisonError::into_inner).push(consumer);
        Tap { shared: self.shared.clone(), frames, to_unix_ns: 0 }
    }

    /// Sets the number of frames of an interface that the kernel has lost so far.
    pub fn set_lost_by_kernel(&self, interface: usize, frames: u64) {
        if let Some(lost) = self.shared.lost_by_kernel.get(interface) {
            lost.store(frames, Ordering::Relaxed);
        }
    }

    /// Why writing has stopped, if it has. Not for the cyclic path.
    pub fn failure(&self) -> Option<&str> {
        self.shared.failure.get().map(String::as_str)
    }

    /// Completes the file with all frames that taps have added until now. Returns the totals by interface.
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
    /// Sets the clock of the frame times by its current value. The first tap that does so sets it for all taps. Without
    /// it, times are Unix time.
    pub fn set_clock(&mut self, now_ns: u64) {
        self.to_unix_ns = *self.shared.clock.get_or_init(|| unix_now_ns().wrapping_sub(now_ns));
    }

    /// Adds a frame of the interface at this position in the list of the recorder. Does not allocate or wait.
    #[inline]
    pub fn record(&mut self, interface: usize, direction: Direction, time_ns: u64, frame: &[u8]) {
        self.record_beginning(interface, direction, time_ns, frame, frame.len());
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
        let time_ns = time_ns.wrapping_add(self.to_unix_ns);
        // The queue counts frames that do not fit.
        self.frames.push(Note { interface, direction, time_ns, length }, beginning);
    }
}

fn unix_now_ns() -> u64 {
    // A clock before 1970 was never set.
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.as_nanos() as u64)
}

/// The writing thread.
struct WritingThread<W: Write> {
    writer: Writer<W>,
    shared: Arc<Shared>,
    /// Each queue with its end one period ago.
    queues: Vec<(Consumer, u64)>,
    frame: Vec<u8>,
    recorded: Vec<Recorded>,
}

impl<W: Write> WritingThread<W> {
    fn write(mut self, describe: impl Fn(&io::Error) -> String) -> io::Result<Vec<Recorded>> {
        self.recorded = vec![Recorded::default(); self.shared.interfaces];
        let mut result = Ok(());
        loop {
            let end = self.shared.end.load(Ordering::Acquire);
            self.queues
                .extend(self.shared.new.lock().unwrap_or_else(PoisonError::into_inner).drain(..).map(|q| (q, 0)));
            let written = self.empty(end, result.is_ok());
            if let (Ok(()), Err(error)) = (&result, &written) {
                // Only this thread sets it, once.
                let _ = self.shared.failure.set(describe(error));
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

    /// Writes the frames that were in the queues one period ago, ordered by time: by now, older frames of other threads
    /// are in their queues too. With `all`, writes all frames. Writes nothing if writing has failed before.
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
            // A wrong interface number is a caller's error; the frame is skipped.
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
