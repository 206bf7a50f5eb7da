//! Namespaces and processes of a test.

use std::fs;
use std::io::{BufRead, BufReader};
use std::ops::{Deref, DerefMut};
use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use ringcat::AlState;
use ringcat::daemon::Client;

use crate::roles::{ADDRESS, LINKS, PLACE, ROLE, TEST};

pub const LONG: Duration = Duration::from_secs(20);
/// A user without privileges.
const USER: &str = "65534";
/// A ring of three.
pub const RING: &str = "[segment]\nring = true\n[[device]]\ntype = \"digital-output-8\"\n[[device]]\n\
                        type = \"digital-input-8\"\n[[device]]\ntype = \"servo\"\n";
/// A line of three.
pub const LINE: &str = "[segment]\n[[device]]\ntype = \"digital-output-8\"\n[[device]]\ntype = \"digital-input-8\"\n\
                        [[device]]\ntype = \"servo\"\n";
/// SubDevices of both.
const COUNT: usize = 3;

/// One bench at a time: the tests measure times.
static TURN: Mutex<()> = Mutex::new(());

/// An application. It is killed at the latest when this is dropped, also where a test fails while it is stopped.
pub struct Application(Child);

impl Deref for Application {
    type Target = Child;

    fn deref(&self) -> &Child {
        &self.0
    }
}

impl DerefMut for Application {
    fn deref_mut(&mut self) -> &mut Child {
        &mut self.0
    }
}

