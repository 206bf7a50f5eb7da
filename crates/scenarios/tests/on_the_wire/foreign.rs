//! Other MainDevices on the simulator: they bring it to OP, and their process data is right at both ends.
//!
//! They have time limits of their own, which a stall of this machine can exceed. Each therefore has three attempts, and
//! each failed attempt is printed with its output and the simulator's delays.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Child, Command};

use ringcat_sim::catalogue;

use crate::bench::{Bench, Client, finish, is_asked_for, program, target_directory};
use crate::captures::{CaptureFile, PAUSE, interrupt};
use crate::{PLANTS, Plant, RING_OF_16, input, states};

/// Environment variable that enables these tests.
pub const FOREIGN: &str = "RINGCAT_FOREIGN";
/// Python writes no byte code files.
pub const NO_CACHE: &str = "-B";
/// Cycles of process data.
const CYCLES: usize = 500;
/// Allowed cycles with a wrong working counter: a stall of this machine that exceeds the other's time limit is not a
/// fault of the simulator.
const WRONG_ALLOWED: usize = CYCLES / 10;
/// Attempts for each MainDevice and segment.
const TRIES: usize = 3;
/// Installed packages: a MainDevice, and a client of mailbox gateways.
const PACKAGES: [&str; 2] = ["pysoem==1.1.13", "pyetg1510==0.1.3"];

/// Compares the process data of another MainDevice with the devices, and prints its figures.
fn check(plant: &Plant, bench: &Bench, client: Client, name: &str) -> Result<(), String> {
    let figures = client.line.split(" inputs").next().unwrap_or_default();
    println!("{name}, {} SubDevices: {figures}", plant.count());
    if client.line.is_empty() {
        return Err(client.end().1);
    }
    let expect = |what: &str, seen: &str, expected: String| {
        if seen == expected { Ok(()) } else { Err(format!("{what}: {seen}, expected {expected}")) }
    };
    let inputs: Vec<&str> = client.figure("inputs").split(',').collect();
    expect("SubDevices", &inputs.len().to_string(), plant.count().to_string())?;
    for (device, seen) in inputs.iter().enumerate().skip(plant.first_input()).take(plant.inputs) {
        expect(&format!("inputs of device {device}"), seen, format!("{:02x}", input(device)))?;
    }
    for device in usize::from(plant.coupler)..plant.first_input() {
        let sent = format!("{:02x}", (CYCLES - 1 + device) as u8);
        expect(&format!("outputs of device {device}"), &bench.order(&format!("outputs {device}")), sent)?;
    }
    // One output or input counts 1 for reading and 2 for writing by LRW, a servo both.
    let wkc = 2 * plant.outputs + plant.inputs + 3 * plant.servos;
    expect("working counter", client.figure("wkc"), wkc.to_string())?;
    expect("SubDevices in OP", &states(bench, "OP").to_string(), plant.count().to_string())?;
    let wrong: usize = client.figure("wrong").parse().map_err(|_| "no count of wrong cycles".to_owned())?;
    if wrong > WRONG_ALLOWED {
        return Err(format!("{wrong} of {CYCLES} cycles with another working counter"));
    }
    let (ended, errors) = client.end();
    if ended { Ok(()) } else { Err(errors) }
}

/// Runs another MainDevice on a new segment, up to [`TRIES`] times.
pub fn exchange(bench: &mut Bench, plant: &Plant, ring: bool, name: &str, start: impl Fn(&Bench) -> Child) {
    for attempt in 1..=TRIES {
        bench.simulate(&plant.segment(), ring);
        plant.set_inputs(bench);
        let result = check(plant, bench, Client::new(start(bench)), name);
        let late = bench.simulator_lateness();
        match result {
            Ok(()) => {
                println!("  try {attempt} of {TRIES} holds; the simulator was {late}");
                return;
            }
            Err(error) => println!("  try {attempt} of {TRIES} failed: {}; the simulator was {late}", error.trim()),
        }
    }
    panic!("{name} failed {TRIES} times with {} SubDevices", plant.count());
}

// covers: sim-foreign
#[test]
fn ethercrab_exchanges_right_values_with_1_10_and_50_simulated_subdevices() {
    if !is_asked_for(FOREIGN) {
        return;
    }
    let Some(mut bench) = Bench::new(1) else { return };
    let client = program("examples/ethercrab_client");
    for plant in PLANTS {
        let arguments = ["main0".to_owned(), plant.count().to_string(), CYCLES.to_string()];
        exchange(&mut bench, &plant, false, "ethercrab", |bench| start(bench, &client, &arguments));
    }
}

// covers: sim-foreign
#[test]
fn pysoem_exchanges_right_values_with_1_10_and_50_simulated_subdevices() {
    if !is_asked_for(FOREIGN) {
        return;
    }
    let Some(mut bench) = Bench::new(1) else { return };
    let Some(python) = python() else { return };
    for plant in PLANTS {
        exchange(&mut bench, &plant, false, "pysoem", |bench| start_pysoem(bench, &python, "main0", plant.count()));
    }
}

