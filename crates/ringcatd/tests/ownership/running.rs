//! The program `ringcatd`, started with simulated segments, and what it prints.

use std::ffi::OsString;
use std::io::{BufRead, BufReader};
use std::os::unix::fs::PermissionsExt;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStderr, Command, Stdio};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use ringcat::daemon::{Answer, Client, ClientError, Query, Refusal};
use ringcat_control::message::Snapshot;

use crate::bench::{LONG, copy_program, directory, ring, turn};

pub const PROGRAM: &str = env!("CARGO_BIN_EXE_ringcatd");
/// A user without privileges.
pub const UNPRIVILEGED: u32 = 65_534;

/// How the program is started.
#[derive(Default)]
pub struct Start<'a> {
    /// SubDevices of each master's ring.
    pub counts: &'a [usize],
    /// As this user.
    pub user: Option<u32>,
    /// Further options.
    pub options: &'a [&'a str],
    /// Variables of the environment.
    pub variables: &'a [(&'a str, OsString)],
}

/// The running program. It is killed when this is dropped.
pub struct Running {
    pub child: Child,
    pub socket: PathBuf,
    pub directory: PathBuf,
    arguments: Vec<OsString>,
    lines: Arc<Mutex<Vec<String>>>,
    _turn: MutexGuard<'static, ()>,
}

impl Running {
    /// With masters on simulated rings of so many SubDevices.
    pub fn start(counts: &[usize]) -> Running {
        Running::with(&Start { counts, ..Start::default() })
    }

    /// With options and a user.
    pub fn with(start: &Start) -> Running {
        let turn = turn();
        let directory = directory();
        Running::at(start, directory, turn)
    }

    /// The same in a directory that the test has prepared.
    pub fn at(start: &Start, directory: PathBuf, turn: MutexGuard<'static, ()>) -> Running {
        Running::to(start, directory, turn, Stdio::piped())
    }

    /// With a standard error that the test does not read.
    pub fn unread(start: &Start, stderr: impl Into<Stdio>) -> Running {
        let turn = turn();
        Running::to(start, directory(), turn, stderr.into())
    }

    /// With an input that the test holds open.
    pub fn with_input(start: &Start) -> Running {
        let turn = turn();
        Running::between(start, directory(), turn, [Stdio::piped(), Stdio::piped()])
    }

    fn to(start: &Start, directory: PathBuf, turn: MutexGuard<'static, ()>, stderr: Stdio) -> Running {
        Running::between(start, directory, turn, [Stdio::inherit(), stderr])
    }

    /// With this standard input and standard error.
    fn between(
        start: &Start,
        directory: PathBuf,
        turn: MutexGuard<'static, ()>,
        [stdin, stderr]: [Stdio; 2],
    ) -> Running {
        let socket = directory.join("socket");
        let mut arguments = Vec::new();
        for (master, count) in start.counts.iter().enumerate() {
            let file = directory.join(format!("{master}.toml"));
            std::fs::write(&file, ring(*count)).expect("it can be written");
            arguments.extend(["--master".into(), format!("{master}=sim:{}", file.display()).into()]);
        }
        arguments.extend(["--socket".into(), socket.clone().into_os_string()]);
        arguments.extend(start.options.iter().map(OsString::from));
        let mut command = command(&directory, &arguments, start);
        command.stdin(stdin).stderr(stderr);
        let mut child = command.spawn().expect("it starts");
        let lines = Arc::default();
        if let Some(stderr) = child.stderr.take() {
            read(stderr, &lines);
        }
        Running { child, socket, directory, arguments, lines, _turn: turn }
    }

    /// Starts the program again with the same options.
    pub fn start_again(&mut self) {
        let mut command = command(&self.directory, &self.arguments, &Start::default());
        self.child = command.stderr(Stdio::piped()).spawn().expect("it starts");
        read(self.child.stderr.take().expect("it is piped"), &self.lines);
    }

