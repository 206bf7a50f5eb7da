//! Lines for the operator about a bus, as users search for them: link, SubDevices, states, scans, working counters, and
//! once a second what was lost; messages of the debug level (`ethercat debug`); the loss of the bus.
//!
//! [`Lines`] decides which lines are printed; [`BusLog`] takes samples and events ten times a second in a thread of its
//! own, and passes the lines on. The process that drives a bus has one: the daemon, a program with the C interface, and
//! a Rust application that uses it. Neither touches the cyclic path.

mod lines;

use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use ringcat_engine::link::Link;
use ringcat_engine::main_device::LiveStatus;
pub use ringcat_link::operator::{OperatorLines, Priority};

pub use self::lines::Lines;
use self::lines::{Counts, Sample};
use super::debug_interfaces::{DebugInterfaces, FEED};
use super::frame_record::FrameRecord;
use super::ownership::OwnershipWatch;
use super::record_files::RecordReason;
use super::serving;
use crate::services::Services;
use crate::supervisor_thread::SupervisorThread;
use crate::text::message;

/// Interval of checks.
const LOOK: Duration = Duration::from_millis(100);
/// Checks between two summaries.
const LOOKS_PER_SUMMARY: u32 = 10;
/// Stack of the thread.
const STACK_BYTES: usize = 256 << 10;
/// Most messages of the debug level in one check.
const MOST_MESSAGES: usize = 500;

/// The source of a bus log.
#[derive(Clone, Debug)]
pub struct Followed {
    supervisor: SupervisorThread,
    ownership: Option<OwnershipWatch>,
    lines: Arc<Mutex<Lines>>,
    /// Also print lines about the results of cyclic frames.
    with_cyclic: bool,
    record: Option<Arc<Mutex<FrameRecord>>>,
    debug: Option<Arc<Mutex<DebugInterfaces>>>,
}

impl Followed {
    /// The acyclic half of a bus. All its events are taken from it.
    pub fn new(supervisor: SupervisorThread) -> Followed {
        let (ownership, lines, with_cyclic, record, debug) = (None, Arc::default(), true, None, None);
        Followed { supervisor, ownership, lines, with_cyclic, record, debug }
    }

    /// Also whether the bus of a daemon was taken back.
    #[must_use]
    pub fn with_ownership(mut self, ownership: Option<OwnershipWatch>) -> Followed {
        self.ownership = ownership;
        self
    }

    /// Whether there are lines about the results of cyclic frames: working counters, and datagrams that were lost,
    /// unmatched or skipped. There are by default.
    #[must_use]
    pub fn with_cyclic_lines(mut self, with_cyclic: bool) -> Followed {
        self.with_cyclic = with_cyclic;
        self
    }

    /// Also keeps the last frames, and writes them into a file at a fault, or when `ethercat record` requests one.
    #[must_use]
    pub fn with_record(mut self, record: Option<FrameRecord>) -> Followed {
        if let Some(record) = &record {
            self.supervisor.publish_record(record.requests());
        }
        self.record = record.map(|record| Arc::new(Mutex::new(record)));
        self
    }

    /// Also passes all frames on to debug interfaces while these are up.
    #[must_use]
    pub fn with_debug_interfaces(mut self, debug: Option<DebugInterfaces>) -> Followed {
        self.debug = debug.map(|debug| Arc::new(Mutex::new(debug)));
        self
    }

    /// A record that reads the taps passes the frames on to debug interfaces.
    fn join_readers(&self) {
        if let (Some(record), Some(debug)) = (&self.record, &self.debug) {
            locked(debug).set_record();
            locked(record).pass_on(debug.clone());
        }
    }

    /// Takes the frames that wait.
    fn take_frames(&self) {
        match (&self.record, &self.debug) {
            (Some(record), _) => locked(record).take_frames(),
            (None, Some(debug)) => locked(debug).take_frames(),
            (None, None) => {}
        }
    }

    /// Waits for the next check; meanwhile debug interfaces that are up get frames. Whether the log ends.
    fn wait(&self, ends: &Receiver<()>) -> bool {
        let until = Instant::now() + LOOK;
        loop {
            let left = until.saturating_duration_since(Instant::now());
            let is_up = self.debug.as_ref().is_some_and(|debug| locked(debug).is_up());
            let rest = if is_up { left.min(FEED) } else { left };
            let is_last = ends.recv_timeout(rest) != Err(RecvTimeoutError::Timeout);
            if is_last || rest == left {
                return is_last;
            }
            self.take_frames();
        }
    }

    /// Goes on with what was printed of this bus before: only changes are printed.
    #[must_use]
    pub fn with_lines(mut self, lines: Arc<Mutex<Lines>>) -> Followed {
        self.lines = lines;
        self
    }
}

/// Passes the lines of a bus on until it is dropped.
#[derive(Debug)]
pub struct BusLog {
    end: Option<Sender<()>>,
    /// Closed once all lines about the bus are printed.
    ended: Mutex<Receiver<()>>,
    thread: Option<JoinHandle<()>>,
}

