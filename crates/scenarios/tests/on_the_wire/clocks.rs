//! Distributed clocks on interfaces. The simulator's clocks run in the segment's own time, which follows this
//! machine's, so latched times are exact even if this machine is late: delays and the lock are checked. The phase of
//! the cycles depends on this machine and is only printed.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use ringcat_sim::cable::{DeviceIndex, HostLink};
use ringcat_sim::controller::Wander;
use ringcat_sim::network::Network;
use ringcat_sim::segment::Segment;
use ringcat_wire::register::map;
use serde_json::Value;

use crate::bench::{Bench, Client, finish, is_asked_for, program};
use crate::foreign::{FOREIGN, start};
use crate::said;

/// A line with clocks of both widths that drift, one SubDevice without a clock, and cables of different lengths.
const LINE: &str = r#"
[[device]]
type = "digital-input-8"
clock_bits = 64
drift_ppm = 30
[[device]]
type = "servo"
drift_ppm = -40
cable_ns = 120
[[device]]
type = "digital-output-8"
clock_bits = 0
cable_ns = 60
[[device]]
type = "digital-input-16"
clock_bits = 32
drift_ppm = 20
cable_ns = 500
[[device]]
type = "servo"
drift_ppm = 50
cable_ns = 80
"#;
/// Two forks of three cables, one behind the other; SubDevices in processing order.
const TREE: &str = r#"
[[device]]
type = "junction"
name = "fork"
clock_bits = 64
[[device]]
type = "digital-input-8"
attach = "fork.3"
clock_bits = 64
drift_ppm = -25
cable_ns = 200
[[device]]
type = "servo"
drift_ppm = 45
[[device]]
type = "digital-input-8"
attach = "fork.1"
clock_bits = 64
cable_ns = 70
[[device]]
type = "junction"
name = "fork-2"
clock_bits = 64
drift_ppm = 10
[[device]]
type = "digital-input-8"
attach = "fork-2.3"
clock_bits = 64
drift_ppm = -50
cable_ns = 400
[[device]]
type = "servo"
attach = "fork-2.1"
"#;
/// A fourth cable for the first fork, with a SubDevice without a clock in between.
const FOURTH: &str = r#"
[[device]]
type = "digital-output-8"
attach = "fork.2"
clock_bits = 0
cable_ns = 1000
[[device]]
type = "servo"
drift_ppm = 15
cable_ns = 90
"#;
/// Maximum error of delays without jitter: rounding, and drift in one measurement.
const WITHIN_NS: i64 = 2;
/// Cycles of ethercrab, and its distributions of the reference time before them.
const CYCLES: &str = "20";
const HANDED_OUT: &str = "200";
/// Time limit for OP, and for the end of programs.
const LIMIT: Duration = Duration::from_secs(20);
/// Allowed error of distributed times, which depends on the load of both ends.
const TIMES_NS: &str = "100000000";
/// BWR of the receive times.
const LATCH: [u8; 16] = [0x10, 0x10, 8, 0, 0, 0, 0x00, 0x09, 4, 0, 0, 0, 0, 0, 0, 0];

/// Delay of every clock from the first, in nanoseconds: times at which one frame passes ideal clocks.
fn truth(segment: &str) -> Vec<Option<i64>> {
    let mut segment = Segment::from_toml(segment, Path::new(".")).expect("a good segment");
    for device in &mut segment.devices {
        (device.clock_start_ns, device.clock_drift_ppb) = (0, 0);
        (device.clock_wander, device.receive_jitter) = (Wander::default(), Duration::ZERO);
    }
    let clocks: Vec<bool> = segment.devices.iter().map(|device| device.dc.is_some()).collect();
    let mut network = Network::from_description(segment).expect("it can be plugged");
    let mut frame = [&[0xFF; 6][..], &[0x02, 0, 0, 0, 0, 1], &[0x88, 0xA4], &LATCH].concat();
    frame.resize(60, 0);
    network.send(HostLink::Main, &frame);
    network.advance_by(Duration::from_millis(1));
    let unit = |device: usize| {
        let bytes = network.device(DeviceIndex(device)).controller.register(map::DC_RECEIVE_TIME_EPU, 4);
        bytes.first_chunk().map_or(0, |bytes| i64::from(u32::from_le_bytes(*bytes)))
    };
    let clocks = clocks.into_iter().enumerate();
    clocks.map(|(device, has_clock)| has_clock.then(|| unit(device) - unit(0))).collect()
}

/// The delay register of each device.
fn written(bench: &Bench, count: usize) -> Vec<i64> {
    let delay = |device: usize| {
        let bytes = bench.order(&format!("register {device} 0x0928 4"));
        let byte = |at: usize| u8::from_str_radix(&bytes[at..at + 2], 16).expect("hexadecimal");
        i64::from(u32::from_le_bytes([byte(0), byte(2), byte(4), byte(6)]))
    };
    (0..count).map(delay).collect()
}

fn file(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("ringcat-wire-clocks-{}-{name}", std::process::id()))
}

/// Checks that the delays of SubDevices with a clock are near the true ones.
fn evaluate(name: &str, delays: &[i64], truth: &[Option<i64>]) {
    let pairs: Vec<(i64, i64)> =
        delays.iter().zip(truth).filter_map(|(delay, truth)| Some((*delay, (*truth)?))).collect();
    println!("{name}: {:?} ns", pairs.iter().map(|(delay, _)| delay).collect::<Vec<_>>());
    assert!(pairs.iter().all(|(delay, truth)| (delay - truth).abs() <= WITHIN_NS), "{name}: expected {truth:?}");
}

