//! The frames of the last seconds before a fault, as a capture file.
//!
//! In: the frames that [`Taps`] see, taken from them ten times a second by the thread of the bus log; events; requests
//! of users. Out: files for Wireshark (pcapng), and a line for the operator about each. Without a fault and a request
//! nothing is written. The cyclic path copies a frame into the queue of its tap, and does nothing else.

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::fmt;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use ringcat_control::settings::DebugRing;
use ringcat_engine::domain::DomainState;
use ringcat_engine::event::Event;
use ringcat_link::operator::Priority;
use ringcat_link::recorder::{FrameReader, FrameRing};
use ringcat_link::{AlreadyRead, FrameNote, Taps};

use super::debug_interfaces::DebugInterfaces;
use super::record_files::{RecordFiles, RecordReason};
use crate::record_requests::{RecordRequests, Written, WrittenRecord};

/// Frames of this time behind a fault are in its file.
const AFTER: Duration = Duration::from_millis(200);
/// After a file faults cause no other one for this time.
const PAUSE: Duration = Duration::from_secs(10);
/// A domain that stays incomplete for this time is a fault, however many cycles that are.
const INTERRUPTION: Duration = Duration::from_millis(100);
/// What the interfaces are to the MainDevice.
const DESCRIPTIONS: [&str; 2] = ["main link", "redundant link"];

/// A line for the operator.
type Line = (Priority, String);

/// What is known of the working counter of a domain.
#[derive(Clone, Copy, Debug, Default)]
struct Counted {
    was_complete: bool,
    incomplete_since: Option<Instant>,
}

/// When a file of a master was written last: it outlasts the records of those that drive it in turn.
#[derive(Clone, Debug, Default)]
pub struct LastWritten(Arc<Mutex<Option<Instant>>>);

impl LastWritten {
    fn at(&self) -> Option<Instant> {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn set(&self, now: Instant) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(now);
    }
}

/// Why the last frames cannot be recorded.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum RecordError {
    /// Something else reads the taps.
    AlreadyRead(AlreadyRead),
    /// There is not so much memory, in bytes.
    Memory(u64),
}

impl fmt::Display for RecordError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            RecordError::AlreadyRead(error) => error.fmt(f),
            RecordError::Memory(bytes) => write!(f, "there is no memory for 2 * {bytes} bytes of frames"),
        }
    }
}

impl std::error::Error for RecordError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            RecordError::AlreadyRead(error) => Some(error),
            RecordError::Memory(_) => None,
        }
    }
}

/// A recording of the last seconds that goes on until it is dropped.
#[derive(Debug)]
pub struct FrameRecord {
    reader: FrameReader,
    ring: FrameRing,
    /// Takes the place of `ring` while that is written.
    spare: Option<FrameRing>,
    settings: DebugRing,
    master: u32,
    names: Vec<String>,
    domains: BTreeMap<usize, Counted>,
    /// A fault, and when its file is written.
    due: Option<(RecordReason, Instant)>,
    last_written: LastWritten,
    writing: Option<JoinHandle<(Line, FrameRing)>>,
    /// Where users request a file.
    requests: RecordRequests,
    requested: Receiver<Sender<Written>>,
    /// Requests that the next file answers.
    waiting: Vec<Sender<Written>>,
    /// They get all frames too.
    debug: Option<Arc<Mutex<DebugInterfaces>>>,
}

impl FrameRecord {
    /// Begins to record what these taps see of interfaces with these names. All memory is reserved here: two rings, of
    /// which one is written while the other one goes on.
    ///
    /// # Errors
    /// Something else reads the taps, or there is not so much memory.
    pub fn start(
        taps: &Taps,
        master: u32,
        names: Vec<String>,
        settings: DebugRing,
    ) -> Result<FrameRecord, RecordError> {
        let (ring, spare) = (empty_ring(&settings)?, Some(empty_ring(&settings)?));
        let reader = taps.read().map_err(RecordError::AlreadyRead)?;
        let (domains, due, last_written, writing) = (BTreeMap::new(), None, LastWritten::default(), None);
        let ((requests, requested), waiting) = (RecordRequests::new(), Vec::new());
        Ok(FrameRecord {
            reader,
            ring,
            spare,
            settings,
            master,
            names,
            domains,
            due,
            last_written,
            writing,
            requests,
            requested,
            waiting,
            debug: None,
        })
    }

