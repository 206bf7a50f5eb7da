//! The frames of the last seconds before a fault, as a capture file.
//!
//! In: the frames that [`Taps`] see, taken from them ten times a second by the thread of the bus log; events. Out:
//! files for Wireshark (pcapng), and a line for the operator about each. Without a fault nothing is written. The
//! cyclic path copies a frame into the queue of its tap, and does nothing else.

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use ringcat_control::settings::DebugRing;
use ringcat_engine::domain::DomainState;
use ringcat_engine::event::Event;
use ringcat_link::operator::Priority;
use ringcat_link::recorder::{FrameReader, FrameRing};
use ringcat_link::{AlreadyRead, Taps};

use super::record_files::{RecordFiles, RecordReason};

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
        Ok(FrameRecord { reader, ring, spare, settings, master, names, domains, due, last_written, writing })
    }

    /// Takes into account when another record of this master has written its last file.
    #[must_use]
    pub fn with_last_written(mut self, last_written: LastWritten) -> FrameRecord {
        self.last_written = last_written;
        self
    }

    /// Takes the frames that were in their queues at the call before, so that the frames of all threads are in the
    /// order of their times.
    pub(super) fn take_frames(&mut self) {
        let ring = &mut self.ring;
        let taken: Result<(), Infallible> = self.reader.read(|note, frame| {
            ring.push(note, frame);
            Ok(())
        });
        match taken {
            Ok(()) => {}
        }
    }

    /// Takes all frames, also the newest ones.
    fn take_all_frames(&mut self) {
        let ring = &mut self.ring;
        let taken: Result<(), Infallible> = self.reader.read_all(|note, frame| {
            ring.push(note, frame);
            Ok(())
        });
        match taken {
            Ok(()) => {}
        }
    }

    /// A file is written after a short time, unless one was written within the last 10 s.
    pub fn note(&mut self, reason: RecordReason, now: Instant) {
        let is_soon = self.last_written.at().is_some_and(|at| now.duration_since(at) < PAUSE);
        if self.due.is_none() && !is_soon {
            self.due = Some((reason, now + AFTER));
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
        self.last_written.set(now);
        self.take_all_frames();
        let fails =
            |error: &dyn fmt::Display| (Priority::Error, format!("The last frames cannot be written: {error}."));
        let spare = match self.spare.take().map_or_else(|| empty_ring(&self.settings), Ok) {
            Ok(spare) => spare,
            Err(error) => return Some(fails(&error)),
        };
        let ring = std::mem::replace(&mut self.ring, spare);
        let (master, names, settings) = (self.master, self.names.clone(), self.settings.clone());
        let lost: u64 = (0..names.len()).map(|interface| self.reader.lost(interface)).sum();
        let body = move || {
            let names: Vec<(&str, &str)> = names.iter().map(String::as_str).zip(DESCRIPTIONS).collect();
            let files = RecordFiles { directory: &settings.directory, master, most: settings.files };
            let line = match files.save(reason, |out| ring.write(out, &names)) {
                Ok(path) => {
                    let lacking =
                        if lost == 0 { String::new() } else { format!(", {lost} since the start are not recorded") };
                    let text = format!("The last {} frames are in {}{lacking}.", ring.len(), path.display());
                    (Priority::Warning, text)
                }
                Err(error) => {
                    let place = settings.directory.display();
                    (Priority::Error, format!("The last frames cannot be written in {place}: {error}."))
                }
            };
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

/// The memory for frames.
fn empty_ring(settings: &DebugRing) -> Result<FrameRing, RecordError> {
    let memory = |_| RecordError::Memory(settings.bytes);
    let bytes = usize::try_from(settings.bytes).map_err(|_| RecordError::Memory(settings.bytes))?;
    FrameRing::new(bytes, Duration::from_secs(settings.seconds.into())).map_err(memory)
}

#[cfg(test)]
mod tests {
    use ringcat_engine::declared::SubDeviceId;
    use ringcat_engine::domain::{DomainId, DomainStatus};
    use ringcat_link::pcapng::Direction;

    use std::path::PathBuf;

    use super::*;

    struct Place(PathBuf);

    impl Place {
        fn new(name: &str) -> Place {
            let path = std::env::temp_dir().join(format!("ringcat-record-{name}-{}", std::process::id()));
            std::fs::create_dir_all(&path).expect("it can be made");
            Place(path)
        }

        fn files(&self) -> Vec<String> {
            let entries = std::fs::read_dir(&self.0).expect("it is there").flatten();
            let mut names: Vec<String> = entries.filter_map(|it| it.file_name().into_string().ok()).collect();
            names.sort_unstable();
            names
        }

        fn record(&self, taps: &Taps, files: u32) -> FrameRecord {
            let mut settings = DebugRing::default();
            (settings.directory, settings.files, settings.cycles) = (self.0.clone(), files, 10);
            FrameRecord::start(taps, 0, vec!["eth1".to_owned()], settings).expect("nothing else reads")
        }
    }

    impl Drop for Place {
        fn drop(&mut self) {
            // It is below the directory for temporary files.
            let _ = std::fs::remove_dir_all(&self.0);
        }
    }

    fn domain(state: DomainState, incomplete: u64) -> Event {
        let mut status = DomainStatus::default();
        status.state = state;
        Event::Domain { domain: DomainId(0), status, incomplete }
    }

    // covers: daemon, capture
    #[test]
    fn a_fault_writes_the_frames_before_it_and_shortly_after_it() {
        let place = Place::new("fault");
        let taps = Taps::new(1);
        let (mut tap, mut record) = (taps.tap_with(1 << 16), place.record(&taps, 5));
        let begin = Instant::now();
        tap.record(0, Direction::Out, 1_000, &[0x11; 60]);
        record.take_frames();
        record.take(&Event::Lost { subdevice: SubDeviceId(0) }, begin);
        assert_eq!(record.look(begin, true), []);
        tap.record(0, Direction::In, 2_000, &[0x22; 60]);
        let early = begin + AFTER - Duration::from_millis(1);
        assert_eq!((record.look(early, true), place.files().len()), (Vec::new(), 0));
        assert_eq!(record.look(begin + AFTER, true), []);
        let lines = record.end(begin + AFTER);
        let [(_, text)] = &lines[..] else { panic!("{lines:?}") };
        let [file] = &place.files()[..] else { panic!("{:?}", place.files()) };
        assert!(text.contains("The last 2 frames are in ") && text.contains(file.as_str()), "{text}");
        assert!(file.starts_with("ringcat-0-") && file.ends_with("-lost.pcapng"), "{file}");
        let bytes = std::fs::read(place.0.join(file)).expect("it can be read");
        assert!([[0x11; 60], [0x22; 60]].iter().all(|frame| bytes.windows(60).any(|it| it == frame)));
    }

    // covers: daemon, capture
    #[test]
    fn an_interruption_counts_by_cycles_or_time_and_only_after_a_complete_cycle() {
        let place = Place::new("cycles");
        let taps = Taps::new(1);
        let begin = Instant::now();
        let due = |events: &[Event], later: Duration| {
            let mut record = place.record(&taps, 5);
            events.iter().for_each(|event| record.take(event, begin));
            record.look(begin + later, true);
            record.due.map(|(reason, _)| reason)
        };
        let complete = domain(DomainState::Complete, 0);
        let broken = domain(DomainState::Incomplete, 1);
        let late = INTERRUPTION;
        assert_eq!(due(std::slice::from_ref(&broken), late), None, "before the first complete cycle");
        assert_eq!(due(&[complete.clone(), broken.clone()], Duration::ZERO), None);
        assert_eq!(due(&[complete.clone(), broken.clone()], late), Some(RecordReason::WorkingCounter));
        let ended = |cycles| [complete.clone(), broken.clone(), domain(DomainState::Complete, cycles)];
        assert_eq!(due(&ended(9), late), None);
        assert_eq!(due(&ended(10), late), Some(RecordReason::WorkingCounter));
    }

    // covers: daemon, capture
    #[test]
    fn there_is_a_largest_number_of_files_and_a_pause_between_them() {
        let place = Place::new("room");
        std::fs::write(place.0.join("ringcat-01-other.pcapng"), []).expect("it can be written");
        let (taps, taps_of_next) = (Taps::new(1), Taps::new(1));
        let mut record = place.record(&taps, 2);
        let mut now = Instant::now();
        for round in 0..4 {
            record.note(RecordReason::LinkDown, now);
            assert_eq!(record.end(now).len(), 1, "{round}");
            record.note(RecordReason::LinkDown, now + Duration::from_secs(1));
            assert_eq!(record.due, None, "a moment after a file");
            let mut next = place.record(&taps_of_next, 2).with_last_written(record.last_written.clone());
            next.note(RecordReason::OwnerLost, now + Duration::from_secs(1));
            assert_eq!(next.due, None, "a moment after a file of the one before");
            now += PAUSE;
            std::thread::sleep(Duration::from_millis(2));
        }
        assert_eq!(place.files().len(), 3, "two, and one that is not ours: {:?}", place.files());
    }
}