// covers: sim-foreign
#[test]
fn pysoem_exchanges_right_values_on_a_ring_with_two_interfaces() {
    if !is_asked_for(FOREIGN) {
        return;
    }
    let Some(mut bench) = Bench::new(2) else { return };
    let Some(python) = python() else { return };
    let count = RING_OF_16.count();
    exchange(&mut bench, &RING_OF_16, true, "pysoem on a ring", |bench| {
        start_pysoem(bench, &python, "main0,main1", count)
    });
}

// covers: sim-foreign
#[test]
fn pysoem_moves_objects_files_and_firmware_of_a_simulated_subdevice() {
    if !is_asked_for(FOREIGN) {
        return;
    }
    let Some(mut bench) = Bench::new(1) else { return };
    let Some(python) = python() else { return };
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/on_the_wire/pysoem_mailbox.py");
    let arguments = [NO_CACHE, script, "main0"].map(str::to_owned);
    let mut failures = Vec::new();
    while failures.len() < TRIES {
        bench.simulate("[[device]]\ntype = \"all-protocols\"\n", false);
        let capture = CaptureFile::new("mailbox");
        let onlooker = bench.start(&program("ringcat"), &["capture", "--main", "main0", "--out", capture.path()]);
        std::thread::sleep(PAUSE);
        let output = finish(start(&bench, &python, &arguments));
        let said = String::from_utf8_lossy(&output.stdout).into_owned();
        println!("{said}");
        let (seen, errors) = crate::said(&interrupt(onlooker));
        if output.status.success() {
            assert!(seen.contains(" 0 not recorded"), "{seen}{errors}");
            assert!(capture.check_with_tshark() > 1000, "{seen}");
            for step in ["objects ok", "dictionary ok", "files ok", "firmware ok"] {
                assert!(said.contains(step), "{step}");
            }
            return;
        }
        failures.push(String::from_utf8_lossy(&output.stderr).into_owned());
    }
    panic!("{failures:?}");
}

// covers: sim-foreign
#[test]
fn pysoem_lists_the_objects_of_every_device_that_offers_sdo_information() {
    if !is_asked_for(FOREIGN) {
        return;
    }
    let Some(mut bench) = Bench::new(1) else { return };
    let Some(python) = python() else { return };
    let offers = |kind: &&str| {
        let mailbox = catalogue::by_name(kind).and_then(|described| described.mailbox);
        mailbox.is_some_and(|mailbox| mailbox.coe_details.sdo_information())
    };
    let kinds: Vec<&str> = catalogue::names().filter(offers).collect();
    assert!(kinds.len() >= 5, "analogue terminals, servo, all-protocols, ethernet-terminal: {kinds:?}");
    let segment: String = kinds.iter().map(|kind| format!("[[device]]\ntype = \"{kind}\"\n")).collect();
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/on_the_wire/pysoem_dictionary.py");
    let arguments = [NO_CACHE, script, "main0", &kinds.len().to_string()].map(str::to_owned);
    let mut failures = Vec::new();
    while failures.len() < TRIES {
        bench.simulate(&segment, false);
        let output = finish(start(&bench, &python, &arguments));
        let said = String::from_utf8_lossy(&output.stdout).into_owned();
        println!("{said}");
        if output.status.success() {
            assert!(said.contains(&format!("{} described", kinds.len())), "{said}");
            return;
        }
        failures.push(String::from_utf8_lossy(&output.stderr).into_owned());
    }
    panic!("{failures:?}");
}

/// Starts a client with priority over ordinary programs.
pub fn start(bench: &Bench, client: &Path, arguments: &[String]) -> Child {
    let words = ["-n", "-15"].into_iter().map(str::to_owned).chain([client.display().to_string()]);
    let words: Vec<String> = words.chain(arguments.iter().cloned()).collect();
    bench.start(Path::new("nice"), &words.iter().map(String::as_str).collect::<Vec<_>>())
}

pub fn start_pysoem(bench: &Bench, python: &Path, interfaces: &str, count: usize) -> Child {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/on_the_wire/pysoem_client.py");
    let arguments = [NO_CACHE, script, interfaces, &count.to_string(), &CYCLES.to_string()];
    start(bench, python, &arguments.map(str::to_owned))
}

/// A Python with these packages in an environment below the target directory. Only CI creates it automatically.
pub fn python() -> Option<PathBuf> {
    let environment = target_directory().parent()?.join("pysoem");
    let python = environment.join("bin/python");
    let succeeds = |program: &Path, arguments: &[&str]| {
        Command::new(program).args(arguments).output().is_ok_and(|output| output.status.success())
    };
    if succeeds(&python, &["-c", "import pysoem, pyetg1510"]) {
        return Some(python);
    }
    let path = environment.display().to_string();
    let commands = format!("python3 -m venv {path} && {path}/bin/pip install {}", PACKAGES.join(" "));
    if std::env::var("CI").is_ok_and(|ci| ci == "true")
        && succeeds(Path::new("python3"), &["-m", "venv", &path])
        && succeeds(&python, &["-m", "pip", "install", "--quiet", PACKAGES[0], PACKAGES[1]])
    {
        return Some(python);
    }
    // Printed past the output capture of the test harness, so that a skipped test does not look like a pass.
    let words =
        format!("skipped: clients of others are not installed; only CI does that by itself. By hand: {commands}\n");
    let _ = std::io::stderr().write_all(words.as_bytes());
    None
}
