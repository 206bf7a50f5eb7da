//! Two masters, a broken ring, a SubDevice that is gone.

use std::path::Path;
use std::time::{Duration, Instant};

use ringcat::automatic;
use ringcat::sim::cable::CableId;
use ringcat::sim::cable::DeviceIndex;
use ringcat::sim::fault::Fault;
use ringcat::sim::segment::Segment;

use crate::bench::{Bench, Driver};

const KINDS: [&str; 3] = ["digital-output-8", "digital-input-8", "analog-input-4"];

pub fn ring(count: usize, is_ring: bool) -> Segment {
    let mut text = format!("[segment]\nring = {is_ring}\n");
    (0..count).for_each(|at| text += &format!("[[device]]\ntype = \"{}\"\n", KINDS[at % KINDS.len()]));
    Segment::from_toml(&text, Path::new(".")).expect("it is right")
}

// covers: daemon
#[test]
fn lists_of_two_masters_have_headers_and_single_commands_ask_for_one() {
    let bench = Bench::start(vec![ring(1, false), ring(2, true)]);
    let one = bench.good(&["slaves", "-m1"]);
    let both = bench.good(&["slaves"]);
    let indented: String = one.lines().map(|line| format!("  {line}\n")).collect();
    assert!(
        both.starts_with("Master0\n  0  0:0  PREOP  +  ") && both.ends_with(&format!("Master1\n{indented}")),
        "{both}"
    );
    let masters = bench.good(&["master"]);
    assert!(masters.contains("Master0\n") && masters.contains("Master1\n") && masters.contains("    Backup: "));
    for command in [&["graph"][..], &["upload", "1", "1"], &["crc"], &["xml"]] {
        let wanted = format!("{} requires to select a single master!\n", command[0]);
        assert!(bench.bad(command).starts_with(&wanted), "{command:?}");
    }
    let missing = bench.bad(&["-m", "0,7", "slaves"]);
    assert_eq!(missing, "Failed to open master 7: there is no master 7; there are: 0, 1\n");
    assert!(bench.good(&["pdos", "-m1"]).starts_with("=== Master 1, Slave 0 ===\nSM0: PhysAddr 0x"));
}

// covers: daemon
#[test]
fn a_master_that_waits_for_its_interface_lists_none_and_says_why() {
    let bench = Bench::start_beside_a_waiting_master(vec![ring(2, false)]);
    let why = "master 1 is not driven: ";
    for command in [&["slaves"][..], &["slaves", "-v"], &["pdos"], &["cstruct"], &["sdos"], &["states", "PREOP"]] {
        let done = bench.tool(command);
        assert!(done.code == Some(0) && done.err.starts_with(why), "{command:?}: {done:?}");
        let lines = |text: &str| {
            let lines = text.lines().map(str::trim_start).filter(|line| *line != "Master0" && *line != "Master1");
            lines.map(str::to_owned).collect::<Vec<String>>()
        };
        assert_eq!(lines(&done.out), lines(&bench.good(&[command, &["-m0"]].concat())), "{command:?}");
    }
    for (command, shown) in [("ring", "ring "), ("events", "0: ["), ("clocks", "")] {
        let done = bench.tool(&[command]);
        assert!(done.code == Some(0) && done.err.contains(why) && done.out.contains(shown), "{command}: {done:?}");
    }
    // Commands that show nothing of a bus without an application, and commands without output.
    for command in [&["config"][..], &["domains"], &["data"], &["eoe"], &["debug", "1"], &["rescan"]] {
        let done = bench.tool(command);
        assert!(done.code == Some(0) && done.err.starts_with(why) && done.out.is_empty(), "{command:?}: {done:?}");
        let one = bench.tool(&[command, &["-m1"]].concat());
        assert!(one.code == Some(0) && one.err.starts_with(why) && one.out.is_empty(), "{command:?} -m1: {one:?}");
    }
    for command in ["config", "domains", "data", "eoe"] {
        let done = bench.tool(&[command, "--json"]);
        assert!(done.code == Some(0) && done.out.lines().count() == 2, "{command}: {done:?}");
    }
    assert!(bench.good(&["master"]).contains("(waiting...)"));
    let single = bench.bad(&["upload", "-m1", "-p0", "0x1000", "0"]);
    assert!(single.starts_with(&format!("ringcatd: {why}")), "{single}");
}

// covers: daemon
#[test]
fn a_broken_ring_is_shown_between_the_slaves() {
    let bench = Bench::start(vec![ring(4, true)]);
    bench.inside(0, |segment| segment.network_mut().apply(Fault::Cut(CableId(2))));
    bench.wait_until("the break", || bench.good(&["slaves"]).contains("xxx LINK FAILURE xxx"));
    let listed = bench.good(&["slaves"]);
    assert_eq!(listed.lines().position(|line| line.starts_with("xxx")), Some(2), "{listed}");
    assert_eq!(listed.matches("PREOP").count(), 4);
    let details = bench.good(&["slaves", "-v"]);
    assert_eq!((details.matches("Device: Main\n").count(), details.matches("Device: Backup\n").count()), (2, 2));
    bench.inside(0, |segment| segment.network_mut().apply(Fault::Heal(CableId(2))));
    bench.wait_until("the ring", || !bench.good(&["slaves"]).contains("xxx"));
}

// covers: daemon
#[test]
fn slaves_without_power_leave_the_list() {
    let bench = Bench::start(vec![ring(3, false)]);
    bench.inside(0, |segment| segment.network_mut().apply(Fault::PowerOff(DeviceIndex(2))));
    bench.wait_until("two are left", || bench.good(&["slaves"]).lines().count() == 2);
    bench.inside(0, |segment| segment.network_mut().apply(Fault::PowerOn(DeviceIndex(2))));
    bench.wait_until("three are there", || bench.good(&["slaves"]).matches("PREOP").count() == 3);
}

/// Runs of a measurement.
const RUNS: usize = 41;
/// `ethercat slaves` with 100 SubDevices, from its start to its end.
const BAR: Duration = Duration::from_millis(15);

/// The middle one of the times of a list, on a machine that may be busy: the bar holds where nothing else runs
/// (`.ci/run`), and is shown otherwise.
fn measure(bench: &Bench, what: &str) {
    let mut times: Vec<Duration> = (0..RUNS)
        .map(|_| {
            let begin = Instant::now();
            assert_eq!(bench.good(&["slaves"]).lines().count(), 100);
            begin.elapsed()
        })
        .collect();
    times.sort();
    let middle = times[RUNS / 2];
    println!("ethercat slaves, 100 SubDevices, {what}: {middle:?}, longest {:?}, bar {BAR:?}", times[RUNS - 1]);
    assert!(middle <= BAR || std::env::var_os("RINGCAT_ON_THE_WIRE").is_none(), "{what}: {middle:?}");
}

// covers: daemon
#[test]
fn a_list_of_100_slaves_comes_within_15_ms_idle_and_beside_cycles() {
    let bench = Bench::start(vec![ring(100, true)]);
    measure(&bench, "idle");
    let driver = Driver::start(&bench, |found| automatic(found, Duration::from_millis(1)));
    measure(&bench, "beside cycles of 1 ms");
    println!("cycles: {}", driver.end());
}
