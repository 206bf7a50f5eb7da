//! The daemon on network interfaces: a veth pair between two namespaces, as root with `RINGCAT_ON_THE_WIRE=1`.
//!
//! The segment, the daemon and the applications are processes; the applications run as a user without a right.

use std::fs;
use std::io::Write;
use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use ringcat::daemon::{Answer, Ask, Client, OwnedBus};
use ringcat::sim::cable::HostLink;
use ringcat::sim::network::Network;
use ringcat::sim::segment::Segment;
use ringcat::sim::time::SimTime;
use ringcat::{AlState, Event, Options, Services, automatic};
use ringcat_engine::{Class, class_of};
use ringcat_link::{PacketOptions, PacketSocket, monotonic, wait};

/// What a process of this test program is.
const ROLE: &str = "RINGCAT_TEST_ROLE";
/// The directory of a test.
const PLACE: &str = "RINGCAT_TEST_PLACE";
const LONG: Duration = Duration::from_secs(20);
/// Times of frames that the segment keeps.
const MOST_TIMES: usize = 100_000;
/// Bytes of memory that an application has in use: the kernel tears them down before its descriptors are closed.
const MEMORY: usize = 64 << 20;
/// A signal is delivered, and all threads of the process have stopped, within this time in nanoseconds.
const DELIVERY: u64 = 1_000_000;
/// From SIGKILL to the daemon's first frame: median, longest.
const FIRST_FRAME: [Duration; 2] = [Duration::from_millis(5), Duration::from_millis(20)];
const SEGMENT: &str = "[segment]\n[[device]]\ntype = \"digital-output-8\"\n[[device]]\ntype = \"digital-input-8\"\n\
                       [[device]]\ntype = \"servo\"\n";
/// A user without a right.
const USER: &str = "65534";

/// Namespaces and processes of a test.
struct Bench {
    near: String,
    far: String,
    place: PathBuf,
    processes: Vec<Child>,
}

fn ip(arguments: &str) {
    let done = Command::new("ip").args(arguments.split(' ')).status().expect("ip is there");
    assert!(done.success(), "ip {arguments}");
}

impl Bench {
    /// A segment and a daemon; `None` where such tests are not asked for.
    fn start() -> Option<Bench> {
        if std::env::var_os("RINGCAT_ON_THE_WIRE").is_none() {
            println!("skipped: RINGCAT_ON_THE_WIRE is not set");
            return None;
        }
        let id = std::process::id();
        let (near, far) = (format!("ringcatd{id}near"), format!("ringcatd{id}far"));
        let place = std::env::temp_dir().join(&near);
        fs::create_dir_all(&place).expect("it can be made");
        fs::set_permissions(&place, fs::Permissions::from_mode(0o777)).expect("it is ours");
        for namespace in [&near, &far] {
            ip(&format!("netns add {namespace}"));
        }
        ip(&format!("-n {near} link add near0 index 50 type veth peer name far0 index 60 netns {far}"));
        for (namespace, interface) in [(&near, "near0"), (&far, "far0")] {
            ip(&format!("-n {namespace} link set {interface} addrgenmode none"));
            ip(&format!("-n {namespace} link set {interface} up"));
        }
        let mut bench = Bench { near, far, place, processes: Vec::new() };
        fs::copy(std::env::current_exe().expect("it is known"), bench.place.join("test")).expect("it is read");
        let segment = bench.role(&bench.far, "segment", &[]).spawn().expect("it starts");
        bench.processes.push(segment);
        let mut daemon = Command::new("ip");
        daemon.args(["netns", "exec", &bench.near, env!("CARGO_BIN_EXE_ringcatd"), "--master", "0=near0"]);
        daemon.args(["--group", USER]).arg("--socket").arg(bench.socket());
        let daemon = daemon.spawn().expect("it starts");
        bench.processes.push(daemon);
        bench.wait_for(AlState::PreOp);
        Some(bench)
    }

    fn socket(&self) -> PathBuf {
        self.place.join("socket")
    }

    /// This program in a namespace as a role, as a user if one is given.
    fn role(&self, namespace: &str, role: &str, user: &[&str]) -> Command {
        let mut command = Command::new("ip");
        command.args(["netns", "exec", namespace]).args(user).arg(self.place.join("test"));
        command.args(["--exact", "the_daemon_hands_an_interface_over_and_has_it_back", "--nocapture"]);
        // There it writes its core.
        command.current_dir(&self.place).env(ROLE, role).env(PLACE, &self.place).stdout(Stdio::null());
        command
    }

