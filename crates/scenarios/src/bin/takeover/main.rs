//! How soon a new ACTIVE MainDevice sends, and has process data, after its role has changed.
//!
//! In a namespace of its own there are three veth pairs: a ring of `ringcat sim` with 33 SubDevices and 5 kB of process
//! data, and two controllers, which are applications of the library. One of them dies as ACTIVE and its interfaces are
//! switched off; the other one takes over, and hands the role back when the first one has come again. Times count from
//! the beginning of the cycle with which the role changes. The round trip is that of the process data of a later cycle
//! on the same way: while the other controller is dead, the ring is a line.
//!
//! The simulator and the controller that takes over spin, each on a processor. The one that dies sleeps, because a
//! third thread that spins would take a processor from them in the middle of a cycle.

mod controllers;
mod simulator;
mod timed_links;
mod tried;

use std::process::{Command, ExitCode};
use std::time::Instant;

use scenarios::figures::{Figures, median, skipped, verdict};
use scenarios::namespaces::Namespaces;

use controllers::{CYCLE, Measured, TIME_OUT, play};
use simulator::Simulator;
use tried::{Tried, said};

/// Most of the time to the first frame, and of the time to complete process data.
const FIRST_FRAME_US: f64 = 30.0;
const ROUND_TRIPS: f64 = 2.0;
/// Blocks, and takeovers of a block; with `RINGCAT_FULL=1` 100 together.
const FEW: [usize; 2] = [3, 10];
const FULL: [usize; 2] = [5, 20];
/// Least process data.
const BYTES: usize = 5_000;
/// Of this process and its children, so that builds on the same machine do not take their processors.
const NICE: &str = "-15";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let result = match words[..] {
        [] => in_a_namespace(),
        ["inside"] => inside(),
        _ => Err("usage: takeover".to_owned()),
    };
    match result {
        Ok(met) => verdict(met),
        Err(error) => {
            eprintln!("takeover: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Runs this program in a namespace of its own.
fn in_a_namespace() -> Tried<bool> {
    if std::thread::available_parallelism().map_or(1, usize::from) < 2 {
        return Ok(skipped("two threads spin, and there is one processor"));
    }
    let namespaces = match Namespaces::new() {
        Ok(namespaces) => namespaces,
        Err(reason) => {
            return Ok(skipped(&format!("network namespaces need root and iproute2: {reason}")));
        }
    };
    let program = std::env::current_exe().map_err(said)?;
    let status = namespaces.near(program).arg("inside").status().map_err(said)?;
    Ok(status.success())
}

/// Measures on interfaces that it makes in this namespace.
fn inside() -> Tried<bool> {
    // first.MAIN - S1 .. S33 - second.RED, second.MAIN - first.RED.
    for [one, other] in [["first0", "sim0"], ["sim1", "second1"], ["second0", "first1"]] {
        ip(&format!("link add {one} type veth peer name {other}"))?;
        for interface in [one, other] {
            // With IPv6 addresses the host would send frames of its own.
            let _ = ip(&format!("link set {interface} addrgenmode none"));
        }
    }
    for interface in ["sim0", "sim1"] {
        ip(&format!("link set {interface} up"))?;
    }
    // Without the permission it measures at the usual priority.
    let own = std::process::id().to_string();
    let _ = Command::new("renice").args(["-n", NICE, "-p", &own]).output();
    let _simulator = Simulator::start()?;
    let begin = Instant::now();
    let is_full = std::env::var_os("RINGCAT_FULL").is_some_and(|value| value == "1");
    let [count, takeovers] = if is_full { FULL } else { FEW };
    let blocks: Vec<Measured> = (0..count).map(|_| play(takeovers)).collect::<Tried<_>>()?;
    let bytes = blocks[0].bytes;
    if bytes < BYTES {
        return Err(format!("the ring has {bytes} bytes of process data, not {BYTES}"));
    }
    let met = show(&blocks, takeovers);
    println!("  {} takeovers took {:.1} s", count * takeovers, begin.elapsed().as_secs_f64());
    Ok(met)
}

fn show(blocks: &[Measured], takeovers: usize) -> bool {
    let mut figures = Figures::new(&format!(
        "takeover, {} SubDevices, {} bytes, cycle {CYCLE:?}, time-out {TIME_OUT} cycles, spinning receive, medians of \
         {takeovers}",
        simulator::COUNT,
        blocks[0].bytes
    ));
    let of = |figure: fn(&Measured) -> f64| -> Vec<f64> { blocks.iter().map(figure).collect() };
    let handed = of(|it| median(&it.takeovers.iter().map(|it| it.handed).collect::<Vec<_>>()));
    let returned = of(|it| median(&it.takeovers.iter().map(|it| it.returned).collect::<Vec<_>>()));
    let complete = of(|it| median(&it.takeovers.iter().map(|it| it.complete).collect::<Vec<_>>()));
    let round_trips = of(|it| median(&it.round_trips));
    let ratios: Vec<f64> = complete.iter().zip(&round_trips).map(|(complete, trip)| complete / trip).collect();
    figures.at_most_in_blocks("role change to first frame", &handed, FIRST_FRAME_US, "us");
    figures.show("   until the call that sends it has returned", format!("{:.1} us", median(&returned)));
    figures.at_most_in_blocks("role change to complete process data", &ratios, ROUND_TRIPS, "round trips");
    figures.show("   this time", format!("{:.1} us", median(&complete)));
    figures.show("   round trip of the process data of a later cycle", format!("{:.1} us", median(&round_trips)));
    let all = || blocks.iter().flat_map(|it| it.takeovers.iter().map(|it| it.handed));
    figures.show("   longest time to the first frame", format!("{:.1} us", all().fold(0.0, f64::max)));
    let incomplete: usize = blocks.iter().map(|it| it.incomplete).sum();
    let words = "other takeovers, without all frames within a cycle: the machine stalled";
    figures.show(&format!("   {words}"), incomplete);
    figures.print()
}

fn ip(arguments: &str) -> Tried<()> {
    let output = Command::new("ip").args(arguments.split(' ')).output().map_err(said)?;
    if output.status.success() { Ok(()) } else { Err(String::from_utf8_lossy(&output.stderr).trim().to_owned()) }
}
