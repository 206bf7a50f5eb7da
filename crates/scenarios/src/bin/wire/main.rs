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
//! ethercrab (`ci/bench-wire` arranges all three); without them their rows are missing, and the table states this.

mod back_to_back;
mod bench;
mod cost;
mod others;
mod programs;
mod start_up;

use std::process::ExitCode;
use std::time::Instant;

use scenarios::figures::{Figures, skipped, verdict};
use scenarios::namespaces::Namespaces;

use crate::bench::{Tried, Wire};

/// Adds figures to a table.
type Measure<'a> = &'a dyn Fn(&mut Figures) -> Tried<()>;

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
            return verdict(skipped(&format!("network namespaces need root and iproute2: {reason}")));
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