impl Drop for Application {
    fn drop(&mut self) {
        // It may have ended.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Namespaces and processes of a test.
pub struct Bench {
    pub near: String,
    pub far: String,
    pub place: PathBuf,
    processes: Vec<Child>,
    /// Processes of this test program end with their inputs, however it ends.
    inputs: Vec<ChildStdin>,
    lines: Arc<Mutex<Vec<String>>>,
    _turn: MutexGuard<'static, ()>,
}

pub fn ip(arguments: &str) {
    let done = Command::new("ip").args(arguments.split(' ')).status().expect("ip is there");
    assert!(done.success(), "ip {arguments}");
}

/// By another process: a descriptor of this one that is open for writing may be in a child that another test starts,
/// and a program that is open for writing cannot be started.
fn copy_program(from: &Path, to: &Path) {
    let copied = Command::new("cp").arg("--").arg(from).arg(to).status();
    assert!(copied.is_ok_and(|status| status.success()), "{}", to.display());
}

impl Bench {
    /// Two namespaces with cables for these links, numbered from 0; `None` where such tests are not asked for.
    pub fn make(segment: &str, links: &[u32]) -> Option<Bench> {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        if std::env::var_os("RINGCAT_ON_THE_WIRE").is_none() {
            println!("skipped: RINGCAT_ON_THE_WIRE is not set");
            return None;
        }
        let turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
        let id = format!("{}x{}", std::process::id(), NUMBER.fetch_add(1, Ordering::Relaxed));
        let (near, far) = (format!("ringcatd{id}near"), format!("ringcatd{id}far"));
        let place = std::env::temp_dir().join(&near);
        fs::create_dir_all(&place).expect("it can be made");
        fs::set_permissions(&place, fs::Permissions::from_mode(0o777)).expect("it is writable");
        fs::write(place.join("segment.toml"), segment).expect("it can be written");
        copy_program(&std::env::current_exe().expect("it is known"), &place.join("test"));
        for namespace in [&near, &far] {
            ip(&format!("netns add {namespace}"));
        }
        let bench =
            Bench { near, far, place, processes: Vec::new(), inputs: Vec::new(), lines: Arc::default(), _turn: turn };
        links.iter().for_each(|link| bench.plug_in(*link));
        Some(bench)
    }

    /// The cable of a link, with an interface at each end: `near0` to `far0`, and so on.
    pub fn plug_in(&self, link: u32) {
        let Bench { near, far, .. } = self;
        ip(&format!("-n {near} link add near{link} type veth peer name far{link} netns {far}"));
        for (namespace, interface) in [(near, format!("near{link}")), (far, format!("far{link}"))] {
            ip(&format!("-n {namespace} link set {interface} addrgenmode none"));
            ip(&format!("-n {namespace} link set {interface} up"));
        }
    }

    /// Both interfaces of a link are removed.
    pub fn pull_out(&self, link: u32) {
        ip(&format!("-n {} link del near{link}", self.near));
    }

    /// Starts the segment at the far ends of these links.
    pub fn start_segment(&mut self, links: &str) {
        let mut segment = self.role(&self.far, "segment", &[]);
        let mut segment = segment.env(LINKS, links).stdin(Stdio::piped()).spawn().expect("it starts");
        self.inputs.extend(segment.stdin.take());
        self.processes.push(segment);
    }

    /// Starts a daemon in the near namespace with these options; its number, to kill it.
    pub fn start_daemon(&mut self, options: &[&str]) -> usize {
        self.start_daemon_at(&self.socket(), options)
    }

    /// The same with another socket.
    pub fn start_daemon_at(&mut self, socket: &Path, options: &[&str]) -> usize {
        self.start_program(&[env!("CARGO_BIN_EXE_ringcatd")], options, socket)
    }

    /// The same as a user without privileges.
    pub fn start_daemon_as_user(&mut self, options: &[&str]) -> usize {
        let program = self.place.join("ringcatd");
        copy_program(env!("CARGO_BIN_EXE_ringcatd").as_ref(), &program);
        let program = program.to_str().expect("it is text");
        // Files of root beside the socket stay.
        for entry in fs::read_dir(&self.place).expect("it is there").flatten() {
            if entry.file_name().to_string_lossy().ends_with(".lock") {
                fs::remove_file(entry.path()).expect("it is writable");
            }
        }
        self.start_program(
            &["setpriv", "--reuid", USER, "--regid", USER, "--clear-groups", program],
            options,
            &self.socket(),
        )
    }

    fn start_program(&mut self, program: &[&str], options: &[&str], socket: &Path) -> usize {
        let mut daemon = Command::new("ip");
        daemon.args(["netns", "exec", &self.near]).args(program).args(options);
        daemon.args(["--group", USER]).arg("--socket").arg(socket).stderr(Stdio::piped());
        let mut daemon = daemon.spawn().expect("it starts");
        let (stderr, lines) = (daemon.stderr.take().expect("it is piped"), self.lines.clone());
        std::thread::spawn(move || {
            for line in BufReader::new(stderr).lines().map_while(Result::ok) {
                lines.lock().unwrap_or_else(PoisonError::into_inner).push(line);
            }
        });
        self.processes.push(daemon);
        self.processes.len() - 1
    }

    /// Kills a daemon.
    pub fn kill_daemon(&mut self, number: usize) {
        self.processes[number].kill().expect("it runs");
        self.processes[number].wait().expect("it has ended");
    }

    /// Ends a daemon in order.
    pub fn end_daemon(&mut self, number: usize) {
        let sent = Command::new("kill").args(["-TERM", &self.pid(number).to_string()]).status();
        assert!(sent.is_ok_and(|status| status.success()));
        assert!(self.processes[number].wait().expect("it ends").success());
    }

    /// Process id of a process.
    pub fn pid(&self, number: usize) -> u32 {
        self.processes[number].id()
    }

    /// Whether a web server at this address answers in the near namespace.
    pub fn fetches(&self, address: &str) -> bool {
        let mut fetch = self.role(&self.near, "fetch", &[]);
        fetch.env(ADDRESS, address).stdin(Stdio::null()).stderr(Stdio::null()).status().expect("it runs").success()
    }

    /// Runs a role with an interface of the near namespace, until it ends.
    pub fn with_interface(&self, role: &str, name: &str) {
        let mut process = self.role(&self.near, role, &[]);
        // The input of a role is open as long as it runs.
        let mut process = process.env(ADDRESS, name).stdin(Stdio::piped()).spawn().expect("it starts");
        let input = process.stdin.take();
        assert!(process.wait().expect("it ends").success(), "{role} {name}: {:#?}", self.lines());
        drop(input);
    }

    pub fn socket(&self) -> PathBuf {
        self.place.join("socket")
    }

    pub fn client(&self) -> Client {
        self.client_at(&self.socket())
    }

    /// A client of the daemon at this socket.
    pub fn client_at(&self, socket: &Path) -> Client {
        let begin = Instant::now();
        loop {
            match Client::connect(socket, "test") {
                Ok(client) => return client,
                Err(error) => assert!(begin.elapsed() < LONG, "{error}; {:#?}", self.lines()),
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// What daemons have printed.
    pub fn lines(&self) -> Vec<String> {
        self.lines.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Waits until a daemon has printed a line with this text.
    pub fn wait_for_line(&self, text: &str) {
        self.wait_until(text, || self.lines().iter().any(|line| line.contains(text)));
    }

    pub fn wait_until(&self, what: &str, holds: impl Fn() -> bool) -> Duration {
        let begin = Instant::now();
        while !holds() {
            assert!(begin.elapsed() < LONG, "{what}: {:?}, {:#?}", self.states(), self.lines());
            std::thread::sleep(Duration::from_millis(1));
        }
        begin.elapsed()
    }

    /// This program in a namespace as a role, as a user if one is given.
    fn role(&self, namespace: &str, role: &str, user: &[&str]) -> Command {
        let mut command = Command::new("ip");
        command.args(["netns", "exec", namespace]).args(user).arg(self.place.join("test"));
        command.args(["--exact", TEST, "--nocapture"]);
        // There it writes its core.
        command.current_dir(&self.place).env(ROLE, role).env(PLACE, &self.place).stdout(Stdio::null());
        command
    }

    /// An application without privileges.
    pub fn application(&mut self, role: &str) -> Application {
        let user = ["prlimit", "--core=unlimited", "setpriv", "--reuid", USER, "--regid", USER, "--clear-groups"];
        let mut application = self.role(&self.near, role, &user).stdin(Stdio::piped()).spawn().expect("it starts");
        // Not with the child, which closes it before it is waited for.
        self.inputs.extend(application.stdin.take());
        Application(application)
    }

    /// AL states as the SubDevices have them.
    pub fn states(&self) -> String {
        fs::read_to_string(self.place.join("states")).unwrap_or_default()
    }

    /// When the daemon's first frame arrived after this time: the first acyclic one that no cyclic frame follows.
    pub fn first_frame(&self, after_ns: u64) -> Duration {
        let own = self.place.join("answers");
        let _ = fs::remove_file(&own);
        let socket = UnixDatagram::bind(&own).expect("it can be made");
        socket.set_read_timeout(Some(Duration::from_secs(5))).expect("a socket");
        let begin = Instant::now();
        loop {
            socket.send_to(&after_ns.to_ne_bytes(), self.place.join("times")).expect("the segment runs");
            let mut answer = [0; 8];
            socket.recv(&mut answer).expect("the segment answers");
            match u64::from_ne_bytes(answer) {
                0 => assert!(begin.elapsed() < LONG, "no frame of the daemon"),
                at => return Duration::from_nanos(at - after_ns),
            }
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    /// Waits until all SubDevices are in a state.
    pub fn wait_for(&self, state: AlState) -> Duration {
        let wanted = format!("{} ", state.code()).repeat(COUNT);
        self.wait_until(&format!("all in {state}"), || self.states() == wanted)
    }
}

impl Drop for Bench {
    fn drop(&mut self) {
        for child in &mut self.processes {
            // It may have ended.
            let _ = child.kill();
            let _ = child.wait();
        }
        if std::thread::panicking() {
            println!("{:#?}", self.lines());
        }
        for namespace in [&self.near, &self.far] {
            ip(&format!("netns del {namespace}"));
        }
        let _ = fs::remove_dir_all(&self.place);
    }
}
