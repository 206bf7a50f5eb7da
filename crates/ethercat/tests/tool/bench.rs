//! A daemon on simulated segments, and the tool beside it.

use std::ffi::OsString;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use ringcat::daemon::{BusSettings, OwnedBus};
use ringcat::piped::segment::PipedSegment;
use ringcat::sim::network::Network;
use ringcat::sim::segment::Segment;
use ringcat::{Declaration, DomainId, DomainState, Options, SubDeviceInfo};
use ringcatd::daemon::{Daemon, STOP_LIMIT};
use ringcatd::master::{Master, Settings};
use ringcatd::rights::Rights;
use ringcatd::segment_process;
use ringcatd::wires::Wires;

/// SubDevices reach their states within this time on a busy machine.
pub const LONG: Duration = Duration::from_secs(20);
pub const PROGRAM: &str = env!("CARGO_BIN_EXE_ethercat");

/// One daemon at a time: some tests have cycles that keep pace.
static TURN: Mutex<()> = Mutex::new(());

type Look = Box<dyn FnOnce(&mut PipedSegment) + Send>;

struct SegmentThread {
    looks: Option<Sender<Look>>,
    thread: Option<JoinHandle<()>>,
}

impl SegmentThread {
    /// A thread that simulates a segment, and the way to it.
    fn start(segment: Segment) -> (Wires, SegmentThread) {
        let (near, far) = UnixStream::pair().expect("a pair");
        let (looks, asked) = channel::<Look>();
        let network = Network::from_description(segment).expect("it is right");
        let thread = std::thread::spawn(move || simulate(PipedSegment::new(network), &far, &asked));
        let wires = Wires::to_segment(near).expect("the segment is right");
        (wires, SegmentThread { looks: Some(looks), thread: Some(thread) })
    }
}

impl Drop for SegmentThread {
    fn drop(&mut self) {
        self.looks = None;
        if let Some(thread) = self.thread.take() {
            assert!(thread.join().is_ok() || std::thread::panicking());
        }
    }
}

/// A daemon with masters 0, 1 and so on.
pub struct Bench {
    pub socket: PathBuf,
    pub directory: PathBuf,
    daemon: Option<Daemon>,
    segments: Vec<SegmentThread>,
    _turn: MutexGuard<'static, ()>,
}

/// What the tool has done.
#[derive(Debug, PartialEq, Eq)]
pub struct Done {
    pub out: String,
    pub bytes: Vec<u8>,
    pub err: String,
    pub code: Option<i32>,
}

/// A directory of its own below that for temporary files.
pub fn directory() -> PathBuf {
    static NUMBER: AtomicU32 = AtomicU32::new(0);
    let number = NUMBER.fetch_add(1, Ordering::Relaxed);
    let path = std::env::temp_dir().join(format!("ethercat-{}-{number}", std::process::id()));
    std::fs::create_dir_all(&path).expect("it can be made");
    path
}

/// Runs the tool with this socket.
pub fn tool(socket: &Path, arguments: &[&str]) -> Done {
    let words: Vec<OsString> = arguments.iter().map(OsString::from).collect();
    tool_with(socket, &words)
}

/// The same with any words.
pub fn tool_with(socket: &Path, words: &[OsString]) -> Done {
    let mut command = Command::new(PROGRAM);
    command.args(words).env("RINGCAT_SOCKET", socket).stdin(Stdio::null());
    let output = command.output().expect("it starts");
    Done {
        out: String::from_utf8_lossy(&output.stdout).into_owned(),
        bytes: output.stdout,
        err: String::from_utf8_lossy(&output.stderr).into_owned(),
        code: output.status.code(),
    }
}

impl Bench {
    /// A daemon on these segments, scanned and as far in PREOP as they go.
    pub fn start(segments: Vec<Segment>) -> Bench {
        Bench::start_in(directory(), segments)
    }

    /// The same with a directory that has files already.
    pub fn start_in(directory: PathBuf, segments: Vec<Segment>) -> Bench {
        Bench::start_with(directory, segments, Vec::new(), &BusSettings::default())
    }

