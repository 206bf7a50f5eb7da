//! A daemon on a simulated segment, in this process.

use std::fmt::Write;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use ringcat::Activity;
use ringcat::daemon::{Answer, Client, Query};
use ringcat::piped::segment::PipedSegment;
use ringcat::sim::network::Network;
use ringcat::sim::segment::Segment;
use ringcatd::daemon::{Daemon, STOP_LIMIT};
use ringcatd::master::Master;
use ringcatd::rights::Rights;
use ringcatd::wires::Wires;

/// A daemon with master 0.
pub struct Bench {
    pub socket: PathBuf,
    daemon: Option<Daemon>,
    ends: Arc<AtomicBool>,
    segment: Option<JoinHandle<()>>,
}

fn text(count: usize, kind: &str) -> String {
    let mut text = "[segment]\n".to_owned();
    for _ in 0..count {
        write!(text, "[[device]]\ntype = \"{kind}\"\n").expect("a string");
    }
    text
}

/// A segment file with this number of SubDevices of a kind.
pub fn file(count: usize, kind: &str) -> PathBuf {
    let path = crate::library::workshop().join(format!("{count}-{kind}.toml"));
    std::fs::write(&path, text(count, kind)).expect("it can be written");
    path
}

impl Bench {
    /// A daemon on a line of this number of SubDevices of a kind, scanned.
    pub fn start(count: usize, kind: &str) -> Bench {
        let (near, far) = UnixStream::pair().expect("a pair");
        let ends = Arc::new(AtomicBool::new(false));
        let (asked, description) = (ends.clone(), text(count, kind));
        let segment = std::thread::spawn(move || {
            let described = Segment::from_toml(&description, Path::new(".")).expect("it is right");
            let mut segment = PipedSegment::new(Network::from_description(described).expect("it is right"));
            let goes_on = |_: &mut PipedSegment| !asked.load(Ordering::Acquire);
            ringcatd::segment_process::serve(&mut segment, &far, goes_on).expect("the daemon is there");
        });
        let socket = std::env::temp_dir().join(format!("ringcat-bench-{}", std::process::id()));
        let master = Master::new(0, "bench".to_owned(), Wires::to_segment(near).expect("it is right"));
        let daemon = Daemon::start(vec![master], &socket, Rights::default(), STOP_LIMIT).expect("it listens");
        let bench = Bench { socket, daemon: Some(daemon), ends, segment: Some(segment) };
        let begin = Instant::now();
        let mut client = Client::connect(&bench.socket, "bench").expect("the daemon listens");
        let mut is_scanned = || {
            let asked = client.ask(0, Query::State, Vec::new());
            matches!(asked, Ok((Answer::State(state), _))
                if state.activity == Activity::Scanned && state.subdevices.len() == count)
        };
        while !is_scanned() {
            assert!(begin.elapsed() < Duration::from_secs(20));
            std::thread::sleep(Duration::from_millis(5));
        }
        bench
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
