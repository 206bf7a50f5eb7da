//! A C program with a cyclic loop on a ring whose cables are cut and repaired.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::Duration;

use ringcat::network::{NetworkFile, ScanOptions};
use ringcat::sim::cable::CableId;
use ringcat::sim::fault::Fault;
use ringcat::simulated::SimulatedSegment;
use ringcat::{MainDevice, Options};

use crate::daemon::{Bench, wait_for_line};
use crate::library::{here, program, workshop};

const SUBDEVICES: usize = 8;
/// A second try needs 5 ms of it: this machine may stall for the rest.
const PERIOD: Duration = Duration::from_millis(30);
/// Number of phases of a round trip in which cuts and repairs occur.
const PHASES: u32 = 12;
/// Closed, the ring takes 9 cables of 50 us.
const SEGMENT: &str = "[segment]\nring = true\ncable_ns = 50000\n[[device]]\ntype = \"digital-output-8\"\ncount = 8\n";
const FLIGHT: Duration = Duration::from_micros(50 * (SUBDEVICES as u64 + 1));

/// Number of runs: an undetected stall of the machine fails a run, but hardly all of them.
const RUNS: usize = 3;

/// A file with this name.
fn file(name: &str, contents: &str) -> PathBuf {
    let path = workshop().join(name);
    std::fs::write(&path, contents).expect("a file");
    path
}

/// Runs the program in a mode while cables are cut and repaired; the number of incomplete cycles, without those beside
/// stalls of this machine that leave no time for a second try.
fn run(program: &Path, mode: &str, network: Option<&Path>) -> usize {
    let bench = Bench::start(&file(&format!("lossless-{mode}.toml"), SEGMENT), &format!("lossless-{mode}"));
    let mut command = bench.command(program);
    command.args([&PERIOD.as_micros().to_string(), mode]).args(network);
    let mut child = command.stdin(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it runs");
    let mut lines = wait_for_line(&mut child, "op");
    for phase in 0..PHASES {
        let cable = CableId(1 + phase as usize * 3 % (SUBDEVICES - 1));
        for fault in [Fault::Cut(cable), Fault::Heal(cable)] {
            bench.fault_after_a_frame(fault, FLIGHT * phase / PHASES);
            std::thread::sleep(PERIOD * 3);
        }
    }
    drop(child.stdin.take());
    let mut said = String::new();
    lines.read_to_string(&mut said).expect("it is text");
    let output = child.wait_with_output().expect("it ends");
    assert!(output.status.success(), "{mode}: {said}\n{}", String::from_utf8_lossy(&output.stderr));
    let number = |line: &str, begin: &str| line.strip_prefix(begin)?.split(',').next()?.parse::<u64>().ok();
    let times: Vec<u64> = said.lines().filter_map(|line| number(line, "incomplete ")).collect();
    let is_judged = |time: &&u64| !bench.has_stalled(PERIOD / 4, **time, PERIOD * 3);
    let incomplete = times.iter().filter(is_judged).count();
    println!("{mode}: {incomplete} incomplete, {} beside stalls; {said}", times.len() - incomplete);
    incomplete
}

/// The same ring as a network file whose domain sends lost frames again.
fn network_file() -> PathBuf {
    let links = SimulatedSegment::from_toml(SEGMENT).expect("the segment is valid");
    let mut main_device = MainDevice::request(links, &Options::default());
    let scan = main_device.scan().expect("it is scanned");
    let text = NetworkFile::from_scan(&scan.subdevices, &scan.topology, &ScanOptions::new("machine", PERIOD)).to_text();
    let at = text.find("period = ").expect("a domain has a period");
    file("lossless-network.toml", &format!("{}send_again = true\n{}", &text[..at], &text[at..]))
}

// covers: c-interface, lost-frames, network-file
#[test]
fn a_c_program_loses_no_cycle_at_cuts_and_repairs_of_its_ring() {
    let Some(program) = program(&here().join("tests/c/lossless.c"), &[]) else { return };
    let network = network_file();
    for (mode, network) in [("again", None), ("file", Some(&*network))] {
        assert!(
            (0..RUNS).any(|_| run(&program, mode, network) == 0),
            "{mode}: cycles were lost in each of {RUNS} runs"
        );
    }
    // Without sending again, and in a loop that receives too late for it, the same cuts cost cycles.
    for mode in ["once", "late"] {
        assert!(run(&program, mode, None) > 0, "{mode}");
    }
}
