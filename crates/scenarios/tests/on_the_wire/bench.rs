//! Two network namespaces with one or two veth pairs between them, a simulated segment in the one, and programs in the
//! other. All are removed when the bench is dropped.

use std::fmt::{Display, Formatter};
use std::io::{BufRead, BufReader, Read, Write};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Output, Stdio};
use std::sync::mpsc::channel;
use std::sync::{LazyLock, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use scenarios::figures::skipped;

use crate::running::Running;
use crate::said::Said;
use crate::states;

/// One test at a time, because tests would take processor time from each other.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
/// Numbers of interfaces: different at both ends of a pair.
const FIRST_INDEX: [usize; 2] = [50, 60];
/// Time limit for the start of the simulator.
const START_LIMIT: Duration = Duration::from_secs(10);
/// Time limit until all SubDevices are in OP.
const OP_LIMIT: Duration = Duration::from_secs(30);
/// Maximum number of printed lines of the simulator about its lateness.
const LATE_LINES: usize = 5;
/// Time limit for the end of a program.
const END_LIMIT: Duration = Duration::from_secs(90);
/// Both ends sleep until a frame arrives, with priority over other programs: the machine may be busy.
const THREAD: [&str; 4] = ["--receive", "block", "--priority", "50"];

/// Directory of the programs of this repository; they are built if they are out of date, unless
/// RINGCAT_PROGRAMS_ARE_BUILT=1. The whole workspace is built, so that its features are those of the tests.
static PROGRAMS: LazyLock<PathBuf> = LazyLock::new(|| {
    let profile = target_directory();
    if std::env::var("RINGCAT_PROGRAMS_ARE_BUILT").is_ok_and(|value| value == "1") {
        return profile;
    }
    let mut build = Command::new(env!("CARGO"));
    build.args(["build", "--quiet", "--workspace", "--lib", "--bin", "ringcat", "--bin", "ringcatd"]);
    build.args(["--example", "ethercrab_client"]);
    build.arg("--target-dir").arg(profile.parent().expect("a target directory"));
    if !cfg!(debug_assertions) {
        build.arg("--release");
    }
    build.current_dir(env!("CARGO_MANIFEST_DIR"));
    assert!(build.status().expect("cargo starts").success(), "the programs cannot be built");
    profile
});

/// A program of this repository.
pub fn program(name: &str) -> PathBuf {
    PROGRAMS.join(name)
}

/// Directory of this profile's programs.
pub fn target_directory() -> PathBuf {
    let here = std::env::current_exe().expect("the path of the test program");
    here.ancestors().nth(2).expect("tests lie in target/PROFILE/deps").to_owned()
}

/// The bench.
pub struct Bench {
    /// Namespace of the MainDevice, with interfaces `main0` and `main1`.
    main: String,
    /// Namespace of the simulator, with interfaces `sim0` and `sim1`.
    sim: String,
    /// Namespace of another MainDevice or of a remote computer, if a test needs it.
    other: Option<String>,
    simulator: Option<Simulator>,
    _alone: MutexGuard<'static, ()>,
}

/// The simulator while it runs.
struct Simulator {
    child: Child,
    socket: PathBuf,
    said: Said,
}

/// Number and sum of the simulator's delays so far: the machine stalled or was busy.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SimulatorLateness {
    /// Wake-ups.
    pub count: u64,
    /// Sum of the delays.
    pub together_ms: f64,
}

impl Display for SimulatorLateness {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write!(f, "late {} times, {:.1} ms together", self.count, self.together_ms)
    }
}

/// Whether an environment variable enables a layer of tests; prints a line if not. These tests need real time, so they
/// run on request or in CI, not with every `cargo test`.
pub fn is_asked_for(layer: &str) -> bool {
    let asked = std::env::var(layer).is_ok_and(|value| value == "1");
    if !asked {
        println!("skipped: {layer}=1 runs it");
    }
    asked
}

impl Bench {
    /// A bench with this many veth pairs; `None`, with a printed line, if the user or the machine does not allow it.
    pub fn new(pairs: usize) -> Option<Bench> {
        if !is_asked_for("RINGCAT_ON_THE_WIRE") {
            return None;
        }
        let alone = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
        let id = std::process::id();
        let (main, sim) = (format!("ringcat{id}main"), format!("ringcat{id}sim"));
        let bench = Bench { main, sim, other: None, simulator: None, _alone: alone };
        if let Err(reason) = bench.build(pairs) {
            let reason = format!("network namespaces need root and iproute2: {}", reason.trim());
            assert!(skipped(&reason), "{reason}");
            return None;
        }
        Some(bench)
    }

