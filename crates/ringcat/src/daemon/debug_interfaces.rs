//! Debug interfaces (`ecdbgmX`, `ecdbgbX`): network interfaces of the host on which `tcpdump` and Wireshark see each
//! frame of a master.
//!
//! In: the frames that [`Taps`] see, taken from them each 10 ms by a thread that is not cyclic. Out: the same frames on
//! a TAP interface for each link. While all interfaces are down nothing is taken, and the taps are off. What the host
//! sends on such an interface is never read: it has no carrier, so the kernel drops it.

use std::convert::Infallible;
use std::fmt;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use ringcat_link::recorder::{FrameNote, FrameReader};
use ringcat_link::{TapInterface, Taps};

/// Interval at which frames are passed on while an interface is up.
pub(super) const FEED: Duration = Duration::from_millis(10);
/// Interval at which a thread of its own checks whether an interface is up.
const LOOK: Duration = Duration::from_millis(100);
/// Beginning of the name of the interface of the backup link.
const BACKUP: &str = "ecdbgb";
/// Stack of the thread.
const STACK_BYTES: usize = 128 << 10;

/// Where the frames of a link go.
pub(super) trait FrameSink: fmt::Debug + Send {
    /// Whether it takes any.
    fn is_up(&self) -> bool;

    /// Passes a frame on; false if it was not accepted.
    fn pass(&self, frame: &[u8]) -> bool;
}

impl FrameSink for TapInterface {
    fn is_up(&self) -> bool {
        TapInterface::is_up(self)
    }

    fn pass(&self, frame: &[u8]) -> bool {
        self.send(frame)
    }
}

/// The interface of a link.
#[derive(Debug)]
struct End {
    name: String,
    link: usize,
    sink: Box<dyn FrameSink>,
    is_up: bool,
    /// Frames that it has not accepted since it is up.
    refused: u64,
    /// Frames that did not fit into the queues before it was up.
    lost_before: u64,
}

/// The debug interfaces of a master.
#[derive(Debug)]
pub struct DebugInterfaces {
    taps: Taps,
    ends: Vec<End>,
    reader: Option<FrameReader>,
    /// A record reads the taps, and passes all frames on to these interfaces.
    has_record: bool,
}

impl DebugInterfaces {
    /// Interfaces for the frames that these taps see.
    pub fn new(taps: &Taps, interfaces: Vec<TapInterface>) -> DebugInterfaces {
        let sink = |it: TapInterface| (it.name().to_owned(), Box::new(it) as Box<dyn FrameSink>);
        DebugInterfaces::with(taps, interfaces.into_iter().map(sink))
    }

    pub(super) fn with(taps: &Taps, sinks: impl Iterator<Item = (String, Box<dyn FrameSink>)>) -> DebugInterfaces {
        let end = |(name, sink): (String, Box<dyn FrameSink>)| {
            let link = usize::from(name.starts_with(BACKUP));
            End { name, link, sink, is_up: false, refused: 0, lost_before: 0 }
        };
        DebugInterfaces { taps: taps.clone(), ends: sinks.map(end).collect(), reader: None, has_record: false }
    }

    /// From now on a record passes the frames on ([`DebugInterfaces::put`]).
    pub(super) fn set_record(&mut self) {
        self.has_record = true;
    }

    /// Whether one of them is up, as far as is known.
    pub(super) fn is_up(&self) -> bool {
        self.ends.iter().any(|end| end.is_up)
    }

    /// Checks which are up, a few times a second: the taps are on while one is. Lines about frames that are not on an
    /// interface that is down again.
    pub(super) fn look(&mut self) -> Vec<String> {
        let mut lines = Vec::new();
        let lost = |reader: &Option<FrameReader>, link| reader.as_ref().map_or(0, |reader| reader.lost(link));
        for end in &mut self.ends {
            let was_up = std::mem::replace(&mut end.is_up, end.sink.is_up());
            let lost = lost(&self.reader, end.link);
            match (was_up, end.is_up) {
                (false, true) => (end.refused, end.lost_before) = (0, lost),
                (true, false) => {
                    let missing = end.refused + lost.saturating_sub(end.lost_before);
                    if missing > 0 {
                        lines.push(format!("Debug interface {}: {missing} frames did not fit.", end.name));
                    }
                }
                _ => {}
            }
        }
        match (self.is_up() && !self.has_record, &self.reader) {
            // While something else reads the taps there is nothing to pass on; the next check tries again.
            (true, None) => self.reader = self.taps.read().ok(),
            (false, Some(_)) => self.reader = None,
            _ => {}
        }
        lines
    }