    /// Takes into account when another record of this master has written its last file.
    #[must_use]
    pub fn with_last_written(mut self, last_written: LastWritten) -> FrameRecord {
        self.last_written = last_written;
        self
    }

    /// From now on debug interfaces get all frames too.
    pub(super) fn pass_on(&mut self, debug: Arc<Mutex<DebugInterfaces>>) {
        self.debug = Some(debug);
    }

    /// Takes the frames that were in their queues at the call before, so that the frames of all threads are in the
    /// order of their times.
    pub(super) fn take_frames(&mut self) {
        self.take_from_taps(false);
    }

    /// Takes frames, with `all` also the newest ones.
    fn take_from_taps(&mut self, all: bool) {
        let FrameRecord { ring, reader, debug, .. } = self;
        let mut debug = debug.as_ref().map(|debug| debug.lock().unwrap_or_else(PoisonError::into_inner));
        let take = |note: FrameNote, frame: &[u8]| {
            ring.push(note, frame);
            if let Some(debug) = &mut debug {
                debug.put(note, frame);
            }
            Ok(())
        };
        let taken: Result<(), Infallible> = if all { reader.read_all(take) } else { reader.read(take) };
        match taken {
            Ok(()) => {}
        }
    }

    /// Where users request a file.
    pub(super) fn requests(&self) -> RecordRequests {
        self.requests.clone()
    }

    /// A file is written after a short time, unless one of a fault was written within the last 10 s. A file that was
    /// only requested becomes that of the fault.
    pub fn note(&mut self, reason: RecordReason, now: Instant) {
        let is_soon = self.last_written.at().is_some_and(|at| now.duration_since(at) < PAUSE);
        let is_free = self.due.is_none_or(|(due, _)| due == RecordReason::Requested);
        if is_free && !is_soon {
            self.due = Some((reason, now + AFTER));
        }
    }

    /// A request is answered by the file that is due, or by one of its own. There is no pause between such files: a
    /// user waits for each.
    fn take_requests(&mut self, now: Instant) {
        let before = self.waiting.len();
        self.waiting.extend(self.requested.try_iter());
        if self.waiting.len() > before && self.due.is_none() {
            self.due = Some((RecordReason::Requested, now + AFTER));
        }
    }

    /// Takes an event.
    pub(super) fn take(&mut self, event: &Event, now: Instant) {
        match event {
            Event::Lost { .. } => self.note(RecordReason::Lost, now),
            Event::StateError { requested: None, .. } => self.note(RecordReason::StateLeft, now),
            Event::LinkDown { .. } => self.note(RecordReason::LinkDown, now),
            Event::Domain { domain, status, incomplete } => {
                let counted = self.domains.entry(domain.0).or_default();
                let (was_complete, is_complete) = (counted.was_complete, status.state == DomainState::Complete);
                counted.was_complete |= is_complete;
                counted.incomplete_since = (was_complete && !is_complete).then_some(now);
                if was_complete && *incomplete >= self.settings.cycles.into() {
                    self.note(RecordReason::WorkingCounter, now);
                }
            }
            _ => {}
        }
    }

    /// Ten times a second: a file is written in a thread of its own if one is due. Lines about those that are written.
    pub(super) fn look(&mut self, now: Instant, has_application: bool) -> Vec<Line> {
        if !has_application {
            self.domains.clear();
        }
        let is_long = |it: &Counted| it.incomplete_since.is_some_and(|since| now.duration_since(since) >= INTERRUPTION);
        if self.domains.values().any(is_long) {
            self.domains.values_mut().for_each(|it| it.incomplete_since = None);
            self.note(RecordReason::WorkingCounter, now);
        }
        self.take_requests(now);
        let mut lines = Vec::new();
        if self.writing.as_ref().is_some_and(JoinHandle::is_finished) {
            lines.extend(self.wait());
        }
        match self.due {
            Some((reason, at)) if at <= now && self.writing.is_none() => {
                self.due = None;
                lines.extend(self.write(reason, now));
            }
            _ => {}
        }
        lines
    }

