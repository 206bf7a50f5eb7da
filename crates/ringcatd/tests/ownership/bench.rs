//! A daemon on a simulated segment whose SubDevices the test can inspect.

use std::fmt::Write;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use ringcat::daemon::{Client, OwnedBus};
use ringcat::piped::segment::PipedSegment;
use ringcat::sim::network::Network;
use ringcat::sim::segment::Segment;
use ringcat::{Activity, AlState, AlStatus, Options};
use ringcat_control::{Answer, Query};
use ringcatd::daemon::Daemon;
use ringcatd::master::{Master, Settings};
use ringcatd::rights::Rights;
use ringcatd::segment_process;
use ringcatd::wires::Wires;

/// SubDevices reach PREOP within this time on a busy machine.
pub const LONG: Duration = Duration::from_secs(20);

/// Compares a time with its bar on a machine that runs nothing else: with the tests on interfaces (`.ci/run`), where a
/// test has three tries. Otherwise the time is shown only.
pub fn check_bar(what: &str, time: Duration, bar: Duration) {
    println!("{what}: {time:?}, bar {bar:?}");
    assert!(time <= bar || std::env::var_os("RINGCAT_ON_THE_WIRE").is_none(), "{what}: {time:?}, bar {bar:?}");
}

/// One daemon at a time: the tests measure times, and count descriptors.
static TURN: Mutex<()> = Mutex::new(());

/// Waits for the turn of a test.
pub fn turn() -> MutexGuard<'static, ()> {
    TURN.lock().unwrap_or_else(PoisonError::into_inner)
}

type Look = Box<dyn FnOnce(&mut PipedSegment) + Send>;

/// A daemon with master 0.
pub struct Bench {
    pub socket: PathBuf,
    pub daemon: Option<Daemon>,
    looks: Option<Sender<Look>>,
    segment: Option<JoinHandle<()>>,
    directory: PathBuf,
    _turn: MutexGuard<'static, ()>,
}

/// A ring of SubDevices of different kinds.
pub fn ring(count: usize) -> String {
    let mut text = "[segment]\nring = true\n".to_owned();
    for at in 0..count {
        let kind = ["digital-output-8", "digital-input-8", "analog-input-4", "servo"][at % 4];
        write!(text, "[[device]]\ntype = \"{kind}\"\n").expect("a string");
    }
    text
}

/// A directory of its own below that for temporary files.
pub fn directory() -> PathBuf {
    static NUMBER: AtomicU32 = AtomicU32::new(0);
    let number = NUMBER.fetch_add(1, Ordering::Relaxed);
    let path = std::env::temp_dir().join(format!("ringcatd-{}-{number}", std::process::id()));
    std::fs::create_dir_all(&path).expect("it can be made");
    path
}

impl Bench {
    /// A daemon on a ring of so many SubDevices, all in PREOP.
    pub fn start(count: usize) -> Bench {
        Bench::with_limit(count, ringcatd::daemon::STOP_LIMIT)
    }

    /// The same where an owner may be stopped for this time.
    pub fn with_limit(count: usize, stop_limit: Duration) -> Bench {
        Bench::with(count, stop_limit, AlState::PreOp)
    }

    /// The same with a safe state.
    pub fn with(count: usize, stop_limit: Duration, safe_state: AlState) -> Bench {
        Bench::build(count, stop_limit, safe_state, Rights { group: None, mode: 0o664 })
    }

    /// A daemon on a ring of so many SubDevices that these users may use.
    pub fn with_rights(count: usize, rights: Rights) -> Bench {
        Bench::build(count, ringcatd::daemon::STOP_LIMIT, AlState::PreOp, rights)
    }

