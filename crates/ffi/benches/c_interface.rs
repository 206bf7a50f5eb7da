//! The C interface beside the Rust API, and an application beside many clients of the daemon.
//!
//! * Instructions in user mode of receive, process, queue and send, with one SubDevice: both programs get their bus
//!   from the same daemon, callgrind counts in the thread of the cycles only.
//! * From the request of a master to OP of 50 SubDevices, in turn with all.
//! * The cycles of an application at 1 kHz without and with 50 clients that ask 100 times in a second each.
//!
//! `cargo bench -p ringcat-ffi`; with the word `bars` the first two parts alone, for CI (`ci/bench --full`). Without
//! a C compiler or valgrind the parts that need them report that.

#[path = "c_interface/callgrind.rs"]
mod callgrind;
#[path = "c_interface/clients.rs"]
mod clients;
#[path = "../tests/programs/library.rs"]
#[allow(dead_code)]
mod library;
#[path = "c_interface/rust.rs"]
mod rust;
#[path = "c_interface/segment.rs"]
mod segment;

use std::path::Path;
use std::process::{Command, ExitCode, Stdio};

use callgrind::{Cost, cost};
use segment::Bench;

/// A start through the C interface may take so much longer than through the Rust API.
const BAR: f64 = 1.1;
/// Its cycle may cost so many more instructions: what was measured (1.23), and 2 %. The aim is 1.1 (docs/ecrt.md).
const CYCLE_BAR: f64 = 1.25;
/// SubDevices of a start, and starts of each kind.
const SUBDEVICES: usize = 50;
const STARTS: usize = 15;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    if let ["rust", rest @ ..] = &words[..] {
        rust::run(rest);
        return ExitCode::SUCCESS;
    }
    if Command::new("cc").arg("--version").output().is_err() {
        return result(skipped("there is no C compiler"));
    }
    // The archive of this bench was made beside an rlib, which is not what is installed.
    let prefix = library::workshop().join("release");
    library::run(Command::new(library::here().join("install")).arg("--prefix").arg(&prefix));
    let program = library::program_with(&prefix, &library::here().join("tests/c/cost.c"), &["-O2"]);
    let mut met = true;
    if callgrind::is_installed() {
        met &= instructions(&program);
    } else {
        met &= skipped("instructions, for valgrind is not installed");
    }
    met &= starts(&program);
    if words.contains(&"bars") {
        return result(met);
    }
    met &= locks_all(&prefix);
    clients::beside_clients(&program);
    result(met)
}

/// Reports that something cannot be measured here, which is a failure with `CI=true`.
fn skipped(reason: &str) -> bool {
    println!("skipped: {reason}");
    !std::env::var("CI").is_ok_and(|value| value == "true")
}

fn result(met: bool) -> ExitCode {
    println!("result: {}", if met { "all bars met" } else { "a bar is MISSED" });
    if met { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// A program that locks all its memory, its code included, at the usual limit of 8 MiB: it works, gets a message which
/// limit to set, or the system does not lock so much code (docs/ecrt.md).
fn locks_all(prefix: &Path) -> bool {
    let program = library::workshop().join("hosts-static");
    let mut cc = Command::new("cc");
    cc.args(["-O2", "-static", "-o"]).arg(&program).arg("-I").arg(prefix.join("include"));
    library::run(cc.arg(library::here().join("tests/c/hosts.c")).arg(prefix.join("lib/libethercat.a")));
    let segment = library::here().join("tests/c/services.toml");
    let (said, reported, status) = library::outputs(&program, &segment, &["all-locked", "8"]);
    println!("linked statically, mlockall(MCL_CURRENT | MCL_FUTURE) at 8 MiB: {status} {}", said.trim());
    println!("    {}", reported.trim().replace('\n', "; "));
    status.success() || ["expected a limit of", "!mlockall(flags)"].iter().any(|reason| reported.contains(reason))
}

fn own() -> std::path::PathBuf {
    std::env::current_exe().expect("a path of this program")
}

fn show(name: &str, cost: &Cost) {
    println!("{name}: {:.0} instructions per cycle", cost.per_cycle());
    for (call, instructions) in cost.calls() {
        println!("    {call:<28} {instructions:.0}");
    }
}

/// Instructions of a cycle: the C interface against the Rust API.
fn instructions(program: &Path) -> bool {
    let bench = Bench::start(1, "digital-output-8");
    let in_c = cost(program, &[], &bench);
    let in_rust = cost(&own(), &["rust"], &bench);
    let in_steps = cost(&own(), &["rust", "steps"], &bench);
    show("C interface", &in_c);
    show("Rust API", &in_rust);
    show("Rust API, each step in a function of its own", &in_steps);
    let ratio = in_c.per_cycle() / in_rust.per_cycle();
    println!("receive, process, queue, send of 1 SubDevice, C against Rust: {ratio:.3} x, bar {CYCLE_BAR}");
    ratio <= CYCLE_BAR
}

/// Nanoseconds that a program prints.
fn start_of(command: &mut Command, segment: &Path) -> u64 {
    let output = command.env("RINGCAT_SIM", segment).stderr(Stdio::null()).output().expect("it runs");
    let text = String::from_utf8_lossy(&output.stdout);
    text.trim().parse().unwrap_or_else(|_| panic!("{:?}: {text:?}", output.status))
}

fn median(times: &mut [u64]) -> u64 {
    times.sort_unstable();
    times[times.len() / 2]
}

/// From the request to OP of all SubDevices, in turn with all; the segment is simulated in the process.
fn starts(program: &Path) -> bool {
    let mut met = true;
    for (kind, product) in [("digital-output-8", "0x07d80008"), ("servo", "0x1b960402")] {
        let segment = segment::file(SUBDEVICES, kind);
        let mut times: [Vec<u64>; 4] = Default::default();
        for _ in 0..STARTS {
            times[0].push(start_of(Command::new(program).args(["start", product]), &segment));
            for (times, way) in times[1..].iter_mut().zip(["start-like-c", "start", "bring-up"]) {
                times.push(start_of(Command::new(own()).args(["rust", way]), &segment));
            }
        }
        let [in_c, like_c, in_rust, in_one] = times.each_mut().map(|times| median(times) as f64 / 1e6);
        let (ratio, to_sii) = (in_c / like_c, in_c / in_rust);
        println!("{SUBDEVICES} of {kind}, request to OP, medians of {STARTS}: C {in_c:.1} ms");
        println!("    Rust with the same work (PREOP, PDOs of dictionaries) {like_c:.1} ms: {ratio:.3} x, bar {BAR}");
        println!("    Rust with the PDOs of the SIIs {in_rust:.1} ms: {to_sii:.3} x; in one step {in_one:.1} ms");
        met &= ratio <= BAR;
    }
    met
}