    /// The end: what is due is written.
    pub(super) fn end(&mut self, now: Instant) -> Vec<Line> {
        let mut lines: Vec<Line> = self.wait().into_iter().collect();
        if let Some((reason, _)) = self.due.take() {
            lines.extend(self.write(reason, now));
        }
        lines.extend(self.wait());
        lines
    }

    /// Waits for the thread that writes.
    fn wait(&mut self) -> Option<Line> {
        // The panic handler has reported a panic of the thread; its ring is lost.
        let (line, mut ring) = self.writing.take()?.join().ok()?;
        ring.clear();
        self.spare = Some(ring);
        Some(line)
    }

    /// Writes in a thread of its own. Returns a line if that cannot begin.
    fn write(&mut self, reason: RecordReason, now: Instant) -> Option<Line> {
        if reason != RecordReason::Requested {
            self.last_written.set(now);
        }
        self.take_from_taps(true);
        let waiting = std::mem::take(&mut self.waiting);
        let fails =
            |error: &dyn fmt::Display| (Priority::Error, format!("The last frames cannot be written: {error}."));
        let spare = match self.spare.take().map_or_else(|| empty_ring(&self.settings), Ok) {
            Ok(spare) => spare,
            Err(error) => {
                answer(&waiting, &Err(error.to_string()));
                return Some(fails(&error));
            }
        };
        let ring = std::mem::replace(&mut self.ring, spare);
        let (master, names, settings) = (self.master, self.names.clone(), self.settings.clone());
        let lost: u64 = (0..names.len()).map(|interface| self.reader.lost(interface)).sum();
        let body = move || {
            let names: Vec<(&str, &str)> = names.iter().map(String::as_str).zip(DESCRIPTIONS).collect();
            let files = RecordFiles { directory: &settings.directory, master, most: settings.files };
            let saved = files.save(reason, |out| ring.write(out, &names));
            let line = line(&saved, (reason, ring.len(), lost), &settings);
            let written = match saved {
                Ok(path) => Ok(WrittenRecord { path, frames: ring.len() as u64, lost }),
                Err(_) => Err(line.1.clone()),
            };
            answer(&waiting, &written);
            (line, ring)
        };
        match std::thread::Builder::new().name("record".into()).spawn(body) {
            Ok(writing) => {
                self.writing = Some(writing);
                None
            }
            Err(error) => Some(fails(&error)),
        }
    }
}

/// The line about a file, or about why there is none.
fn line(
    saved: &std::io::Result<PathBuf>,
    (reason, frames, lost): (RecordReason, usize, u64),
    settings: &DebugRing,
) -> Line {
    match saved {
        Ok(path) => {
            let lacking = if lost == 0 { String::new() } else { format!(", {lost} since the start are not recorded") };
            let priority = if reason == RecordReason::Requested { Priority::Info } else { Priority::Warning };
            (priority, format!("The last {frames} frames are in {}{lacking}.", path.display()))
        }
        Err(error) => {
            let place = settings.directory.display();
            (Priority::Error, format!("The last frames cannot be written in {place}: {error}."))
        }
    }
}

/// Answers requests. One whose user no longer waits gets no answer.
fn answer(waiting: &[Sender<Written>], written: &Written) {
    for request in waiting {
        let _ = request.send(written.clone());
    }
}

/// The memory for frames.
fn empty_ring(settings: &DebugRing) -> Result<FrameRing, RecordError> {
    let memory = |_| RecordError::Memory(settings.bytes);
    let bytes = usize::try_from(settings.bytes).map_err(|_| RecordError::Memory(settings.bytes))?;
    FrameRing::new(bytes, Duration::from_secs(settings.seconds.into())).map_err(memory)
}

#[cfg(test)]
mod tests;