    fn build(&self, pairs: usize) -> Result<(), String> {
        for namespace in [&self.main, &self.sim] {
            ip(&format!("netns add {namespace}"))?;
        }
        for pair in 0..pairs {
            let (main, sim) = (FIRST_INDEX[0] + pair, FIRST_INDEX[1] + pair);
            ip(&format!(
                "-n {} link add main{pair} index {main} type veth peer name sim{pair} index {sim} netns {}",
                self.main, self.sim
            ))?;
            for (namespace, end) in [(&self.main, "main"), (&self.sim, "sim")] {
                // With IPv6 addresses the host would send frames of its own.
                let _ = ip(&format!("-n {namespace} link set {end}{pair} addrgenmode none"));
                ip(&format!("-n {namespace} link set {end}{pair} up"))?;
            }
        }
        Ok(())
    }

    /// Takes the interface `main1` into the namespace of another MainDevice.
    pub fn give_away_main1(&mut self) {
        let other = self.add_namespace();
        ip(&format!("-n {} link set main1 netns {other}", self.main)).expect("the interface is there");
        let _ = ip(&format!("-n {other} link set main1 addrgenmode none"));
        ip(&format!("-n {other} link set main1 up")).expect("the interface is there");
    }

    /// A second MainDevice in the ring, in a namespace of its own: `main1`, the far end of the segment, becomes its
    /// redundant interface, and its main interface `second0` has a cable to `active1` of the first one. Both interfaces
    /// of the second one are off until it forwards.
    pub fn add_second_main_device(&mut self) {
        self.give_away_main1();
        let other = self.other.as_ref().expect("it was just made");
        self.ip_main(&format!("link add active1 index 80 type veth peer name second0 index 90 netns {other}"));
        for (namespace, end) in [(&self.main, "active1"), (other, "second0")] {
            let _ = ip(&format!("-n {namespace} link set {end} addrgenmode none"));
        }
        self.ip_main("link set active1 up");
        self.set_link_elsewhere("main1", "down");
    }

    /// A computer in a separate network, with the MainDevice's host as its router: 10.1.0.2 behind 10.1.0.1.
    pub fn add_routed_computer(&mut self) {
        let other = self.add_namespace();
        self.ip_main(&format!("link add far0 type veth peer name far1 netns {other}"));
        self.ip_main("addr add 10.1.0.1/24 dev far0");
        self.ip_main("link set far0 up");
        for words in ["addr add 10.1.0.2/24 dev far1", "link set far1 up", "route add default via 10.1.0.1"] {
            ip(&format!("-n {other} {words}")).expect("the interface is there");
        }
        let forward = ["-c", "echo 1 > /proc/sys/net/ipv4/ip_forward"];
        assert!(finish(self.start(Path::new("sh"), &forward)).status.success(), "the namespace is ours");
    }

    fn add_namespace(&mut self) -> String {
        let other = format!("{}other", self.main);
        ip(&format!("netns add {other}")).expect("a third namespace");
        self.other = Some(other.clone());
        other
    }

    /// Starts a program in the third namespace.
    pub fn start_elsewhere(&self, path: &Path, arguments: &[&str]) -> Child {
        start(self.command(self.other.as_ref().expect("there is one"), path).args(arguments))
    }

    /// Starts `ringcat` in the namespace of the other MainDevice.
    pub fn start_other_ringcat(&self, arguments: &[&str]) -> Child {
        self.start_elsewhere(&program("ringcat"), &[arguments, &THREAD].concat())
    }

    /// Changes the network of the MainDevice.
    pub fn ip_main(&self, arguments: &str) {
        ip(&format!("-n {} {arguments}", self.main)).expect("a namespace of ours");
    }

    /// Changes the network of the third namespace.
    pub fn ip_elsewhere(&self, arguments: &str) {
        let other = self.other.as_ref().expect("there is one");
        ip(&format!("-n {other} {arguments}")).expect("a namespace of ours");
    }

    /// The interfaces of the MainDevice's namespace, a line each.
    pub fn links_main(&self) -> String {
        let output = Command::new("ip").args(["-n", &self.main, "-o", "link"]).output().expect("ip starts");
        String::from_utf8_lossy(&output.stdout).into_owned()
    }

