//! An application in a process of its own: the test program again, as the variable tells.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::Duration;

use ringcat::daemon::OwnedBus;
use ringcat::{Options, Services, automatic};

/// Socket of the daemon, for the process that is an application.
const SOCKET: &str = "RINGCAT_TEST_OWNER";
/// What it does with the bus.
const WORK: &str = "RINGCAT_TEST_WORK";

/// Bytes of memory that an application has in use.
const MEMORY: usize = 64 << 20;

/// What an application does with its bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Work {
    /// Nothing.
    Hold,
    /// It brings all SubDevices to OP and cycles at 1 kHz.
    Cycle,
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
        OwnerProcess::start_by(Command::new(std::env::current_exe().expect("it is known")), socket, work)
    }

    /// Starts one that writes its core where a signal asks for that, into this directory.
    pub fn start_with_core(socket: &Path, directory: &Path) -> OwnerProcess {
        let mut shell = Command::new("sh");
        shell.args(["-c", "ulimit -c unlimited; exec \"$0\" \"$@\""]).current_dir(directory);
        shell.arg(std::env::current_exe().expect("it is known"));
        OwnerProcess::start_by(shell, socket, Work::Cycle)
    }

    fn start_by(mut command: Command, socket: &Path, work: Work) -> OwnerProcess {
        command.args(["--exact", "owner_process::an_application_drives_the_bus_until_its_input_ends", "--nocapture"]);
        command.env(SOCKET, socket).env(WORK, format!("{work:?}"));
        command.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = command.spawn().expect("it starts");
        let input = child.stdin.take();
        let lines = BufReader::new(child.stdout.take().expect("it is piped"));
        let mut owner = OwnerProcess { child, input, lines };
        owner.wait_for("ready");
        owner
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

    /// Sends a signal.
    pub fn signal(&self, name: &str) {
        let sent = Command::new("kill").args([name, &self.child.id().to_string()]).status();
        assert!(sent.is_ok_and(|status| status.success()));
    }

    /// Tells it to end in order.
    pub fn input_ends(&mut self) {
        self.input = None;
    }

    /// Tells it to end in order. The debug level that it had.
    pub fn end_with_level(mut self) -> String {
        self.input_ends();
        let said = self.wait_for("debug level");
        self.wait_for("ended");
        self.child.wait().expect("it ends");
        said
    }

    /// Tells it to end in order, and waits.
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
        let work = if std::env::var(WORK).as_deref() == Ok("Cycle") { Work::Cycle } else { Work::Hold };
        run(Path::new(&socket), work);
        return;
    }
    let bench = crate::bench::Bench::start(4);
    let owner = OwnerProcess::start(&bench.socket, Work::Cycle);
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
        Work::Cycle => {
            let found = bus.supervisor().with(|engine| engine.subdevices()).expect("it runs");
            let links = bus.take_links().expect("they are unused");
            let declaration = automatic(&found, Duration::from_millis(1));
            let activated = bus.supervisor().clone().activate(declaration, links);
            let mut application = activated.expect("it fits the scan");
            application.wait_until_op(Duration::from_secs(20)).expect("all reach OP");
            say("ready");
            while ended.try_recv().is_err() {
                application.cycle(|_| ());
            }
            say(&format!("cycles: {:?}", application.pace()));
        }
    }
    drop(memory);
    let had = bus.ownership().now();
    let level = bus.supervisor().log_filter().map(|filter| filter.level.number()).unwrap_or_default();
    let released = bus.release().map_err(|error| error.to_string());
    say(&format!("debug level {level}"));
    say(&format!("ended: {released:?}, {had:?}"));
}
