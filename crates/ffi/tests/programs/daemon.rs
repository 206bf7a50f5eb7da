//! Programs that get their bus from a daemon.

use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use ringcat::AlState;
use ringcat::daemon::{BusSettings, Client, Query};
use ringcat::esi::load_segment;
use ringcat::piped::segment::PipedSegment;
use ringcat::sim::cable::HostLink;
use ringcat::sim::fault::Fault;
use ringcat::sim::network::Network;
use ringcatd::daemon::{Daemon, STOP_LIMIT};
use ringcatd::master::{Master, Settings};
use ringcatd::rights::Rights;
use ringcatd::segment_process::serve;
use ringcatd::wires::Wires;

use crate::library::{here, interrupted_after, program, root};

/// A busy machine delays a change at most for so long.
const LONG: Duration = Duration::from_secs(30);

/// The segment turns at least once in a millisecond, unless this machine stalls.
const STALL: Duration = Duration::from_millis(2);

/// What the segment shows to the test.
#[derive(Debug, Default)]
struct Seen {
    /// All SubDevices are in PREOP.
    in_preop: AtomicBool,
    /// When the links were connected last.
    connected_ns: AtomicU64,
    /// A SubDevice has outputs that are not zero.
    outputs_are_set: AtomicBool,
    /// A fault, and how long after the next frame on the main link it comes.
    fault: Mutex<Option<(Fault, Duration)>>,
    /// Times at which the segment went on after it had stood still, and for how long.
    stalls: Mutex<Vec<(u64, Duration)>>,
    ends: AtomicBool,
}

/// CLOCK_MONOTONIC.
fn monotonic_ns() -> u64 {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: memory of this type.
    unsafe { libc::clock_gettime(libc::CLOCK_MONOTONIC, &mut time) };
    time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64
}

/// Schedules an ordered fault when the main link has a new frame.
fn schedule(network: &mut Network, frames: &mut u64, fault: &Mutex<Option<(Fault, Duration)>>) {
    let sent = network.statistics().link(HostLink::Main).frames_sent;
    if core::mem::replace(frames, sent) == sent {
        return;
    }
    if let Some((fault, after)) = fault.lock().expect("no panic").take() {
        let at = network.now() + after;
        network.schedule(at, fault);
    }
}

type Look = Box<dyn FnOnce(&mut PipedSegment) + Send>;

/// A daemon on the segment of a file.
pub struct Bench {
    seen: Arc<Seen>,
    looks: Sender<Look>,
    daemon: Option<Daemon>,
    segment: Option<JoinHandle<()>>,
    pub socket: PathBuf,
}

impl Bench {
    /// A daemon on the segment of this file, with all SubDevices in PREOP.
    pub fn start(file: &Path, name: &str) -> Bench {
        Bench::start_for(file, name, Rights::default())
    }

    /// The same where other users have these rights.
    pub fn start_for(file: &Path, name: &str, rights: Rights) -> Bench {
        let bench = Bench::begin(file, name, rights, BusSettings::default());
        bench.wait_for_preop();
        bench
    }

    /// The same where the master has these settings.
    pub fn start_with(file: &Path, name: &str, settings: BusSettings) -> Bench {
        let bench = Bench::begin(file, name, Rights::default(), settings);
        bench.wait_for_preop();
        bench
    }