    /// An application without a right.
    fn application(&mut self, role: &str) -> Child {
        let user = ["prlimit", "--core=unlimited", "setpriv", "--reuid", USER, "--regid", USER, "--clear-groups"];
        self.role(&self.near, role, &user).spawn().expect("it starts")
    }

    /// AL states as the SubDevices have them.
    fn states(&self) -> String {
        fs::read_to_string(self.place.join("states")).unwrap_or_default()
    }

    /// When the daemon's first frame arrived after this time: the first acyclic one that no cyclic frame follows.
    fn first_frame(&self, after_ns: u64) -> Duration {
        let own = self.place.join("asks");
        let _ = fs::remove_file(&own);
        let asks = UnixDatagram::bind(&own).expect("it can be made");
        asks.set_read_timeout(Some(Duration::from_secs(5))).expect("a socket");
        let begin = Instant::now();
        loop {
            asks.send_to(&after_ns.to_ne_bytes(), self.place.join("times")).expect("the segment runs");
            let mut answer = [0; 8];
            asks.recv(&mut answer).expect("the segment answers");
            match u64::from_ne_bytes(answer) {
                0 => assert!(begin.elapsed() < LONG, "no frame of the daemon"),
                at => return Duration::from_nanos(at - after_ns),
            }
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    fn wait_for(&self, state: AlState) -> Duration {
        let wanted = format!("{:?} ", AlState::code(state)).repeat(3);
        let begin = Instant::now();
        while self.states() != wanted {
            assert!(begin.elapsed() < LONG, "{:?}, expected {wanted:?}", self.states());
            std::thread::sleep(Duration::from_millis(1));
        }
        begin.elapsed()
    }
}

impl Drop for Bench {
    fn drop(&mut self) {
        for child in &mut self.processes {
            // It may have ended.
            let _ = child.kill();
            let _ = child.wait();
        }
        for namespace in [&self.near, &self.far] {
            ip(&format!("netns del {namespace}"));
        }
        let _ = fs::remove_dir_all(&self.place);
    }
}

/// The segment: answers frames on its interface, and writes the states of its SubDevices whenever they change.
fn segment(place: &Path) {
    let described = Segment::from_toml(SEGMENT, Path::new(".")).expect("it is right");
    let mut network = Network::from_description(described).expect("it is right");
    let mut socket = PacketSocket::open("far0", &PacketOptions::default()).expect("root may");
    let begin = monotonic::now_ns();
    let mut before = String::new();
    let times = UnixDatagram::bind(place.join("times")).expect("it can be made");
    times.set_nonblocking(true).expect("a socket");
    // Acyclic frames since the last cyclic one.
    let (mut last_cyclic, mut acyclic) = (0, Vec::new());
    loop {
        let now = monotonic::now_ns();
        network.advance(SimTime(now - begin));
        while socket.receive(&mut |frame| {
            match class_of(frame) {
                Some(Class::Acyclic) => acyclic.push(monotonic::now_ns()),
                _ => {
                    last_cyclic = now;
                    acyclic.clear();
                }
            }
            network.send(HostLink::Main, frame);
        }) {}
        acyclic.truncate(MOST_TIMES);
        let mut asked = [0; 8];
        while let Ok((_, from)) = times.recv_from(&mut asked) {
            let after = u64::from_ne_bytes(asked).max(last_cyclic);
            let first = acyclic.iter().find(|at| **at > after).copied().unwrap_or(0);
            let to = from.as_pathname().expect("it has a name");
            times.send_to(&first.to_ne_bytes(), to).expect("it waits");
        }
        while let Some(received) = network.receive(HostLink::Main) {
            socket.send(&received.bytes);
            network.give_back(received.bytes);
        }
        let states: String = network.devices().map(|device| format!("{} ", device.al_status().state)).collect();
        if states != before {
            // Renamed, so that a reader never sees a part.
            fs::write(place.join("states.new"), &states).expect("it can be written");
            fs::rename(place.join("states.new"), place.join("states")).expect("it can be renamed");
            before = states;
        }
        let due = network.next_event().map_or(u64::MAX, |at| at.0.saturating_add(begin));
        wait(&[&socket], due.clamp(now, now + 300_000), socket.mode());
    }
}

/// An application that brings all to OP and cycles: for 300 ms, or until it is killed.
fn application(place: &Path, is_killed: bool) {
    let options = Options::default();
    let memory = std::hint::black_box(vec![1_u8; MEMORY]);
    let mut bus = OwnedBus::take(&place.join("socket"), 0, "application", &options, || ()).expect("it is driven");
    let since = bus.supervisor().events_since(0).expect("it runs");
    let is_resumed = |event: &Event| matches!(event, Event::Resumed { subdevices: 3, in_state: 3, differs: false });
    assert!(since.events.iter().any(|timed| is_resumed(&timed.event)), "{since:?}");
    let found = bus.supervisor().with(|engine| engine.subdevices()).expect("it runs");
    let links = bus.take_links().expect("they are unused");
    let declaration = automatic(&found, Duration::from_millis(4));
    let mut application = bus.supervisor().clone().activate(declaration, links).expect("it fits the scan");
    application.wait_until_op(LONG).expect("all reach OP");
    let begin = Instant::now();
    while is_killed || begin.elapsed() < Duration::from_millis(300) {
        application.cycle(|_| ());
    }
    drop((application, memory));
    bus.release().expect("the daemon takes it");
}

/// Cores are files in the directory of a process, not the input of a program.
fn writes_cores() -> bool {
    fs::read_to_string("/proc/sys/kernel/core_pattern").is_ok_and(|pattern| pattern.starts_with("core"))
}

/// Ends applications with a signal; SIGQUIT writes one with 64 MB. Shows times until the daemon has the bus.
fn killed(bench: &mut Bench, signal: &str, count: usize) {
    let (mut first, mut preop) = (Vec::new(), Vec::new());
    // It has the command built in, so that no time goes into the start of a program.
    let mut shell = Command::new("sh").stdin(Stdio::piped()).spawn().expect("it is there");
    let mut orders = shell.stdin.take().expect("it is piped");
    for _ in 0..count {
        let mut child = bench.application("killed");
        bench.wait_for(AlState::Op);
        let at = monotonic::now_ns();
        writeln!(orders, "kill -{signal} {}", child.id()).expect("it reads");
        // Until the signal is delivered the application goes on; its own frames are no answer.
        first.push(bench.first_frame(at + DELIVERY) + Duration::from_nanos(DELIVERY));
        bench.wait_for(AlState::PreOp);
        preop.push(Duration::from_nanos(monotonic::now_ns() - at));
        child.wait().expect("it has ended");
    }
    drop(orders);
    shell.wait().expect("it ends");
    let cores = fs::read_dir(&bench.place).expect("it is there").flatten().filter(|entry| {
        let is_core = entry.file_name().to_string_lossy().starts_with("core");
        is_core && entry.metadata().is_ok_and(|data| data.len() as usize > MEMORY)
    });
    let cores = cores.map(|entry| fs::remove_file(entry.path()).expect("it is there")).count();
    first.sort_unstable();
    preop.sort_unstable();
    let (median, longest) = (first[count / 2], first[count - 1]);
    println!("{signal} of {count}, cores {cores}: first frame of the daemon {median:?}, longest {longest:?}");
    println!("    PREOP {:?}, longest {:?}", preop[count / 2], preop[count - 1]);
    assert!(signal != "QUIT" || cores > 0 || !writes_cores(), "no core was written");
    assert!(median <= FIRST_FRAME[0] && longest <= FIRST_FRAME[1], "{first:?}, bars {FIRST_FRAME:?}");
}

// covers: daemon, links
#[test]
fn the_daemon_hands_an_interface_over_and_has_it_back() {
    if let (Ok(role), Some(place)) = (std::env::var(ROLE), std::env::var_os(PLACE)) {
        match role.as_str() {
            "segment" => segment(Path::new(&place)),
            role => application(Path::new(&place), role == "killed"),
        }
        return;
    }
    let Some(mut bench) = Bench::start() else { return };
    for _ in 0..3 {
        let mut child = bench.application("orderly");
        assert!(child.wait().expect("it ends").success());
        bench.wait_for(AlState::PreOp);
    }
    killed(&mut bench, "KILL", 50);
    killed(&mut bench, "QUIT", 9);
    // A stopped application loses the interface, and what it sends later goes nowhere.
    let mut child = bench.application("killed");
    bench.wait_for(AlState::Op);
    let signal = |name: &str| Command::new("kill").args([name, &child.id().to_string()]).status().expect("it is there");
    assert!(signal("-STOP").success());
    bench.wait_for(AlState::PreOp);
    assert!(signal("-CONT").success());
    let begin = Instant::now();
    while begin.elapsed() < Duration::from_millis(500) {
        assert_eq!(bench.states(), "2 2 2 ");
        std::thread::sleep(Duration::from_millis(5));
    }
    child.kill().expect("it runs");
    child.wait().expect("it has ended");
    let mut client = Client::connect(&bench.socket(), "test").expect("it listens");
    let Ok((Answer::State(state), _)) = client.ask(0, Ask::State, Vec::new()) else { panic!("it is a state") };
    assert_eq!(state.subdevices.len(), 3);
    assert_eq!(state.acyclic.foreign, 0, "no frame of another MainDevice");
}