    /// The same with settings of the masters.
    pub fn start_set(directory: PathBuf, segments: Vec<Segment>, settings: &BusSettings) -> Bench {
        Bench::start_with(directory, segments, Vec::new(), settings)
    }

    /// The same with a last master whose links cannot be opened.
    pub fn start_beside_a_waiting_master(segments: Vec<Segment>) -> Bench {
        let waiting = loop {
            let (wires, gone) = SegmentThread::start(
                Segment::from_toml("[[device]]\ntype = \"coupler\"\n", Path::new(".")).expect("it is right"),
            );
            drop(gone);
            let master = Master::new(segments.len() as u32, "eth9".to_owned(), wires);
            // A process that another test is about to start may still have the socket to the segment.
            if master.state().fault.is_some() {
                break master;
            }
        };
        Bench::start_with(directory(), segments, vec![waiting], &BusSettings::default())
    }

    fn start_with(directory: PathBuf, segments: Vec<Segment>, waiting: Vec<Master>, bus: &BusSettings) -> Bench {
        let turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
        let counts: Vec<usize> = segments.iter().map(|segment| segment.devices.len()).collect();
        let (mut masters, mut threads) = (Vec::new(), Vec::new());
        for (number, segment) in (0..).zip(segments) {
            let (wires, thread) = SegmentThread::start(segment);
            let settings = Settings { bus: bus.clone(), ..Settings::new(number, "sim:test".to_owned()) };
            masters.push(Master::start(settings, wires));
            threads.push(thread);
        }
        masters.extend(waiting);
        let socket = directory.join("socket");
        let daemon = Daemon::start(masters, &socket, Rights { group: None, mode: 0o666 }, STOP_LIMIT);
        let daemon = Some(daemon.expect("it listens"));
        let bench = Bench { socket, directory, daemon, segments: threads, _turn: turn };
        for (number, count) in counts.iter().enumerate() {
            bench.wait_until("scanned", || {
                let listed = bench.tool(&["slaves", "-m", &number.to_string()]).out;
                let is_ready = |line: &str| line.contains("PREOP") || line.contains("ERROR");
                listed.lines().count() == *count && listed.lines().all(is_ready)
            });
        }
        bench
    }

    /// Runs the tool.
    pub fn tool(&self, arguments: &[&str]) -> Done {
        tool(&self.socket, arguments)
    }

    /// Runs the tool, which succeeds and says nothing on the standard error.
    pub fn good(&self, arguments: &[&str]) -> String {
        let done = self.tool(arguments);
        assert!(done.code == Some(0) && done.err.is_empty(), "{arguments:?}: {done:?}");
        done.out
    }

    /// Runs the tool, which fails; what it says.
    pub fn bad(&self, arguments: &[&str]) -> String {
        let done = self.tool(arguments);
        assert!(done.code == Some(1) && done.out.is_empty(), "{arguments:?}: {done:?}");
        done.err
    }

