//! Commands that get their bus from a daemon: `--master`.

use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use ringcat::daemon::{Answer, Client, OwnedBus, Query};
use ringcat::piped::segment::PipedSegment;
use ringcat::sim::network::Network;
use ringcat::sim::segment::Segment;
use ringcat::{Activity, Options};
use ringcatd::daemon::{Daemon, STOP_LIMIT};
use ringcatd::master::Master;
use ringcatd::rights::Rights;
use ringcatd::wires::Wires;

const RING: &str = "[segment]\nring = true\n[[device]]\ntype = \"coupler\"\n[[device]]\ntype = \"digital-output-8\"\n\
                    [[device]]\ntype = \"servo\"\n[[device]]\ntype = \"servo\"\n";

/// A daemon in this process, with a simulated ring in a thread.
struct Bench {
    socket: PathBuf,
    daemon: Option<Daemon>,
    ends: Arc<AtomicBool>,
    segment: Option<JoinHandle<()>>,
}

impl Bench {
    fn start() -> Bench {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let (near, far) = UnixStream::pair().expect("a pair");
        let ends = Arc::new(AtomicBool::new(false));
        let asked = ends.clone();
        let segment = std::thread::spawn(move || {
            let described = Segment::from_toml(RING, Path::new(".")).expect("it is right");
            let mut segment = PipedSegment::new(Network::from_description(described).expect("it is right"));
            let goes_on = |_: &mut PipedSegment| !asked.load(Ordering::Acquire);
            ringcatd::segment_process::serve(&mut segment, &far, goes_on).expect("the daemon is there");
        });
        let socket = std::env::temp_dir().join(format!("ringcat-cli-{}-{number}", std::process::id()));
        let master = Master::new(3, "test".to_owned(), Wires::to_segment(near).expect("it is right"));
        let daemon = Daemon::start(vec![master], &socket, Rights::default(), STOP_LIMIT).expect("it listens");
        let bench = Bench { socket, daemon: Some(daemon), ends, segment: Some(segment) };
        bench.wait_for_daemon();
        bench
    }

    /// Waits until the daemon drives the bus and has scanned it.
    fn wait_for_daemon(&self) {
        let begin = Instant::now();
        let mut client = Client::connect(&self.socket, "test").expect("the daemon listens");
        loop {
            let asked = client.ask(3, Query::State, Vec::new());
            if matches!(&asked, Ok((Answer::State(state), _)) if state.activity == Activity::Scanned
                && state.subdevices.len() == 4)
            {
                return;
            }
            assert!(begin.elapsed() < Duration::from_secs(20), "{asked:?}");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    fn ringcat(&self, arguments: &[&str]) -> (String, Option<i32>) {
        let mut command = Command::new(env!("CARGO_BIN_EXE_ringcat"));
        command.args(arguments).args(["--master", "3", "--socket"]).arg(&self.socket);
        let Output { status, stdout, stderr } = command.output().expect("it starts");
        let text = String::from_utf8_lossy(&stdout).into_owned() + &String::from_utf8_lossy(&stderr);
        (text, status.code())
    }
}

impl Drop for Bench {
    fn drop(&mut self) {
        self.ends.store(true, Ordering::Release);
        if let Some(segment) = self.segment.take() {
            assert!(segment.join().is_ok() || std::thread::panicking());
        }
        self.daemon = None;
    }
}

// covers: daemon, run
#[test]
fn scan_ring_run_and_clocks_get_their_bus_from_a_daemon_one_after_the_other() {
    let bench = Bench::start();
    let (text, code) = bench.ringcat(&["scan"]);
    assert!(code == Some(0) && text.contains("result: ok: 4 SubDevices"), "{text}");
    bench.wait_for_daemon();
    let (text, code) = bench.ringcat(&["ring", "--for", "10ms"]);
    assert!(code == Some(0) && text.contains("result: ok: the ring is closed, 4 SubDevices"), "{text}");
    bench.wait_for_daemon();
    let capture = bench.socket.with_extension("pcapng");
    // Whether each cycle is complete depends on what else runs on this machine.
    let (text, code) = bench.ringcat(&["run", "--for", "300ms", "--capture", capture.to_str().expect("it is text")]);
    assert!(code.is_some_and(|code| code < 2) && text.contains("stopped: outputs zero"), "{text}");
    assert!(text.contains("4 SubDevices; cycle 1000 us"), "{text}");
    assert!(std::fs::metadata(&capture).expect("it is recorded").len() > 10_000, "{text}");
    std::fs::remove_file(capture).expect("it is there");
    bench.wait_for_daemon();
    let (text, code) = bench.ringcat(&["clocks", "--for", "300ms"]);
    assert!(code.is_some_and(|code| code < 2) && text.contains("delay"), "{text}");
    bench.wait_for_daemon();
}

// covers: daemon, verdict
#[test]
fn a_bus_that_another_application_drives_is_refused_with_its_name() {
    let bench = Bench::start();
    let bus = OwnedBus::take(&bench.socket, 3, "press", &Options::default(), || ()).expect("the daemon drives it");
    for command in ["scan", "ring", "run", "clocks"] {
        let (text, code) = bench.ringcat(&[command]);
        let expected = format!("master 3 is driven by \"press\" (process {})", std::process::id());
        assert!(code == Some(2) && text.contains(&expected), "{text}");
    }
    bus.release().expect("the daemon takes it");
    let none = Command::new(env!("CARGO_BIN_EXE_ringcat"))
        .args(["scan", "--master", "3", "--socket", "/nonexistent/socket"])
        .output()
        .expect("it starts");
    let text = String::from_utf8_lossy(&none.stderr).into_owned() + &String::from_utf8_lossy(&none.stdout);
    assert!(none.status.code() == Some(2) && text.contains("does ringcatd run?"), "{text}");
}

// covers: daemon
#[test]
fn a_master_and_an_interface_exclude_each_other_and_one_is_necessary() {
    let run = |arguments: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_ringcat")).args(arguments).output().expect("it starts");
        assert_eq!(output.status.code(), Some(2));
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    assert!(run(&["scan"]).contains("--main <IF>"));
    assert!(run(&["run", "--master", "0", "--main", "eth1"]).contains("cannot be used with"));
    assert!(run(&["ring", "--main", "eth1", "--socket", "/tmp/s"]).contains("--master <NUMBER>"));
}