    /// Passes on the frames that were in their queues at the call before, so that they are in the order of their times.
    pub(super) fn take_frames(&mut self) {
        let Some(mut reader) = self.reader.take() else { return };
        let taken: Result<(), Infallible> = reader.read(|note, frame| {
            self.put(note, frame);
            Ok(())
        });
        match taken {
            Ok(()) => self.reader = Some(reader),
        }
    }

    /// Passes a frame on.
    pub(super) fn put(&mut self, note: FrameNote, frame: &[u8]) {
        for end in self.ends.iter_mut().filter(|end| end.is_up && end.link == note.interface) {
            if !end.sink.pass(frame) {
                end.refused += 1;
            }
        }
    }
}

/// A thread that passes frames on where no bus log does.
#[derive(Debug)]
pub(super) struct DebugFeed {
    end: Option<Sender<()>>,
    thread: Option<JoinHandle<DebugInterfaces>>,
    /// A child of `fork` has no such thread.
    process: u32,
}

impl DebugFeed {
    /// For these interfaces; `None` without any.
    ///
    /// # Errors
    /// The system cannot start the thread.
    pub fn of(
        taps: Option<&Taps>,
        interfaces: Vec<TapInterface>,
        prepare: impl FnOnce() + Send + 'static,
    ) -> std::io::Result<Option<DebugFeed>> {
        let debug = taps.filter(|_| !interfaces.is_empty()).map(|taps| DebugInterfaces::new(taps, interfaces));
        debug.map(|debug| DebugFeed::start(debug, prepare)).transpose()
    }

    /// Starts the thread; `prepare` runs first in it.
    ///
    /// # Errors
    /// The system cannot start it.
    fn start(debug: DebugInterfaces, prepare: impl FnOnce() + Send + 'static) -> std::io::Result<DebugFeed> {
        let (end, ends) = channel();
        let body = move || {
            prepare();
            feed(debug, &ends)
        };
        let thread = std::thread::Builder::new().name("debug interfaces".into()).stack_size(STACK_BYTES).spawn(body)?;
        Ok(DebugFeed { end: Some(end), thread: Some(thread), process: std::process::id() })
    }

    /// Ends the thread; the interfaces are for something else.
    pub fn end(mut self) -> Option<DebugInterfaces> {
        self.join()
    }

    fn join(&mut self) -> Option<DebugInterfaces> {
        self.end = None;
        let thread = self.thread.take()?;
        if std::process::id() != self.process {
            std::mem::forget(thread);
            return None;
        }
        // The panic handler has reported a panic of the thread.
        thread.join().ok()
    }
}

impl Drop for DebugFeed {
    fn drop(&mut self) {
        self.join();
    }
}

