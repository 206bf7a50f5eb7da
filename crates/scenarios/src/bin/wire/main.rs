//! Figures on real interfaces (issues 3 and 16), each with its bar: round trips, system calls, cycles back to back,
//! start-up, the largest cycle rate; RingCAT in all modes beside other MainDevices.
//!
//! All programs run in processes of their own on a veth pair, the MainDevice on one processor, the other end on
//! another. Compared programs alternate in blocks, because the load of the machine varies: medians of the blocks count,
//! and a ratio of wall-clock times fails only where all blocks agree. Where the blocks of one program differ too much,
//! the machine is too noisy for ratios, and the table says so.
//!
//! `wire` takes about a minute, `wire --full` several: more blocks, all programs at all sizes. `RINGCAT_PYTHON` names a
//! Python with pysoem, `RINGCAT_SPINNING_RECV` a library that makes its receive spin, `RINGCAT_ETHERCRAB` the client of
//! ethercrab (`ci/bench-wire` sees to all three); without them their rows are missing, and the table says so.

mod back_to_back;
mod cost;
mod programs;
mod start_up;

use std::path::PathBuf;
use std::process::{Command, ExitCode, Stdio};
use std::time::Instant;

use scenarios::figures::{Figures, verdict};
use scenarios::namespaces::{Namespaces, Server};

type Tried<T> = Result<T, String>;
/// Adds figures to a table.
type Measure<'a> = &'a dyn Fn(&mut Figures) -> Tried<()>;

/// Blocks of compared programs, and with `--full`.
const BLOCKS: [usize; 2] = [3, 7];

/// Coupler, terminals, and drives that have mailboxes.
const MACHINE: &str = "[segment]\nring = true\n[[device]]\ntype = \"coupler\"\ncount = 1\n\
                       [[device]]\ntype = \"digital-output-8\"\ncount = 20\n\
                       [[device]]\ntype = \"digital-input-8\"\ncount = 20\n[[device]]\ntype = \"servo\"\ncount = 9\n";
const TEN: &str = "[segment]\nring = true\n[[device]]\ntype = \"digital-output-8\"\ncount = 5\n\
                   [[device]]\ntype = \"digital-input-8\"\ncount = 5\n";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let full = match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [] => false,
        ["--full"] => true,
        _ => {
            eprintln!("usage: wire [--full]");
            return ExitCode::FAILURE;
        }
    };
    let wire = match Namespaces::new() {
        Ok(namespaces) => Wire::new(namespaces, full),
        Err(reason) => {
            println!("skipped: network namespaces need root and iproute2: {reason}");
            return ExitCode::SUCCESS;
        }
    };
    println!("{}", wire.others.missing());
    let figures: [(&str, Measure<'_>); 5] = [
        ("round trip of a process-data cycle, against a bare echo client", &|figures| wire.round_trips(figures)),
        ("system calls of a cycle, one frame, one link, busy-poll", &|figures| wire.system_calls(figures)),
        ("cycles back to back, servos, simulator as fast as possible", &|figures| wire.back_to_back(figures)),
        ("from the first frame to OP", &|figures| wire.start_up(figures)),
        ("largest cycle rate, 10 SubDevices", &|figures| wire.rate(figures)),
    ];
    let missed = figures.iter().filter(|(heading, measure)| !show(heading, measure)).count();
    verdict(missed == 0)
}

fn show(heading: &str, measure: Measure<'_>) -> bool {
    let mut figures = Figures::new(heading);
    let begin = Instant::now();
    let result = measure(&mut figures);
    let met = figures.print();
    if let Err(reason) = &result {
        println!("  failed: {reason}");
    }
    println!("  (took {:.0} s)", begin.elapsed().as_secs_f64());
    met && result.is_ok()
}

/// The test set-up.
struct Wire {
    namespaces: Namespaces,
    /// Directory of the programs.
    programs: PathBuf,
    others: programs::Others,
    full: bool,
}

impl Wire {
    fn new(namespaces: Namespaces, full: bool) -> Wire {
        let here = std::env::current_exe().unwrap_or_default();
        let programs = here.parent().map(PathBuf::from).unwrap_or_default();
        Wire { namespaces, programs, others: programs::Others::from_environment(), full }
    }

    fn blocks(&self) -> usize {
        BLOCKS[usize::from(self.full)]
    }

    fn ringcat(&self) -> PathBuf {
        self.programs.join("ringcat")
    }

    fn serve(&self, arguments: &[&str]) -> Tried<Server> {
        let fixed = ["--main", "far0", "--receive", "busy", "--cpu", "1"];
        self.namespaces.serve(self.ringcat(), &[arguments, &fixed].concat())
    }

    /// `ringcat bench` at the near end; returns its output.
    fn bench(&self, arguments: &[&str]) -> Tried<String> {
        self.bench_waiting("busy", arguments)
    }

    /// As [`Self::bench`], in this receive mode.
    fn bench_waiting(&self, receive: &str, arguments: &[&str]) -> Tried<String> {
        let mut command = self.namespaces.near(self.ringcat());
        command.arg("bench").args(arguments).args(["--main", "near0", "--receive", receive, "--cpu", "0"]);
        output(command)
    }
}

/// Runs a program to its end; returns its output.
fn output(mut command: Command) -> Tried<String> {
    let output = command.stdin(Stdio::null()).output().map_err(|error| error.to_string())?;
    // 1: measured, but with losses, which a stall of the machine can cause.
    if matches!(output.status.code(), Some(0 | 1)) && !output.stdout.is_empty() {
        return Ok(String::from_utf8_lossy(&output.stdout).into_owned());
    }
    Err(format!("{command:?} failed: {}", String::from_utf8_lossy(&output.stderr).trim()))
}

/// The figure after a name.
fn after(text: &str, name: &str) -> Tried<f64> {
    let rest = text.split_once(name).map(|(_, rest)| rest.trim_start_matches([':', ' ']));
    let end = |rest: &str| rest.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(rest.len());
    let figure = rest.and_then(|rest| rest[..end(rest)].parse().ok());
    figure.ok_or_else(|| format!("no \"{name}\" in {text:?}"))
}