// covers: 7.1, dc-delays
#[test]
fn delays_of_ethercrab_and_ringcat_are_equal_and_right() {
    if !is_asked_for(FOREIGN) {
        return;
    }
    let Some(mut bench) = Bench::new(1) else { return };
    let client = program("examples/ethercrab_client");
    // If both differ, those of RingCAT are right: ethercrab ignores cables to SubDevices without a clock, and the last
    // branch of a fork of four cables with another fork behind it.
    let (everywhere, larger) = (LINE.replace("clock_bits = 0", "clock_bits = 64"), format!("{TREE}{FOURTH}"));
    for (name, segment, with_foreign) in
        [("line", everywhere.as_str(), true), ("tree", TREE, true), ("tree with a fourth branch", &larger, false)]
    {
        let truth = truth(segment);
        println!("{name}, truth: {truth:?} ns");
        let count = truth.len();
        bench.simulate(segment, false);
        if with_foreign {
            foreign_delays(&bench, &client, &truth);
        }
        let capture = file("capture.pcapng");
        let path = capture.display().to_string();
        let arguments = ["clocks", "--main", "main0", "--for", "100ms", "--json", "--capture", &path];
        let (json, errors) = said(&bench.ringcat(&arguments));
        let result: Value = serde_json::from_str(json.lines().last().unwrap_or_default()).expect("a line of JSON");
        assert_eq!(result["locked"], true, "{json}{errors}");
        let mut reports = result["clocks"].as_array().expect("clocks").iter().map(|clock| &clock["delay_ns"]);
        let mut reports = || reports.next().expect("a clock").as_i64().expect("a number");
        let reports: Vec<i64> = truth.iter().map(|has_clock| has_clock.map_or(0, |_| reports())).collect();
        evaluate("ringcat reports", &reports, &truth);
        evaluate("ringcat wrote", &written(&bench, count), &truth);
        check_capture(&capture, truth.iter().flatten().count());
        bench.show_simulator_lateness();
    }
}

/// Delays that ethercrab reports and writes.
fn foreign_delays(bench: &Bench, client: &Path, truth: &[Option<i64>]) {
    let count = truth.len();
    let arguments = ["main0".to_owned(), count.to_string(), CYCLES.to_owned(), HANDED_OUT.to_owned()];
    let client = Client::new(start(bench, client, &arguments));
    let reported: Vec<i64> = client.figure("delays").split(',').filter_map(|delay| delay.parse().ok()).collect();
    if reported.len() != count {
        panic!("{}", client.end().1);
    }
    evaluate("ethercrab reports", &reported, truth);
    evaluate("ethercrab wrote", &written(bench, count), truth);
}

/// The capture gives the same delays and offsets.
fn check_capture(path: &Path, clocks: usize) {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../ci/check-clocks");
    let output = Command::new(script).arg(path).args(["--times", TIMES_NS]).output().expect("python3");
    std::fs::remove_file(path).expect("it was written");
    let (text, errors) = said(&output);
    println!("{text}{errors}");
    assert!(output.status.success() && text.contains(&format!("checked: {clocks} delays")), "{text}{errors}");
}

// covers: 7.3, 7.4, dc-tools
#[test]
fn clocks_on_interfaces_lock_and_cycles_follow_sync0() {
    let Some(mut bench) = Bench::new(1) else { return };
    bench.simulate(LINE, false);
    let plot = file("plot.svg");
    let path = plot.display().to_string();
    let clocks = ["clocks", "--main", "main0", "--sync", "auto", "--for", "500ms", "--plot", &path];
    let (text, errors) = said(&bench.ringcat(&clocks));
    println!("{text}{errors}");
    assert!(text.contains("all clocks are locked") && text.contains("SYNC0 1000"), "{text}{errors}");
    let picture = std::fs::read_to_string(&plot).expect("it was drawn");
    std::fs::remove_file(&plot).expect("it was drawn");
    assert!(picture.contains("</svg>") && picture.matches("<title>").count() >= 4);

    let sync = ["--sync", "1:500us:1ms+100us", "--sync", "4:2ms-250us", "--phase", "-300us"];
    let run = bench.run_ringcat(&[&["run", "--main", "main0", "--for", "800ms"][..], &sync].concat());
    let until = Instant::now() + LIMIT;
    while !run.said().so_far().contains("all SubDevices are in OP") {
        assert!(Instant::now() < until, "{}", run.said().so_far());
        std::thread::sleep(Duration::from_millis(20));
    }
    let registers = |device: usize| bench.order(&format!("register {device} 0x0980 2"));
    let cycles = |device: usize| bench.order(&format!("register {device} 0x09a0 8"));
    assert_eq!((registers(1), cycles(1)), ("0007".to_owned(), "20a10700c0270900".to_owned()));
    assert_eq!((registers(4), cycles(4)), ("0003".to_owned(), "80841e0000000000".to_owned()));
    let (text, errors) = run.finish(LIMIT);
    println!("{text}{errors}");
    bench.show_simulator_lateness();
    assert!(text.contains("clocks: 4 of 4 locked") && text.contains("cycles from their phase"), "{text}{errors}");

    let wrong = finish(bench.start_ringcat(&["run", "--main", "main0", "--sync", "2:1ms"]));
    assert_eq!(wrong.status.code(), Some(2));
    assert!(
        said(&wrong).1.contains("SubDevice 2 \"digital-output-8-3\" has no distributed clock"),
        "{:?}",
        said(&wrong)
    );
}