    /// The same, without waiting for PREOP.
    fn begin(file: &Path, name: &str, rights: Rights, bus: BusSettings) -> Bench {
        let (near, far) = UnixStream::pair().expect("a pair");
        let (seen, file) = (Arc::new(Seen::default()), file.to_owned());
        let shown = seen.clone();
        let (looks, asked) = channel::<Look>();
        let segment = std::thread::spawn(move || {
            let described = load_segment(&file).expect("it is right");
            let mut segment = PipedSegment::new(Network::from_description(described).expect("it is right"));
            let mut frames = 0;
            let mut last = Instant::now();
            let show = |segment: &mut PipedSegment| {
                schedule(segment.network_mut(), &mut frames, &shown.fault);
                asked.try_iter().for_each(|look| look(segment));
                if last.elapsed() > STALL {
                    shown.stalls.lock().expect("no panic").push((monotonic_ns(), last.elapsed()));
                }
                last = Instant::now();
                let has_outputs =
                    segment.network_mut().devices().any(|device| device.outputs().iter().any(|it| *it != 0));
                shown.outputs_are_set.store(has_outputs, Ordering::Release);
                shown.connected_ns.store(segment.connected_ns(), Ordering::Release);
                let mut states = segment.network_mut().devices().map(|device| device.al_status().al_state());
                shown.in_preop.store(states.all(|state| state == Some(AlState::PreOp)), Ordering::Release);
                !shown.ends.load(Ordering::Acquire)
            };
            serve(&mut segment, &far, show).expect("the daemon is there");
        });
        let socket = std::env::temp_dir().join(format!("ringcat-ffi-{name}-{}", std::process::id()));
        let mut settings = Settings::new(0, name.to_owned());
        settings.bus = bus;
        let master = Master::start(settings, Wires::to_segment(near).expect("it is right"));
        let daemon = Daemon::start(vec![master], &socket, rights, STOP_LIMIT).expect("it listens");
        Bench { seen, looks, daemon: Some(daemon), segment: Some(segment), socket }
    }

