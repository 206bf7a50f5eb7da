//! Records frames into a capture file without delaying the threads that send and receive them.
//!
//! Input: frames, by one [`Tap`] per thread ([`Taps`]). Output: a pcapng file ([`crate::pcapng`]) written by a separate
//! thread, or the frames themselves ([`FrameReader`]). If a queue is full, the frame is not recorded; the file's
//! statistics count it (`isb_ifdrop`).

mod frame_queue;
mod frame_ring;
mod taps;

use std::error::Error;
use std::fmt;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use crate::pcapng::{Direction, Statistics, Writer};
use crate::realtime;
pub use frame_queue::FrameNote;
pub use frame_ring::FrameRing;
use taps::unix_now_ns;
pub use taps::{AlreadyRead, FrameReader, Tap, Taps};

/// Interval at which the file is written.
const PERIOD: Duration = Duration::from_millis(5);

/// Totals of an interface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
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
        io::ErrorKind::ResourceBusy => "end the other capture first",
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
    lost_by_kernel: Vec<AtomicU64>,
    end: AtomicBool,
    /// Why writing ended early.
    failure: OnceLock<String>,
}

/// A running capture. Dropping it completes the file.
#[derive(Debug)]
pub struct Recorder {
    taps: Taps,
    shared: Arc<Shared>,
    path: PathBuf,
    thread: Option<JoinHandle<io::Result<Vec<Recorded>>>>,
}

impl Recorder {
    /// Begins a capture of interfaces with these names and descriptions; an existing file is overwritten.
    pub fn start(path: &Path, interfaces: &[(&str, &str)]) -> Result<Recorder, RecorderError> {
        Recorder::of(&Taps::new(interfaces.len()), path, interfaces)
    }

    /// Begins a capture of what existing taps see, in operation or without an application; with the names and
    /// descriptions of their interfaces. The taps are free for another recorder when this one ends.
    ///
    /// # Errors
    /// The file cannot be written, or another reader reads these taps.
    pub fn of(taps: &Taps, path: &Path, interfaces: &[(&str, &str)]) -> Result<Recorder, RecorderError> {
        let failed = |error| RecorderError { path: path.to_owned(), error };
        let reader = taps.read().map_err(|error| failed(io::Error::new(io::ErrorKind::ResourceBusy, error)))?;
        let shared = Arc::new(Shared {
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
            let recorded = vec![Recorded::default(); seen.lost_by_kernel.len()];
            WritingThread { writer, shared: seen, reader, recorded }.write(describe_error)
        };
        let thread = thread::Builder::new().name("capture".to_owned()).spawn(write).map_err(failed)?;
        Ok(Recorder { taps: taps.clone(), shared, path: path.to_owned(), thread: Some(thread) })
    }

    /// A tap for one more thread. Allocates: not for the cyclic path.
    pub fn tap(&self) -> Tap {
        self.taps.tap()
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

/// The writing thread.
struct WritingThread<W: Write> {
    writer: Writer<W>,
    shared: Arc<Shared>,
    reader: FrameReader,
    recorded: Vec<Recorded>,
}

impl<W: Write> WritingThread<W> {
    fn write(mut self, describe: impl Fn(&io::Error) -> String) -> io::Result<Vec<Recorded>> {
        let mut result = Ok(());
        loop {
            let end = self.shared.end.load(Ordering::Acquire);
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
            recorded.lost = self.reader.lost(interface);
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

    /// Writes the frames of [`FrameReader::read`], or all. Writes nothing if writing has failed before.
    fn empty(&mut self, all: bool, write: bool) -> io::Result<()> {
        let WritingThread { writer, reader, recorded, .. } = self;
        let mut any = false;
        let take = |note: FrameNote, frame: &[u8]| {
            let FrameNote { interface, direction, time_ns, length } = note;
            // A wrong interface number is a caller's error; the frame is skipped.
            let Some(recorded) = recorded.get_mut(interface).filter(|_| write) else { return Ok(()) };
            match direction {
                Direction::In => recorded.received += 1,
                Direction::Out => recorded.sent += 1,
            }
            any = true;
            writer.beginning(interface, direction, time_ns, frame, length)
        };
        if all { reader.read_all(take) } else { reader.read(take) }?;
        if any { writer.flush() } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests;
