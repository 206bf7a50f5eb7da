//! The daemon on network interfaces: a veth pair between two namespaces, as root with `RINGCAT_ON_THE_WIRE=1`.
//!
//! The segment, the daemon and the applications are processes; the applications run as a user without a right.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use ringcat::daemon::{Answer, Ask, Client, OwnedBus};
use ringcat::sim::cable::HostLink;
use ringcat::sim::network::Network;
use ringcat::sim::segment::Segment;
use ringcat::sim::time::SimTime;
use ringcat::{AlState, Event, Options, Services, automatic};
use ringcat_link::{PacketOptions, PacketSocket, monotonic, wait};

/// What a process of this test program is.
const ROLE: &str = "RINGCAT_TEST_ROLE";
/// The directory of a test.
const PLACE: &str = "RINGCAT_TEST_PLACE";
const LONG: Duration = Duration::from_secs(20);
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
        command.env(ROLE, role).env(PLACE, &self.place).stdout(Stdio::null());
        command
    }

    /// An application without a right.
    fn application(&mut self, role: &str) -> Child {
        let user = ["setpriv", "--reuid", USER, "--regid", USER, "--clear-groups"];
        self.role(&self.near, role, &user).spawn().expect("it starts")
    }

    /// AL states as the SubDevices have them.
    fn states(&self) -> String {
        fs::read_to_string(self.place.join("states")).unwrap_or_default()
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
    loop {
        let now = monotonic::now_ns();
        network.advance(SimTime(now - begin));
        while socket.receive(&mut |frame| network.send(HostLink::Main, frame)) {}
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
    drop(application);
    bus.release().expect("the daemon takes it");
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
    for _ in 0..5 {
        let mut child = bench.application("killed");
        bench.wait_for(AlState::Op);
        child.kill().expect("it runs");
        println!("PREOP {:?} after SIGKILL", bench.wait_for(AlState::PreOp));
        child.wait().expect("it has ended");
    }
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