    /// Looks into the segment of a master.
    pub fn inside<T: Send + 'static>(
        &self,
        master: usize,
        look: impl FnOnce(&mut PipedSegment) -> T + Send + 'static,
    ) -> T {
        let (answer, answered) = channel();
        let look = move |segment: &mut PipedSegment| answer.send(look(segment)).expect("the test waits");
        let looks = self.segments[master].looks.as_ref().expect("it runs");
        looks.send(Box::new(look)).expect("the segment runs");
        answered.recv().expect("the segment runs")
    }

    /// Waits for something that a busy machine may delay.
    pub fn wait_until(&self, what: &str, holds: impl Fn() -> bool) {
        let begin = Instant::now();
        while !holds() {
            assert!(begin.elapsed() < LONG, "{what}: {:?}", self.tool(&["slaves"]));
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

fn simulate(mut segment: PipedSegment, control: &UnixStream, asked: &Receiver<Look>) {
    let turn = |segment: &mut PipedSegment| {
        loop {
            match asked.try_recv() {
                Ok(look) => look(segment),
                Err(TryRecvError::Empty) => return true,
                Err(TryRecvError::Disconnected) => return false,
            }
        }
    };
    segment_process::serve(&mut segment, control, turn).expect("the daemon is there");
}

impl Drop for Bench {
    fn drop(&mut self) {
        self.segments.clear();
        self.daemon = None;
        // It is below the directory for temporary files.
        let _ = std::fs::remove_dir_all(&self.directory);
    }
}

/// Cycles of an application.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Cycles that ran.
    pub cycles: u64,
    /// Of these, cycles after which domain 0 was not complete.
    pub incomplete: u64,
    /// Cycles that began late.
    pub late: u64,
    /// Cycles that were left out.
    pub skipped: u64,
}

impl Counts {
    /// The counts since then.
    pub fn since(&self, before: &Counts) -> Counts {
        Counts {
            cycles: self.cycles - before.cycles,
            incomplete: self.incomplete - before.incomplete,
            late: self.late - before.late,
            skipped: self.skipped - before.skipped,
        }
    }
}

impl std::ops::AddAssign for Counts {
    fn add_assign(&mut self, more: Counts) {
        self.cycles += more.cycles;
        self.incomplete += more.incomplete;
        self.late += more.late;
        self.skipped += more.skipped;
    }
}

/// An application in a thread of the test that drives master 0.
pub struct Driver {
    is_over: Arc<AtomicBool>,
    counts: Arc<[AtomicU64; 4]>,
    thread: Option<JoinHandle<String>>,
}

impl Driver {
    /// Takes the bus, activates what `declare` makes of the scan, and runs cycles of 1 ms.
    pub fn start(bench: &Bench, declare: impl FnOnce(&[SubDeviceInfo]) -> Declaration + Send + 'static) -> Driver {
        let (socket, is_over) = (bench.socket.clone(), Arc::new(AtomicBool::new(false)));
        let (begun, ready) = channel();
        let over = is_over.clone();
        let counts = Arc::new([const { AtomicU64::new(0) }; 4]);
        let counted = counts.clone();
        let body = move || {
            let mut bus = OwnedBus::take(&socket, 0, "application", &Options::default(), || ()).expect("it is free");
            let found = bus.supervisor().subdevices().expect("it runs");
            let links = bus.take_links().expect("they are unused");
            let activated = bus.supervisor().clone().activate(declare(&found), links);
            let mut application = activated.expect("it fits the scan");
            if let Err(error) = application.wait_until_op(Duration::from_secs(5)) {
                println!("{error}");
            }
            begun.send(()).expect("the test waits");
            while !over.load(Ordering::Relaxed) {
                let status = application.cycle(|data| data.status(DomainId(0)));
                let is_complete = status.is_ok_and(|status| status.state == DomainState::Complete);
                let pace = application.pace();
                let incomplete = counted[1].load(Ordering::Relaxed) + u64::from(!is_complete);
                for (to, value) in counted.iter().zip([pace.cycles, incomplete, pace.late, pace.skipped]) {
                    to.store(value, Ordering::Relaxed);
                }
            }
            format!("{:?}", application.pace())
        };
        let thread = Some(std::thread::spawn(body));
        ready.recv().expect("it begins");
        Driver { is_over, counts, thread }
    }

    /// Its cycles so far.
    pub fn counts(&self) -> Counts {
        let [cycles, incomplete, late, skipped] = self.counts.each_ref().map(|count| count.load(Ordering::Relaxed));
        Counts { cycles, incomplete, late, skipped }
    }

    /// Ends it; returns what it reports about its cycles.
    pub fn end(mut self) -> String {
        self.is_over.store(true, Ordering::Relaxed);
        self.thread.take().map(|thread| thread.join().expect("no panic")).unwrap_or_default()
    }
}

impl Drop for Driver {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            assert!(thread.join().is_ok() || std::thread::panicking());
        }
    }
}