fn feed(mut debug: DebugInterfaces, ends: &Receiver<()>) -> DebugInterfaces {
    let mut look_at = Instant::now();
    loop {
        if Instant::now() >= look_at {
            debug.look();
            look_at = Instant::now() + LOOK;
        }
        let rest = if debug.is_up() { FEED } else { LOOK };
        if ends.recv_timeout(rest) != Err(RecvTimeoutError::Timeout) {
            return debug;
        }
        debug.take_frames();
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
    use std::sync::{Arc, Mutex};

    use ringcat_link::pcapng::Direction;

    use super::*;

    /// An interface that keeps frames, at most two.
    #[derive(Clone, Debug, Default)]
    struct Kept {
        is_up: Arc<AtomicBool>,
        frames: Arc<Mutex<Vec<u8>>>,
        asked: Arc<AtomicUsize>,
    }

    impl FrameSink for Kept {
        fn is_up(&self) -> bool {
            self.asked.fetch_add(1, Ordering::Relaxed);
            self.is_up.load(Ordering::Relaxed)
        }

        fn pass(&self, frame: &[u8]) -> bool {
            let mut frames = self.frames.lock().expect("no panic");
            if frames.len() < 2 {
                frames.push(frame[0]);
                return true;
            }
            false
        }
    }

    impl Kept {
        fn set(&self, is_up: bool) {
            self.is_up.store(is_up, Ordering::Relaxed);
        }

        fn taken(&self) -> Vec<u8> {
            std::mem::take(&mut *self.frames.lock().expect("no panic"))
        }
    }

    fn interfaces(taps: &Taps) -> (DebugInterfaces, [Kept; 2]) {
        let kept = [Kept::default(), Kept::default()];
        let named = ["ecdbgm0", "ecdbgb0"].into_iter().zip(kept.clone());
        let sinks = named.map(|(name, kept)| (name.to_owned(), Box::new(kept) as Box<dyn FrameSink>));
        (DebugInterfaces::with(taps, sinks), kept)
    }

    // covers: daemon, capture
    #[test]
    fn frames_go_to_the_interface_of_their_link_while_it_is_up() {
        let taps = Taps::new(2);
        let (mut tap, (mut debug, [main, backup])) = (taps.tap_with(1 << 16), interfaces(&taps));
        assert_eq!((debug.look(), tap.is_read()), (Vec::new(), false), "down: the tap is off");
        main.set(true);
        assert_eq!((debug.look(), debug.is_up(), tap.is_read()), (Vec::new(), true, true));
        tap.record(0, Direction::Out, 1, &[1; 60]);
        tap.record(1, Direction::In, 2, &[2; 60]);
        debug.take_frames();
        debug.take_frames();
        assert_eq!((main.taken(), backup.taken()), (vec![1], vec![]));
        backup.set(true);
        debug.look();
        for value in [3, 4, 5] {
            tap.record(1, Direction::In, value.into(), &[value; 60]);
        }
        debug.take_frames();
        debug.take_frames();
        assert_eq!((main.taken(), backup.taken()), (vec![], vec![3, 4]));
        backup.set(false);
        assert_eq!(debug.look(), ["Debug interface ecdbgb0: 1 frames did not fit."]);
        main.set(false);
        assert_eq!((debug.look(), tap.is_read()), (Vec::new(), false), "down again: the tap is off");
    }

    // covers: daemon, capture
    #[test]
    fn another_reader_goes_on_and_a_record_passes_frames_on() {
        let taps = Taps::new(2);
        let (mut tap, (mut debug, [main, _])) = (taps.tap_with(1 << 16), interfaces(&taps));
        main.set(true);
        let other = taps.read().expect("the first");
        debug.look();
        tap.record(0, Direction::Out, 1, &[1; 60]);
        debug.take_frames();
        drop(other);
        debug.look();
        assert!(taps.read().is_err(), "it reads now");
        debug.set_record();
        debug.look();
        assert!(taps.read().is_ok(), "the record is to read");
        let mut reader = taps.read().expect("the record");
        tap.record(0, Direction::Out, 1, &[7; 60]);
        let read: Result<(), Infallible> = reader.read_all(|note, frame| {
            debug.put(note, frame);
            Ok(())
        });
        assert_eq!(read, Ok(()));
        assert_eq!(main.taken(), [7]);
    }

    // covers: daemon, capture
    #[test]
    fn a_thread_passes_frames_on_and_gives_the_interfaces_back() {
        let taps = Taps::new(2);
        let (mut tap, (debug, [main, _])) = (taps.tap_with(1 << 16), interfaces(&taps));
        let feed = DebugFeed::start(debug, || ()).expect("it starts");
        main.set(true);
        let begin = Instant::now();
        while main.frames.lock().expect("no panic").is_empty() {
            tap.record(0, Direction::Out, 1, &[9; 60]);
            assert!(begin.elapsed() < Duration::from_secs(20), "no frame has come");
            std::thread::sleep(Duration::from_millis(5));
        }
        assert_eq!(main.taken()[0], 9);
        assert!(feed.end().is_some_and(|debug| debug.is_up()));
    }
}