    /// The interfaces of the third namespace that are switched on, a line each.
    pub fn links_on_elsewhere(&self) -> String {
        let other = self.other.as_ref().expect("there is one");
        let output = Command::new("ip").args(["-n", other, "-o", "link", "show", "up"]).output().expect("ip starts");
        String::from_utf8_lossy(&output.stdout).into_owned()
    }

    /// Starts `ringcat` in the third namespace and reads its output.
    pub fn run_other_ringcat(&self, arguments: &[&str]) -> Running {
        Running::of(self.start_other_ringcat(arguments))
    }

    /// Switches an interface in the third namespace.
    pub fn set_link_elsewhere(&self, interface: &str, state: &str) {
        self.ip_elsewhere(&format!("link set {interface} {state}"));
    }

    /// Starts a program in the simulator's namespace.
    pub fn start_at_sim(&self, path: &Path, arguments: &[&str]) -> Child {
        start(self.command(&self.sim, path).args(arguments))
    }

    /// Switches an interface of the MainDevice or of the simulator.
    pub fn set_link(&self, interface: &str, state: &str) {
        let namespace = if interface.starts_with("main") { &self.main } else { &self.sim };
        ip(&format!("-n {namespace} link set {interface} {state}")).expect("the interface is there");
    }

    /// Starts the simulator on all interfaces; ends the one before.
    pub fn simulate(&mut self, segment: &str, ring: bool) {
        let file = std::env::temp_dir().join(&self.sim).with_extension("toml");
        std::fs::write(&file, segment).expect("the temporary directory is writable");
        self.simulate_file("--segment", &file, ring);
        std::fs::remove_file(&file).expect("it was just written");
    }

