//! Round trip of a bare frame over a pair of interfaces: the lower limit for every MainDevice on this machine.
//!
//! `echo_floor echo IF` answers every EtherCAT frame as a segment would: it counts the first datagram's WKC up and
//! sets bit 0x02 of the source address. `echo_floor ping IF [--size 60] [--count 100000] [--receive
//! busy|block|hybrid]` measures. `echo_floor` alone, as root, creates two namespaces with a cable and measures there
//! in all modes with two sizes. `--cpu N` pins either end to a processor.
//!
//! `echo_floor paths` compares ways into the kernel there: the packet socket of this crate with its receive ring, one
//! with `recv`, and `AF_XDP` in copy mode (`--path`, see [`NAMES`]). Blocks of all alternate; the echo is the same.
//! With valgrind installed it counts user-side instructions per round trip of those that sleep: what spins executes
//! as many as there is time.

mod path;
mod paths;
mod xdp;

use std::error::Error;
use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio, id};
use std::time::Duration;

use path::{Path, Recv, Ring};
use ringcat_link::monotonic::{now_ns, process_cpu_ns};
use ringcat_link::{PacketOptions, PacketSocket, ReceiveMode, realtime, wait};
use xdp::{Attach, Wait, Xdp};

type Failed = Box<dyn Error>;
type Outcome = Result<(), Failed>;

/// Frames sent before the measured frames.
const WARM_UP: usize = 1000;
/// A frame is lost if it does not return within this time.
const LOST_AFTER_NS: u64 = 1_000_000_000;
/// Where the first datagram's data starts: Ethernet header 14, EtherCAT header 2, datagram header 10.
const DATA: usize = 26;

/// Ways into the kernel, spinning and sleeping.
const NAMES: [&str; 10] = [
    "ring-busy",
    "recv-busy",
    "xdp-generic-busy",
    "xdp-native-busy",
    "xdp-native-busy-wakeup",
    "xdp-native-busy-poll",
    "ring-block",
    "recv-block",
    "xdp-generic-block",
    "xdp-native-block",
];

fn main() -> Outcome {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let option = |name: &str| arguments.iter().position(|a| a == name).and_then(|at| arguments.get(at + 1)).cloned();
    let receive = mode(option("--receive").as_deref().unwrap_or("busy"))?;
    if let Some(Err(warning)) = option("--cpu").map(|cpu| cpu.parse().map(realtime::affinity)).transpose()? {
        eprintln!("{warning}");
    }
    match (arguments.first().map(String::as_str), arguments.get(1)) {
        (Some("echo"), Some(interface)) => echo(interface, receive),
        (Some("ping"), Some(interface)) => {
            let size = option("--size").map_or(Ok(60), |size| size.parse())?;
            let count = option("--count").map_or(Ok(100_000), |count| count.parse())?;
            let mut path = match option("--path") {
                Some(name) => open_path(&name, interface)?,
                None => Box::new(Ring::open(interface, receive)?),
            };
            ping(path.as_mut(), size, count)
        }
        (Some("paths"), None) => paths::compare(),
        (None, _) => both(),
        _ => {
            Err("usage: echo_floor [paths | echo IF | ping IF] [--size N] [--count N] [--receive MODE] [--path PATH] \
                  [--cpu N]"
                .into())
        }
    }
}

fn mode(name: &str) -> Result<ReceiveMode, Failed> {
    match name {
        "busy" => Ok(ReceiveMode::BusyPoll),
        "block" => Ok(ReceiveMode::Blocking),
        "hybrid" => Ok(ReceiveMode::Hybrid { spin: Duration::from_micros(20) }),
        other => Err(format!("--receive is busy, block or hybrid, not {other:?}").into()),
    }
}