    /// Looks into the segment, or changes it.
    pub fn inside<T: Send + 'static>(&self, look: impl FnOnce(&mut PipedSegment) -> T + Send + 'static) -> T {
        let (answer, answered) = channel();
        let look = move |segment: &mut PipedSegment| answer.send(look(segment)).expect("the test waits");
        self.looks.send(Box::new(look)).expect("the segment runs");
        answered.recv().expect("the segment runs")
    }

    pub fn wait_for_preop(&self) {
        let begin = Instant::now();
        while !self.seen.in_preop.load(Ordering::Acquire) {
            assert!(begin.elapsed() < LONG, "not all are in PREOP");
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Waits until the links have been connected since that time, by the program or by the daemon after it. A program
    /// that has ended may have left its SubDevices in PREOP before the daemon has the bus.
    pub fn wait_for_connection_after(&self, before_ns: u64) {
        let begin = Instant::now();
        while self.connected_ns() <= before_ns {
            assert!(begin.elapsed() < LONG, "the links are not connected again");
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    pub fn connected_ns(&self) -> u64 {
        self.seen.connected_ns.load(Ordering::Acquire)
    }

    pub fn outputs_are_set(&self) -> bool {
        self.seen.outputs_are_set.load(Ordering::Acquire)
    }

    /// A fault comes that long after the next frame on the main link. Returns when it is scheduled.
    pub fn fault_after_a_frame(&self, fault: Fault, after: Duration) {
        *self.seen.fault.lock().expect("no panic") = Some((fault, after));
        let begin = Instant::now();
        while self.seen.fault.lock().expect("no panic").is_some() {
            assert!(begin.elapsed() < LONG, "no frame leaves");
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Whether the segment has stood still for at least `length` in the time before this one of CLOCK_MONOTONIC.
    pub fn has_stalled(&self, length: Duration, before_ns: u64, time: Duration) -> bool {
        let stalls = self.seen.stalls.lock().expect("no panic");
        let first = before_ns.saturating_sub(time.as_nanos() as u64);
        stalls.iter().any(|(end, stood)| *stood >= length && (first..before_ns).contains(end))
    }

    /// Sends a query to the daemon, as a tool does.
    pub fn ask(&self, what: Query) {
        let mut client = Client::connect(&self.socket, "test").expect("it is there");
        client.ask_patiently(0, &what, &[]).expect("it is answered");
    }

    pub fn command(&self, program: &Path) -> Command {
        let mut command = Command::new(program);
        command.env("RINGCAT_SOCKET", &self.socket).stdout(Stdio::piped());
        command
    }
}

impl Drop for Bench {
    fn drop(&mut self) {
        self.seen.ends.store(true, Ordering::Release);
        if let Some(segment) = self.segment.take() {
            assert!(segment.join().is_ok() || std::thread::panicking());
        }
        self.daemon = None;
    }
}

/// Reads lines of a program until one begins so.
pub fn wait_for_line(child: &mut Child, begin: &str) -> BufReader<std::process::ChildStdout> {
    let mut lines = BufReader::new(child.stdout.take().expect("it is piped"));
    let mut line = String::new();
    while !line.starts_with(begin) {
        line.clear();
        assert!(lines.read_line(&mut line).expect("it is text") > 0, "it has ended before {begin:?}");
    }
    lines
}

// covers: c-interface, daemon
#[test]
fn the_first_application_runs_on_the_bus_of_a_daemon_and_gives_it_back() {
    let examples = root().join("examples/c");
    let Some(first) = program(&examples.join("first_application.c"), &[]) else { return };
    let bench = Bench::start(&examples.join("first_application.toml"), "first");
    for _ in 0..2 {
        let before = bench.connected_ns();
        let wanted = ["Domain1: WC 5.", "5 slave(s).", "AnaIn: operational.", "AL states: 0x0A."];
        let (said, reported, status) = interrupted_after(bench.command(&first).stderr(Stdio::piped()), &wanted);
        assert!(status.success(), "{said}\n{reported}");
        bench.wait_for_connection_after(before);
        bench.wait_for_preop();
    }
}

// covers: c-interface, daemon
#[test]
fn a_killed_program_whose_child_lives_on_leaves_the_bus_to_the_daemon() {
    let Some(forking) = program(&here().join("tests/c/forking.c"), &[]) else { return };
    let bench = Bench::start(&root().join("examples/c/first_application.toml"), "forking");
    let mut parent = bench.command(&forking).stdin(Stdio::piped()).spawn().expect("it runs");
    let mut lines = wait_for_line(&mut parent, "forked");
    // The child holds the connection open until its input ends.
    let input = parent.stdin.take().expect("it is piped");
    let (before, begin) = (bench.connected_ns(), Instant::now());
    parent.kill().expect("it runs");
    bench.wait_for_connection_after(before);
    let after = begin.elapsed();
    println!("the daemon has the bus after {after:?}");
    assert!(after < Duration::from_secs(2), "{after:?}");
    bench.wait_for_preop();
    let connected = bench.connected_ns();
    drop(input);
    let mut line = String::new();
    lines.read_line(&mut line).expect("it is text");
    assert_eq!(line, "child released\n");
    parent.wait().expect("it has ended");
    assert_eq!(bench.connected_ns(), connected, "the child has no bus to give back");
    bench.wait_for_preop();
}

/// What brings the SubDevices to PREOP for the first time is under way when the program comes.
// covers: c-interface, daemon
#[test]
fn a_program_that_starts_with_its_daemon_reaches_op() {
    let Some(cost) = program(&here().join("tests/c/cost.c"), &[]) else { return };
    let segment = crate::library::workshop().join("four.toml");
    let device = "[[device]]\ntype = \"digital-output-8\"\n";
    std::fs::write(&segment, format!("[segment]\n{}", device.repeat(4))).expect("it can be written");
    for round in 0..15 {
        let begin = Instant::now();
        let bench = Bench::begin(&segment, "early", Rights::default(), BusSettings::default());
        std::thread::sleep(Duration::from_millis(2 * round));
        let mut command = Command::new("timeout");
        command.arg("10").arg(&cost).args(["cycles", "1000", "10"]).env("RINGCAT_SOCKET", &bench.socket);
        let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("it runs");
        // It reads a line when all are in OP.
        child.stdin.take().expect("it is piped").write_all(b"go\n").expect("there is room");
        let output = child.wait_with_output().expect("it ends");
        let (said, after) = (String::from_utf8_lossy(&output.stdout), begin.elapsed());
        assert!(output.status.success(), "round {round}: {:?} {said:?} {:?}", output.status, bench.seen);
        println!("round {round}: {after:?}");
        bench.wait_for_preop();
    }
}