impl BusLog {
    /// Begins. `prepare` runs first in its thread, which calls `print` with each line; it must not wait for long.
    ///
    /// # Errors
    /// The thread cannot be started.
    pub fn start(
        followed: Followed,
        prepare: impl FnOnce() + Send + 'static,
        print: impl FnMut(Priority, &str) + Send + 'static,
    ) -> std::io::Result<BusLog> {
        let ((end, ends), (ending, ended)) = (channel(), channel());
        let body = move || {
            prepare();
            run(&followed, &ends, ending, print);
        };
        let thread = std::thread::Builder::new().name("bus log".into()).stack_size(STACK_BYTES).spawn(body)?;
        Ok(BusLog { end: Some(end), ended: Mutex::new(ended), thread: Some(thread) })
    }

    /// Ends and waits for the last lines about the bus, not for frames that are still written into a file. The bus can
    /// be given back then.
    pub fn end_lines(&mut self) {
        self.end = None;
        // Nothing is sent: the thread drops the other end.
        let _ = self.ended.get_mut().unwrap_or_else(PoisonError::into_inner).recv();
    }

    /// Ends without waiting for the last lines, which may still come for a moment.
    pub fn end_soon(mut self) {
        self.thread = None;
    }
}

impl Drop for BusLog {
    fn drop(&mut self) {
        self.end = None;
        if let Some(thread) = self.thread.take() {
            // The panic handler has reported a panic of the thread.
            let _ = thread.join();
        }
    }
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn run(followed: &Followed, ends: &Receiver<()>, ending: Sender<()>, mut print: impl FnMut(Priority, &str)) {
    let Followed { supervisor, ownership, lines, with_cyclic, record, debug } = followed;
    let (mut looks, mut next_message) = (0_u32, 0);
    followed.join_readers();
    loop {
        let is_last = followed.wait(ends);
        looks += 1;
        followed.take_frames();
        let mut lines = lines.lock().unwrap_or_else(PoisonError::into_inner);
        let mut record = record.as_ref().map(|record| record.lock().unwrap_or_else(PoisonError::into_inner));
        if let Some(ownership) = ownership {
            let is_new = lines.own(ownership.now(), ownership.cause());
            if let Some(record) = record.as_mut().filter(|_| is_new && ownership.is_taken_back()) {
                record.note(RecordReason::TakenBack, Instant::now());
            }
        }
        take_messages(supervisor, &mut lines, &mut next_message);
        let is_second_over = *with_cyclic && (looks.is_multiple_of(LOOKS_PER_SUMMARY) || is_last);
        look((supervisor, *with_cyclic), &mut lines, (is_last, is_second_over), record.as_deref_mut());
        let mut all = lines.pop();
        drop(lines);
        if let Some(record) = &mut record {
            all.extend(record.look(Instant::now(), supervisor.observer().is_some()));
        }
        let passed_on = debug.as_ref().map(|debug| locked(debug).look()).unwrap_or_default();
        for (priority, line) in all.into_iter().chain(passed_on.into_iter().map(|line| (Priority::Warning, line))) {
            print(priority, &line);
        }
        if is_last {
            drop(ending);
            let lines = record.map(|mut record| record.end(Instant::now()));
            lines.into_iter().flatten().for_each(|(priority, line)| print(priority, &line));
            return;
        }
    }
}

/// Takes the messages since the last check, as far as there are not too many.
fn take_messages(supervisor: &SupervisorThread, lines: &mut Lines, next: &mut u64) {
    let Ok(since) = supervisor.messages_since(*next) else { return };
    *next = since.next;
    let beyond = since.messages.len().saturating_sub(MOST_MESSAGES);
    lines.debug(since.messages.iter().take(MOST_MESSAGES).map(message), since.missed + beyond as u64);
}

/// What is seen of the segment: words of the active application, or the answers to a broadcast.
fn sample(supervisor: &SupervisorThread, live: &LiveStatus, is_last: bool) -> Option<Sample> {
    // After a release the live status may be older than the states.
    if supervisor.observer().is_some() && !is_last {
        let segment = live.segment();
        let (is_up, responding, al_states) = (segment.is_up, segment.responding, segment.al_states);
        return Some(Sample { is_up, responding, al_states });
    }
    let seen = serving::overview(supervisor).ok()?;
    Some(Sample { is_up: seen.is_up.contains(&true), responding: seen.responding(), al_states: seen.al_states })
}

fn look(
    (supervisor, with_cyclic): (&SupervisorThread, bool),
    lines: &mut Lines,
    (is_last, is_second_over): (bool, bool),
    mut record: Option<&mut FrameRecord>,
) {
    let Ok(live) = supervisor.live_status() else { return };
    let seen = sample(supervisor, &live, is_last);
    while let Some(event) = supervisor.pop_event() {
        if let Some(record) = &mut record {
            record.take(&event.event, Instant::now());
        }
        if with_cyclic || !lines::is_cyclic(&event.event) {
            lines.take(&event);
        }
    }
    if let Some(seen) = seen {
        lines.look(seen);
    }
    if is_second_over {
        let counters = supervisor.counters();
        let lost: u64 = Link::ALL.into_iter().map(|link| live.lost(link).copies).sum();
        lines.summarise(Counts {
            timed_out: counters.timed_out.saturating_add(lost),
            unmatched: counters.late.saturating_add(counters.corrupt),
        });
    }
}