fn open_path(name: &str, interface: &str) -> Result<Box<dyn Path>, Failed> {
    let index = index_of(interface)?;
    Ok(match name {
        "ring-busy" => Box::new(Ring::open(interface, ReceiveMode::BusyPoll)?),
        "ring-block" => Box::new(Ring::open(interface, ReceiveMode::Blocking)?),
        "recv-busy" => Box::new(Recv::open(index, true)?),
        "recv-block" => Box::new(Recv::open(index, false)?),
        "xdp-generic-busy" => Box::new(Xdp::open(index, Attach::Generic, Wait::Spin, false)?),
        "xdp-native-busy" => Box::new(Xdp::open(index, Attach::Native, Wait::Spin, false)?),
        "xdp-native-busy-wakeup" => Box::new(Xdp::open(index, Attach::Native, Wait::Spin, true)?),
        "xdp-native-busy-poll" => Box::new(Xdp::open(index, Attach::Native, Wait::BusyPoll, true)?),
        "xdp-generic-block" => Box::new(Xdp::open(index, Attach::Generic, Wait::Sleep, true)?),
        "xdp-native-block" => Box::new(Xdp::open(index, Attach::Native, Wait::Sleep, true)?),
        other => return Err(format!("--path is one of {NAMES:?}, not {other:?}").into()),
    })
}

fn index_of(interface: &str) -> Result<u32, Failed> {
    let index = std::fs::read_to_string(format!("/sys/class/net/{interface}/ifindex"))?;
    Ok(index.trim().parse()?)
}

fn open(interface: &str, receive: ReceiveMode) -> Result<PacketSocket, Failed> {
    Ok(PacketSocket::open(interface, &PacketOptions::default().with_receive(receive))?)
}

/// Answers frames until the process is killed.
fn echo(interface: &str, receive: ReceiveMode) -> Outcome {
    let mut socket = open(interface, receive)?;
    let mut answer = [0; 2048];
    println!("ready");
    loop {
        let mut length = 0;
        wait(&[&socket], u64::MAX, receive);
        socket.receive(&mut |frame| {
            length = frame.len();
            answer[..length].copy_from_slice(frame);
        });
        if length > DATA {
            answer[6] |= 0x02;
            let data = usize::from(u16::from_le_bytes([answer[22], answer[23]]) & 0x07ff);
            if let Some(wkc) = answer.get_mut(DATA + data) {
                *wkc = wkc.wrapping_add(1);
            }
            socket.send(&answer[..length]);
        }
    }
}

/// A broadcast of one BRD datagram that fills a frame of this length.
fn frame(size: usize) -> Vec<u8> {
    let data = size.saturating_sub(DATA + 2).min(1486) as u16;
    let mut frame = vec![0xff; 6];
    frame.extend([0x00, 0, 0, 0, 0, 1, 0x88, 0xa4]);
    frame.extend((0x1000 | (data + 12)).to_le_bytes());
    frame.extend([0x07, 0, 0, 0, 0, 0x10]);
    frame.extend(data.to_le_bytes());
    frame.resize(DATA + 2 + usize::from(data), 0);
    frame
}

/// Sends a frame and waits for its return: the time it took, and whether its content is correct. None if it is lost.
/// Late frames of earlier rounds are skipped.
fn round_trip(path: &mut dyn Path, frame: &[u8]) -> Option<(u64, bool)> {
    let sent = now_ns();
    path.send(frame);
    let mut right = None;
    while right.is_none() {
        let received = path.receive(sent + LOST_AFTER_NS, &mut |back| {
            if back.len() == frame.len() && back[17] == frame[17] {
                right = Some(back[6] & 0x02 != 0 && back[back.len() - 2] == 1);
            }
        });
        if !received && now_ns() >= sent + LOST_AFTER_NS {
            return None;
        }
    }
    right.map(|right| (now_ns() - sent, right))
}

