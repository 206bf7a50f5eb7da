//! An application in a process of its own: the test program again, as the variable states.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

use ringcat::daemon::OwnedBus;
use ringcat::{Declaration, Options, Output, Services, SubDeviceConfig};

use crate::bench::LONG;

/// Socket of the daemon, for the process that is an application.
const SOCKET: &str = "RINGCAT_TEST_OWNER";
/// What it does with the bus.
const WORK: &str = "RINGCAT_TEST_WORK";

/// Bytes of memory that an application has in use.
const MEMORY: usize = 64 << 20;

/// Units of 100 us that watchdogs wait with [`Work::Patient`].
const PATIENCE: u16 = u16::MAX;

/// What an application does with its bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Work {
    /// Nothing.
    Hold,
    /// It brings all SubDevices to OP and cycles at 1 kHz, with all outputs of the first one set.
    Cycle,
    /// The same where the first one has no watchdog of process data.
    Unwatched,
    /// The same where watchdogs wait longer than a busy machine delays a cycle: all stay in OP.
    Patient,
    /// As [`Work::Cycle`], and ends by `exit` without a release.
    Exit,
}

impl Work {
    fn of_environment() -> Work {
        let name = std::env::var(WORK).expect("it is set with the socket");
        let all = [Work::Hold, Work::Cycle, Work::Unwatched, Work::Patient, Work::Exit];
        all.into_iter().find(|work| format!("{work:?}") == name).expect("it is one of them")
    }
}

/// An application. It is killed at the latest when this is dropped.
pub struct OwnerProcess {
    pub child: Child,
    input: Option<ChildStdin>,
    lines: BufReader<ChildStdout>,
}

impl OwnerProcess {
    /// Starts one; it has the bus, and with [`Work::Cycle`] all SubDevices in OP, when this returns.
    pub fn start(socket: &Path, work: Work) -> OwnerProcess {
        OwnerProcess::begin(socket, work).ready()
    }

    /// Starts one, without waiting for anything.
    pub fn begin(socket: &Path, work: Work) -> OwnerProcess {
        OwnerProcess::start_by(Command::new(std::env::current_exe().expect("it is known")), socket, work)
    }

    fn ready(mut self) -> OwnerProcess {
        self.wait_for("ready");
        self
    }

    /// Starts one that writes its core if a signal requires it, into this directory.
    pub fn start_with_core(socket: &Path, directory: &Path) -> OwnerProcess {
        let mut shell = Command::new("sh");
        shell.args(["-c", "ulimit -c unlimited; exec \"$0\" \"$@\""]).current_dir(directory);
        shell.arg(std::env::current_exe().expect("it is known"));
        OwnerProcess::start_by(shell, socket, Work::Cycle).ready()
    }

    fn start_by(mut command: Command, socket: &Path, work: Work) -> OwnerProcess {
        command.args(["--exact", "owner_process::an_application_drives_the_bus_until_its_input_ends", "--nocapture"]);
        command.env(SOCKET, socket).env(WORK, format!("{work:?}"));
        command.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = command.spawn().expect("it starts");
        let input = child.stdin.take();
        let lines = BufReader::new(child.stdout.take().expect("it is piped"));
        OwnerProcess { child, input, lines }
    }

    /// Waits for a line.
    pub fn wait_for(&mut self, expected: &str) -> String {
        let mut all = String::new();
        loop {
            let mut line = String::new();
            assert!(self.lines.read_line(&mut line).expect("it is text") > 0, "it has ended: {all}");
            // The runner of tests prints the name of the test before the first line.
            if let Some(at) = line.find(expected) {
                return line[at..].trim_end().to_owned();
            }
            all += &line;
        }
    }

    /// Sends a signal. A process that is to stop has stopped when this returns.
    pub fn signal(&self, name: &str) {
        let sent = Command::new("kill").args([name, &self.child.id().to_string()]).status();
        assert!(sent.is_ok_and(|status| status.success()));
        if name == "-STOP" {
            let begin = Instant::now();
            while self.is_any_thread_running() {
                assert!(begin.elapsed() < LONG, "it does not stop");
                std::thread::sleep(Duration::from_micros(200));
            }
        }
    }