    pub fn client(&self) -> Client {
        let begin = Instant::now();
        loop {
            match Client::connect(&self.socket, "test") {
                Ok(client) => return client,
                Err(error) => assert!(begin.elapsed() < LONG, "{error}; {:?}", self.lines()),
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// What it has printed on its standard error.
    pub fn lines(&self) -> Vec<String> {
        self.lines.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Waits until it has printed lines that hold.
    pub fn wait_for_lines(&self, holds: impl Fn(&[String]) -> bool) {
        let begin = Instant::now();
        while !holds(&self.lines()) {
            assert!(begin.elapsed() < LONG, "{:#?}", self.lines());
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// Sends a signal.
    pub fn signal(&self, name: &str) {
        signal(self.child.id(), name);
    }

    /// Kills it, and waits for its end.
    pub fn kill(&mut self) {
        self.child.kill().expect("it runs");
        self.child.wait().expect("it has ended");
    }

    /// Processes of simulated segments of this program.
    pub fn segments(&self) -> Vec<u32> {
        let wanted = self.directory.as_os_str().as_encoded_bytes();
        let is_segment = |pid: &u32| {
            let line = std::fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
            let has = |wanted: &[u8]| line.windows(wanted.len()).any(|window| window == wanted);
            has(b"--simulate") && has(wanted)
        };
        let all = std::fs::read_dir("/proc").expect("it is there").flatten();
        all.filter_map(|entry| entry.file_name().to_str()?.parse().ok()).filter(is_segment).collect()
    }

    /// Waits until so many processes of segments are there.
    pub fn wait_for_segments(&self, count: usize) {
        let begin = Instant::now();
        while self.segments().len() != count {
            assert!(begin.elapsed() < LONG, "{:?}", self.segments());
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

fn command(directory: &Path, arguments: &[OsString], start: &Start) -> Command {
    let mut command = Command::new(PROGRAM);
    if let Some(user) = start.user {
        let copy = directory.join("ringcatd");
        copy_program(PROGRAM, &copy);
        std::fs::set_permissions(directory, std::fs::Permissions::from_mode(0o777)).expect("it is there");
        command = Command::new(copy);
        command.uid(user).gid(user).current_dir("/");
    }
    command.envs(start.variables.iter().map(|(name, value)| (name, value)));
    command.args(arguments);
    command
}

/// Keeps all lines that come.
fn read(stderr: ChildStderr, lines: &Arc<Mutex<Vec<String>>>) {
    let lines = lines.clone();
    std::thread::spawn(move || {
        for line in BufReader::new(stderr).lines().map_while(Result::ok) {
            lines.lock().unwrap_or_else(PoisonError::into_inner).push(line);
        }
    });
}

/// Sends a signal to a process.
pub fn signal(pid: u32, name: &str) {
    let sent = Command::new("kill").args([name, &pid.to_string()]).status();
    assert!(sent.is_ok_and(|status| status.success()));
}

impl Drop for Running {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
        if std::thread::panicking() {
            println!("{:#?}", self.lines());
        }
        let _ = std::fs::remove_dir_all(&self.directory);
    }
}

fn state(client: &mut Client, master: u32) -> Box<Snapshot> {
    loop {
        match client.ask(master, Query::State, Vec::new()) {
            Ok((Answer::State(state), _)) => return state,
            // It passes from one process to another.
            Err(ClientError::Refused(Refusal::Changing { .. })) => std::thread::sleep(Duration::from_millis(5)),
            other => panic!("{other:?}"),
        }
    }
}

/// Waits until all SubDevices are found and in PREOP.
pub fn wait_for(client: &mut Client, master: u32, count: usize) {
    let begin = Instant::now();
    loop {
        let now = state(client, master);
        let is_in_preop = |position| {
            let status = client.ask(master, Query::AlStatus { position }, Vec::new());
            matches!(status, Ok((Answer::AlStatus { status: 2, .. }, _)))
        };
        if now.subdevices.len() == count && (0..count as u16).all(is_in_preop) {
            return;
        }
        assert!(begin.elapsed() < LONG, "{now:?}");
        std::thread::sleep(Duration::from_millis(10));
    }
}