    fn build(count: usize, stop_limit: Duration, safe_state: AlState, rights: Rights) -> Bench {
        let turn = turn();
        let (near, far) = UnixStream::pair().expect("a pair");
        let (looks, asked) = channel::<Look>();
        let segment = std::thread::spawn(move || simulate(count, &far, &asked));
        let wires = Wires::to_segment(near).expect("the segment is right");
        let directory = directory();
        let socket = directory.join("socket");
        let settings = Settings { safe_state, ..Settings::new(0, "test".to_owned()) };
        let master = Master::start(settings, wires);
        let daemon = Daemon::start(vec![master], &socket, rights, stop_limit).expect("it listens");
        let (daemon, looks, segment) = (Some(daemon), Some(looks), Some(segment));
        let bench = Bench { socket, daemon, looks, segment, directory, _turn: turn };
        bench.wait_until("all in PREOP", |bench| bench.are_in(AlState::PreOp));
        bench.wait_until_scanned(count);
        bench
    }

    /// Waits until the daemon has the bus and so many SubDevices.
    pub fn wait_until_scanned(&self, count: usize) {
        self.wait_until("scanned", |bench| {
            let Answer::State(state) = ask(&mut bench.client(), Query::State) else { return false };
            state.activity == Activity::Scanned && state.subdevices.len() == count
        });
    }

    /// Looks into the segment.
    pub fn inside<T: Send + 'static>(&self, look: impl FnOnce(&mut PipedSegment) -> T + Send + 'static) -> T {
        let (answer, answered) = channel();
        let look = move |segment: &mut PipedSegment| {
            answer.send(look(segment)).expect("the test waits");
        };
        self.looks.as_ref().expect("it runs").send(Box::new(look)).expect("the segment runs");
        answered.recv().expect("the segment runs")
    }

    /// AL status of all SubDevices.
    pub fn states(&self) -> Vec<AlStatus> {
        self.inside(|segment| segment.network_mut().devices().map(|device| device.al_status()).collect())
    }

    /// All SubDevices are in a state without an error.
    pub fn are_in(&self, state: AlState) -> bool {
        self.states().iter().all(|status| *status == AlStatus::new(state))
    }

    /// Waits for something that a busy machine may delay.
    pub fn wait_until(&self, what: &str, holds: impl Fn(&Bench) -> bool) -> Duration {
        let begin = Instant::now();
        while !holds(self) {
            assert!(begin.elapsed() < LONG, "{what}: {:?}", self.states());
            std::thread::sleep(Duration::from_millis(1));
        }
        begin.elapsed()
    }

    /// Takes the bus in this process.
    pub fn take(&self) -> OwnedBus {
        OwnedBus::take(&self.socket, 0, "test", &Options::default(), || ()).expect("the daemon drives it")
    }

    /// A client of the daemon.
    pub fn client(&self) -> Client {
        Client::connect(&self.socket, "client").expect("the daemon listens")
    }
}

fn simulate(count: usize, control: &UnixStream, asked: &Receiver<Look>) {
    let described = Segment::from_toml(&ring(count), Path::new(".")).expect("it is right");
    let mut segment = PipedSegment::new(Network::from_description(described).expect("it is right"));
    let turn = |segment: &mut PipedSegment| {
        loop {
            match asked.try_recv() {
                Ok(look) => look(segment),
                Err(std::sync::mpsc::TryRecvError::Empty) => return true,
                Err(std::sync::mpsc::TryRecvError::Disconnected) => return false,
            }
        }
    };
    segment_process::serve(&mut segment, control, turn).expect("the daemon is there");
}

impl Drop for Bench {
    fn drop(&mut self) {
        self.looks = None;
        if let Some(segment) = self.segment.take() {
            assert!(segment.join().is_ok() || std::thread::panicking());
        }
        self.daemon = None;
        // Another process may have a file open; the directory is for temporary files anyway.
        let _ = std::fs::remove_dir_all(&self.directory);
    }
}

/// An answer that is not data. SubDevices may be in PREOP before the daemon answers for the master, after the end of an
/// application.
pub fn ask(client: &mut Client, ask: Query) -> Answer {
    client.ask_patiently(0, &ask, &[]).expect("it is answered").0
}

/// Copies a program. By another process: a descriptor of this one that is open for writing may be in a child that
/// another test starts, and a program that is open for writing cannot be started.
pub fn copy_program(from: impl AsRef<Path>, to: &Path) {
    let copied = Command::new("cp").arg("--").arg(from.as_ref()).arg(to).status();
    assert!(copied.is_ok_and(|status| status.success()), "{}", to.display());
}