fn ping(path: &mut dyn Path, size: usize, count: usize) -> Outcome {
    let mut frame = frame(size);
    let mut times_ns = Vec::with_capacity(count);
    let (mut lost, mut wrong) = (0, 0);
    let mut begin = (now_ns(), process_cpu_ns());
    for round in 0..WARM_UP + count {
        if round == WARM_UP {
            begin = (now_ns(), process_cpu_ns());
        }
        frame[17] = round as u8 & 0x7f;
        match round_trip(path, &frame) {
            None => lost += 1,
            Some((_, false)) => wrong += 1,
            Some((ns, true)) if round >= WARM_UP => times_ns.push(ns),
            Some(_) => {}
        }
    }
    let (elapsed, cpu) = (now_ns() - begin.0, process_cpu_ns() - begin.1);
    times_ns.sort_unstable();
    let at = |percent: usize| times_ns.get(times_ns.len() * percent / 100).map_or(0.0, |ns| *ns as f64 / 1e3);
    println!(
        "{} bytes: median {:.2} us, minimum {:.2}, 99 % {:.2}, CPU {:.2} us per round trip, {:.0} % of a processor \
         ({count} round trips, lost {lost}, wrong {wrong})",
        frame.len(),
        at(50),
        at(0),
        at(99),
        cpu as f64 / 1e3 / count.max(1) as f64,
        100.0 * cpu as f64 / elapsed.max(1) as f64,
    );
    Ok(())
}

/// Namespaces to remove at the end.
struct Namespaces(Vec<String>);

impl Drop for Namespaces {
    fn drop(&mut self) {
        for name in &self.0 {
            let _ = ip(&["netns", "delete", name]);
        }
    }
}

struct Echo(Child);

impl Drop for Echo {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn ip(arguments: &[&str]) -> Outcome {
    let status = Command::new("ip").args(arguments).status()?;
    if status.success() { Ok(()) } else { Err(format!("ip {} failed", arguments.join(" ")).into()) }
}

/// Two namespaces with a cable between `near` and `far`, and an echo at the far end.
struct Bench {
    // Declared first: it ends before its namespace.
    _echo: Echo,
    near: String,
    _namespaces: Namespaces,
}

impl Bench {
    fn new(receive: &str) -> Result<Bench, Failed> {
        let mut made = Namespaces(Vec::new());
        let names = ["a", "b"].map(|end| format!("echo-floor-{}-{end}", id()));
        for name in &names {
            ip(&["netns", "add", name])?;
            made.0.push(name.clone());
        }
        let [a, b] = names.each_ref().map(String::as_str);
        let near = ["link", "add", "near", "index", "11", "netns", a, "type", "veth"];
        ip(&[&near[..], &["peer", "name", "far", "index", "22", "netns", b]].concat())?;
        ip(&["-n", a, "link", "set", "near", "up"])?;
        ip(&["-n", b, "link", "set", "far", "up"])?;
        let mut echo = Command::new("ip");
        echo.args(["netns", "exec", b]).arg(std::env::current_exe()?);
        echo.args(["echo", "far", "--receive", receive, "--cpu", "1"]);
        let mut echo = Echo(echo.stdout(Stdio::piped()).spawn()?);
        // The process prints a line when it is ready.
        let output = echo.0.stdout.take().ok_or("no output")?;
        BufReader::new(output).read_line(&mut String::new())?;
        Ok(Bench { _echo: echo, near: a.to_owned(), _namespaces: made })
    }

    /// A command at the near end.
    fn near(&self, program: impl AsRef<std::ffi::OsStr>) -> Command {
        let mut command = Command::new("ip");
        command.args(["netns", "exec", &self.near]).arg(program);
        command
    }
}

fn both() -> Outcome {
    for (receive, count) in [("busy", "300000"), ("hybrid", "300000"), ("block", "20000")] {
        let bench = Bench::new(receive)?;
        println!("{receive}:");
        for size in ["60", "1500"] {
            let near = ["ping", "near", "--receive", receive, "--size", size, "--count", count, "--cpu", "0"];
            bench.near(std::env::current_exe()?).args(near).status()?;
        }
    }
    Ok(())
}