    /// Whether one of its threads has not stopped.
    fn is_any_thread_running(&self) -> bool {
        let tasks = std::fs::read_dir(format!("/proc/{}/task", self.child.id())).expect("it is a child").flatten();
        tasks.into_iter().any(|task| {
            let state = std::fs::read_to_string(task.path().join("stat")).unwrap_or_default();
            // Behind the name of the program, which is in brackets.
            state.rsplit_once(") ").is_some_and(|(_, rest)| !rest.starts_with('T'))
        })
    }

    /// Orders it to end.
    pub fn input_ends(&mut self) {
        self.input = None;
    }

    /// Orders it to end. The debug level that it had.
    pub fn end_with_level(mut self) -> String {
        self.input_ends();
        let said = self.wait_for("debug level");
        self.wait_for("ended");
        self.child.wait().expect("it ends");
        said
    }

    /// Orders it to end, and waits.
    pub fn end(mut self) -> String {
        self.input_ends();
        let said = self.wait_for("ended");
        self.child.wait().expect("it ends");
        said
    }
}

impl Drop for OwnerProcess {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Where the variable is set this is the application; otherwise one is started.
// covers: daemon
#[test]
fn an_application_drives_the_bus_until_its_input_ends() {
    if let Ok(socket) = std::env::var(SOCKET) {
        run(Path::new(&socket), Work::of_environment());
        return;
    }
    let bench = crate::bench::Bench::start(4);
    let owner = OwnerProcess::start(&bench.socket, Work::Patient);
    assert!(bench.are_in(ringcat::AlState::Op), "{:?}", bench.states());
    assert_eq!(owner.end(), "ended: Ok(()), Held");
    bench.wait_until("all in PREOP", |bench| bench.are_in(ringcat::AlState::PreOp));
}

fn say(text: &str) {
    let mut output = std::io::stdout().lock();
    writeln!(output, "{text}").and_then(|()| output.flush()).expect("the test reads");
}

/// The end of the input, from another thread.
fn ended() -> std::sync::mpsc::Receiver<()> {
    let (sender, receiver) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        let _ = std::io::stdin().lock().read_line(&mut String::new());
        sender.send(())
    });
    receiver
}

fn run(socket: &Path, work: Work) {
    let options = Options::default();
    let mut bus = OwnedBus::take(socket, 0, "application", &options, || ()).expect("the daemon drives it");
    let ended = ended();
    // The kernel tears the memory of a killed process down before its descriptors are closed.
    let memory = std::hint::black_box(vec![1_u8; MEMORY]);
    match work {
        Work::Hold => {
            say("ready");
            while ended.try_recv().is_err() {
                std::thread::sleep(Duration::from_millis(5));
            }
        }
        Work::Cycle | Work::Unwatched | Work::Patient | Work::Exit => cycle(&mut bus, work, &ended),
    }
    drop(memory);
    let had = bus.ownership().now();
    let level = bus.supervisor().log_filter().map(|filter| filter.level.number()).unwrap_or_default();
    let released = bus.release().map_err(|error| error.to_string());
    say(&format!("debug level {level}"));
    say(&format!("ended: {released:?}, {had:?}"));
}

/// Brings all to OP, and cycles until the input ends.
fn cycle(bus: &mut OwnedBus, work: Work, ended: &std::sync::mpsc::Receiver<()>) {
    let found = bus.supervisor().subdevices().expect("it runs");
    let links = bus.take_links().expect("they are unused");
    let mut declaration = Declaration::new(Duration::from_millis(1));
    let declared = found.iter().enumerate().map(|(at, info)| match SubDeviceConfig::from_info(info) {
        config if work == Work::Unwatched && at == 0 => config.watchdog(None, Some(0)),
        config if work == Work::Patient => config.watchdog(None, Some(PATIENCE)),
        config => config,
    });
    let subdevices: Vec<_> = declared.map(|config| declaration.add(config)).collect();
    let activated = bus.supervisor().clone().activate(declaration, links);
    let mut application = activated.expect("it fits the scan");
    let outputs = (0..8).map(|at| application.output(subdevices[0], 0x7000 + 0x10 * at, 1).expect("it has eight"));
    let outputs: Vec<Output<bool>> = outputs.collect();
    application.wait_until_op(Duration::from_secs(20)).expect("all reach OP");
    say("ready");
    while ended.try_recv().is_err() {
        application.cycle(|data| outputs.iter().for_each(|output| data.set(*output, true)));
    }
    if work == Work::Exit {
        // Nothing is dropped.
        std::process::exit(0);
    }
    say(&format!("cycles: {:?}", application.pace()));
}