    /// As [`Bench::simulate`], from a file that an option of `ringcat sim` names.
    pub fn simulate_file(&mut self, option: &str, file: &Path, ring: bool) {
        self.end_simulator();
        let socket = std::env::temp_dir().join(&self.sim).with_extension("control");
        let mut command = self.command(&self.sim, &program("ringcat"));
        command.args(["sim", "--main", "sim0", option]).arg(file).arg("--control").arg(&socket).args(THREAD);
        if ring {
            command.args(["--redundant", "sim1"]);
        }
        let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("the simulator starts");
        let said = Said::by(child.stdout.take().expect("it is piped"));
        self.simulator = Some(Simulator { child, socket, said });
        let until = Instant::now() + START_LIMIT;
        while self.connect().is_none() {
            assert!(Instant::now() < until, "the simulator does not answer");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    fn connect(&self) -> Option<UnixStream> {
        UnixStream::connect(&self.simulator.as_ref()?.socket).ok()
    }

    /// Output of the simulator.
    pub fn simulator_said(&self) -> &Said {
        &self.simulator.as_ref().expect("it runs").said
    }

    /// Prints the simulator's delays, with its first lines about them.
    pub fn show_simulator_lateness(&self) {
        println!("the simulator meanwhile: {}", self.simulator_lateness());
        let said = self.simulator_said().so_far();
        said.lines().filter(|line| line.contains("was late")).take(LATE_LINES).for_each(|line| println!("{line}"));
    }

    /// The simulator's delays so far.
    pub fn simulator_lateness(&self) -> SimulatorLateness {
        let status = self.order("status");
        let line = status.lines().find(|line| line.starts_with("late wake-ups")).expect("a line of the status");
        let behind = |words: &str| {
            let rest = line.split(words).nth(1).unwrap_or_else(|| panic!("{words} in {line}"));
            rest.split([' ', ',']).next().and_then(|figure| figure.parse::<f64>().ok()).expect("a figure")
        };
        SimulatorLateness { count: behind("): ") as u64, together_ms: behind("together ") }
    }

    /// Sends a command to the simulator that must succeed; returns its answer without the last line.
    pub fn order(&self, line: &str) -> String {
        let mut stream = self.connect().expect("the simulator listens");
        writeln!(stream, "{line}").expect("the simulator reads");
        let mut answer = String::new();
        let mut reader = BufReader::new(stream);
        loop {
            let at = answer.len();
            assert_ne!(reader.read_line(&mut answer).expect("the simulator answers"), 0, "{line}: {answer}");
            match &answer[at..] {
                "ok\n" => return answer[..at].trim_end().to_owned(),
                end => assert!(!end.starts_with("error:"), "{line}: {end}"),
            }
        }
    }

    /// Runs `ringcat` in the namespace of the MainDevice.
    pub fn ringcat(&self, arguments: &[&str]) -> Output {
        finish(self.start_ringcat(arguments))
    }

    /// Starts `ringcat` in the namespace of the MainDevice.
    pub fn start_ringcat(&self, arguments: &[&str]) -> Child {
        self.start(&program("ringcat"), &[arguments, &THREAD].concat())
    }

    /// Starts `ringcat` in the namespace of the MainDevice and reads its output.
    pub fn run_ringcat(&self, arguments: &[&str]) -> Running {
        Running::of(self.start_ringcat(arguments))
    }

    /// Starts a program in the namespace of the MainDevice.
    pub fn start(&self, path: &Path, arguments: &[&str]) -> Child {
        start(self.command(&self.main, path).args(arguments))
    }

    fn command(&self, namespace: &str, path: &Path) -> Command {
        let mut command = Command::new("ip");
        command.args(["netns", "exec", namespace]).arg(path);
        command
    }

    fn end_simulator(&mut self) {
        if let Some(Simulator { mut child, socket, .. }) = self.simulator.take() {
            // It may have ended already.
            let _ = child.kill();
            let _ = child.wait();
            let _ = std::fs::remove_file(socket);
        }
    }
}

impl Drop for Bench {
    fn drop(&mut self) {
        self.end_simulator();
        for namespace in [&self.main, &self.sim].into_iter().chain(&self.other) {
            end_all_in(namespace);
            // A namespace that could not be created cannot be removed.
            let _ = ip(&format!("netns del {namespace}"));
        }
    }
}

/// Ends the programs that a failed test has left in a namespace of this bench, and their children.
fn end_all_in(namespace: &str) {
    let Ok(left) = Command::new("ip").args(["netns", "pids", namespace]).output() else { return };
    for process in String::from_utf8_lossy(&left.stdout).split_whitespace() {
        let _ = Command::new("kill").args(["-KILL", process]).status();
    }
}

fn start(command: &mut Command) -> Child {
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command.spawn().expect("the program starts")
}

fn ip(arguments: &str) -> Result<(), String> {
    let output = Command::new("ip").args(arguments.split(' ')).output().map_err(|error| format!("ip: {error}"))?;
    if output.status.success() { Ok(()) } else { Err(String::from_utf8_lossy(&output.stderr).into_owned()) }
}

/// Waits until this many SubDevices are in OP.
pub fn await_op(bench: &Bench, count: usize) {
    let until = Instant::now() + OP_LIMIT;
    while states(bench, "OP") != count {
        assert!(Instant::now() < until, "{}", bench.order("status"));
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// Waits for a program with a time limit; reads its output meanwhile.
pub fn finish(child: Child) -> Output {
    let process = child.id().to_string();
    let (sender, ended) = channel();
    std::thread::spawn(move || sender.send(child.wait_with_output()));
    match ended.recv_timeout(END_LIMIT) {
        Ok(output) => output.expect("it is our child"),
        Err(_) => {
            let _ = Command::new("kill").args(["-KILL", &process]).status();
            panic!("a program does not end within {} s", END_LIMIT.as_secs());
        }
    }
}

/// A program that prints one line, runs until its input ends, and is killed on drop.
pub struct Client {
    child: Child,
    input: Option<ChildStdin>,
    /// The line.
    pub line: String,
}

impl Client {
    /// Waits for the line.
    pub fn new(mut child: Child) -> Client {
        let mut line = String::new();
        let output = child.stdout.take().expect("it is piped");
        BufReader::new(output).read_line(&mut line).expect("text");
        let input = child.stdin.take();
        Client { child, input, line: line.trim().to_owned() }
    }

    /// A figure of the line.
    pub fn figure(&self, name: &str) -> &str {
        let mut words = self.line.split(' ').skip_while(|word| *word != name);
        words.nth(1).unwrap_or_default()
    }

    /// Ends its input and waits; returns its standard error.
    pub fn end(mut self) -> (bool, String) {
        drop(self.input.take());
        let mut errors = String::new();
        if let Some(mut stderr) = self.child.stderr.take() {
            stderr.read_to_string(&mut errors).expect("text");
        }
        (self.child.wait().expect("it is our child").success(), errors)
    }
}

impl Drop for Client {
    fn drop(&mut self) {
        // It has usually ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
