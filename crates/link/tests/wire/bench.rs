//! Two network namespaces with an Ethernet cable between them, created for one test and removed after it.
//!
//! Output: a [`Bench`], or None with a printed line if this user may not create one. The names contain the process id,
//! and the two ends have different interface indices.

use std::ffi::OsStr;
use std::fs::{self, File};
use std::os::fd::AsRawFd;
use std::process::{Command, id};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;

use ringcat_link::monotonic::now_ns;
use ringcat_link::{ClassFilter, PacketOptions, PacketSocket, ReceiveMode, wait};

/// One bench at a time: the tests measure times, and machines are small.
static TURN: Mutex<()> = Mutex::new(());

/// Counts benches, for their names.
static COUNT: AtomicU32 = AtomicU32::new(0);

/// Indices of the two ends.
pub const NEAR_INDEX: u32 = 11;
pub const FAR_INDEX: u32 = 22;

/// A namespace, removed when it is dropped.
pub struct Namespace {
    pub name: String,
}

impl Namespace {
    fn make(name: String) -> Result<Namespace, String> {
        ip(&["netns", "add", &name])?;
        let namespace = Namespace { name };
        namespace.run(|| {
            // Frames of the host itself, such as neighbour discovery, would disturb the tests.
            let _ = fs::write("/proc/sys/net/ipv6/conf/default/disable_ipv6", "1");
        });
        Ok(namespace)
    }

    /// Runs `job` in a thread in this namespace. Sockets opened there stay in it.
    pub fn run<T: Send>(&self, job: impl FnOnce() -> T + Send) -> T {
        let inside = || {
            let path = format!("/var/run/netns/{}", self.name);
            let file = File::open(path).expect("the namespace was just made");
            // SAFETY: the descriptor is open; only this thread changes its namespace.
            let result = unsafe { libc::setns(file.as_raw_fd(), libc::CLONE_NEWNET) };
            assert_eq!(result, 0, "{}", std::io::Error::last_os_error());
            job()
        };
        thread::scope(|scope| scope.spawn(inside).join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
    }

    /// Runs `ip` in this namespace.
    pub fn ip(&self, arguments: &[&str]) {
        let mut all = vec!["-n", &self.name];
        all.extend(arguments);
        ip(&all).expect("ip in our namespace");
    }

    /// Output of `ip` in this namespace.
    pub fn ask_ip(&self, arguments: &[&str]) -> String {
        let output = Command::new("ip").args(["-n", &self.name]).args(arguments).output().expect("ip has run before");
        String::from_utf8_lossy(&output.stdout).into_owned()
    }

    /// A program to run in this namespace.
    pub fn command(&self, program: impl AsRef<OsStr>) -> Command {
        let mut command = Command::new("ip");
        command.args(["netns", "exec", &self.name]).arg(program);
        command
    }
}

impl Drop for Namespace {
    fn drop(&mut self) {
        // Also removes its interfaces. A failure here must not hide the failure that caused the drop.
        if let Err(error) = ip(&["netns", "delete", &self.name]) {
            eprintln!("{error}");
        }
    }
}

fn ip(arguments: &[&str]) -> Result<(), String> {
    let output = Command::new("ip").args(arguments).output().map_err(|error| format!("ip: {error}"))?;
    let said = || String::from_utf8_lossy(&output.stderr).trim().to_owned();
    if output.status.success() { Ok(()) } else { Err(format!("ip {}: {}", arguments.join(" "), said())) }
}

/// Interface `near` in one namespace, `far` in the other, a cable between them, both up.
pub struct Bench {
    pub near: Namespace,
    pub far: Namespace,
    _turn: MutexGuard<'static, ()>,
}

impl Bench {
    /// Creates a bench; None, with a printed line, if that is not possible here.
    pub fn make() -> Option<Bench> {
        if std::env::var("RINGCAT_ON_THE_WIRE").as_deref() != Ok("1") {
            println!("skipped: RINGCAT_ON_THE_WIRE=1 runs it");
            return None;
        }
        // SAFETY: no pointers are passed.
        if unsafe { libc::geteuid() } != 0 {
            println!("skipped: needs root");
            return None;
        }
        // A failed test has removed its namespaces too.
        let turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
        let name = |end: &str| format!("rc-link-{}-{}-{end}", id(), COUNT.fetch_add(1, Ordering::Relaxed));
        match Namespace::make(name("near")).and_then(|near| Ok((near, Namespace::make(name("far"))?))) {
            Ok((near, far)) => {
                let bench = Bench { near, far, _turn: turn };
                bench.plug();
                Some(bench)
            }
            Err(error) => {
                println!("skipped: needs root that may make network namespaces: {error}");
                None
            }
        }
    }

    /// Creates the cable and both interfaces.
    pub fn plug(&self) {
        let (near, far) = (NEAR_INDEX.to_string(), FAR_INDEX.to_string());
        let near_end = ["link", "add", "near", "index", &near, "netns", &self.near.name, "type", "veth"];
        let far_end = ["peer", "name", "far", "index", &far, "netns", &self.far.name];
        ip(&[&near_end[..], &far_end[..]].concat()).expect("a pair of interfaces");
        self.near.ip(&["link", "set", "near", "up"]);
        self.far.ip(&["link", "set", "far", "up"]);
    }

    /// A socket on the near end.
    pub fn near_socket(&self, options: PacketOptions) -> PacketSocket {
        self.near.run(|| PacketSocket::open("near", &options)).expect("a socket")
    }

    /// A socket for all frames on the far end.
    pub fn far_socket(&self) -> PacketSocket {
        self.far.run(|| PacketSocket::open("far", &PacketOptions::default())).expect("a socket")
    }
}

/// Options for one class.
pub fn class(filter: ClassFilter) -> PacketOptions {
    PacketOptions::default().with_filter(filter)
}

/// A broadcast of one datagram BRD of AL_STATUS with this Idx and a number in its data.
pub fn ethercat(idx: u8, number: u16) -> Vec<u8> {
    let mut frame = vec![0xff; 6];
    frame.extend([0x02, 0, 0, 0, 0, 1, 0x88, 0xa4, 0x0e, 0x10, 0x07, idx, 0, 0, 0x30, 0x01, 2, 0, 0, 0]);
    frame.extend(number.to_le_bytes());
    frame.resize(60, 0);
    frame
}

/// Longest delay of a frame that the kernel postpones under load.
const LATE_NS: u64 = 2_000_000_000;

/// Waits for this many frames; also takes further frames that are available.
pub fn take(socket: &mut PacketSocket, count: usize) -> Vec<Vec<u8>> {
    let (mut frames, until) = (Vec::new(), now_ns() + LATE_NS);
    while frames.len() < count && wait(&[socket], until, ReceiveMode::Blocking) {
        socket.receive(&mut |frame| frames.push(frame.to_vec()));
    }
    frames.extend(drain(socket));
    frames
}

/// All frames that wait.
pub fn drain(socket: &mut PacketSocket) -> Vec<Vec<u8>> {
    let mut frames = Vec::new();
    while socket.receive(&mut |frame| frames.push(frame.to_vec())) {}
    frames
}
