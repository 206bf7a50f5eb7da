//! Real Ethernet frames: our MainDevice and those of others, each in a process of its own, on veth pairs in front of
//! simulated segments. Needs RINGCAT_ON_THE_WIRE=1 (for MainDevices of others RINGCAT_FOREIGN=1 too), root and iproute2;
//! prints a line and passes where they are missing.
//!
//! Times are printed, not judged: the machine that tests run on may be busy with anything.

mod bench;
mod messages;

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output};
use std::time::Duration;

use bench::{Bench, Client, finish, is_asked_for, program, target_directory};

/// Cycles of other MainDevices.
const CYCLES: usize = 500;
/// MainDevices of others have time limits of their own, which a stall of the machine breaks: they are run on request.
const FOREIGN: &str = "RINGCAT_FOREIGN";
/// The version of pysoem that is installed.
const PYSOEM: &str = "pysoem==1.1.13";

/// So many SubDevices of the catalogue: outputs first, then inputs, with a coupler and drives where there is room.
struct Plant {
    outputs: usize,
    inputs: usize,
    servos: usize,
    coupler: bool,
}

const PLANTS: [Plant; 3] = [
    Plant { outputs: 1, inputs: 0, servos: 0, coupler: false },
    Plant { outputs: 5, inputs: 5, servos: 0, coupler: false },
    Plant { outputs: 20, inputs: 20, servos: 9, coupler: true },
];
const RING_OF_16: Plant = Plant { outputs: 8, inputs: 5, servos: 2, coupler: true };

impl Plant {
    fn count(&self) -> usize {
        usize::from(self.coupler) + self.outputs + self.inputs + self.servos
    }

    fn segment(&self) -> String {
        let parts = [
            ("coupler", usize::from(self.coupler)),
            ("digital-output-8", self.outputs),
            ("digital-input-8", self.inputs),
            ("servo", self.servos),
        ];
        let device = |(kind, count)| format!("[[device]]\ntype = \"{kind}\"\ncount = {count}\n");
        let devices = parts.into_iter().filter(|(_, count)| *count > 0).map(device);
        format!("[segment]\nring = true\n{}", devices.collect::<String>())
    }

    fn first_input(&self) -> usize {
        usize::from(self.coupler) + self.outputs
    }

    /// Gives each input terminal a value of its own.
    fn set_inputs(&self, bench: &Bench) {
        for device in self.first_input()..self.first_input() + self.inputs {
            bench.order(&format!("inputs {device} {:02x}", input(device)));
        }
    }

    /// Compares what a foreign MainDevice saw and sent with the devices, and prints its figures.
    fn check(&self, bench: &Bench, client: Client, who: &str) {
        println!("{who}, {} SubDevices: {}", self.count(), client.line);
        assert!(!client.line.is_empty(), "{who} failed: {}", client.end().1);
        let inputs: Vec<&str> = client.figure("inputs").split(',').collect();
        assert_eq!(inputs.len(), self.count());
        for (device, seen) in inputs.iter().enumerate().skip(self.first_input()).take(self.inputs) {
            assert_eq!(*seen, format!("{:02x}", input(device)), "{who}: inputs of device {device}");
        }
        for device in usize::from(self.coupler)..self.first_input() {
            let sent = format!("{:02x}", (CYCLES - 1 + device) as u8);
            assert_eq!(bench.order(&format!("outputs {device}")), sent, "{who}: outputs of device {device}");
        }
        // One output or input counts 1 for reading and 2 for writing by LRW, a servo both.
        let wkc = 2 * self.outputs + self.inputs + 3 * self.servos;
        assert_eq!(client.figure("wkc"), wkc.to_string());
        assert_eq!(states(bench, "OP"), self.count(), "{}", bench.order("status"));
        let wrong: usize = client.figure("wrong").parse().expect("a number");
        // A stall of this machine that is longer than the other's patience is no fault of the simulator.
        assert!(wrong * 10 <= CYCLES, "{who}: {wrong} of {CYCLES} cycles with another working counter");
        let (ended, errors) = client.end();
        assert!(ended, "{who}: {errors}");
    }
}

fn input(device: usize) -> u8 {
    (device * 3 + 1) as u8
}

/// How many devices are in a state without error.
fn states(bench: &Bench, state: &str) -> usize {
    bench.order("status").lines().filter(|line| line.ends_with(&format!("\": {state}"))).count()
}

fn said(output: &Output) -> (String, String) {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (text(&output.stdout), text(&output.stderr))
}

/// The summary of `ringcat run`, to be shown.
fn show_summary(title: &str, output: &str) {
    let summary = output.find("\nsummary").map_or("", |at| &output[at + 1..]);
    println!("ringcat run, {title}:\n{summary}");
}

#[test]
fn our_main_device_brings_1_10_and_50_subdevices_to_op_and_stops_in_order() {
    let Some(mut bench) = Bench::new(1) else { return };
    for plant in PLANTS {
        bench.simulate(&plant.segment(), false);
        let (listed, errors) = said(&bench.ringcat(&["scan", "--main", "main0", "--json"]));
        assert_eq!(listed.matches("\"station\"").count(), plant.count(), "{listed}{errors}");
        // The second MainDevice on the same simulator: it serves more than one.
        let (output, errors) = said(&bench.ringcat(&["run", "--main", "main0", "--for", "2s"]));
        assert!(output.contains("all SubDevices are in OP"), "{output}{errors}");
        assert!(output.contains("stopped: outputs zero, all SubDevices in INIT"), "{output}{errors}");
        assert_eq!(states(&bench, "INIT"), plant.count(), "{}", bench.order("status"));
        show_summary(&format!("{} SubDevices", plant.count()), &output);
    }
}

#[test]
fn our_main_device_on_a_ring_of_16_loses_nobody_when_a_host_cable_or_an_inner_one_is_cut() {
    let Some(mut bench) = Bench::new(2) else { return };
    bench.simulate(&RING_OF_16.segment(), true);
    let run = bench.start_ringcat(&["run", "--main", "main0", "--redundant", "main1", "--for", "6s"]);
    let pause = || std::thread::sleep(Duration::from_millis(400));
    for _ in 0..50 {
        if states(&bench, "OP") == 16 {
            break;
        }
        pause();
    }
    pause();
    for interface in ["main0", "sim1"] {
        bench.set_link(interface, "down");
        pause();
        assert_eq!(states(&bench, "OP"), 16, "{}", bench.order("status"));
        bench.set_link(interface, "up");
        pause();
    }
    bench.order("cut 7-8");
    pause();
    assert_eq!(states(&bench, "OP"), 16, "{}", bench.order("status"));
    bench.order("heal all");
    let (output, errors) = said(&finish(run));
    for (part, count) in [("ring open", 3), ("ring closed", 3), ("break between", 3), ("no longer answers", 0)] {
        assert_eq!(output.matches(part).count(), count, "{part}: {output}{errors}");
    }
    assert!(output.contains("ring open: 8 SubDevices on MAIN, 8 on REDUNDANT"), "{output}");
    assert!(output.contains("stopped: outputs zero, all SubDevices in INIT"), "{output}{errors}");
    show_summary("ring of 16, three cuts", &output);
}

#[test]
fn ethercrab_exchanges_right_values_with_1_10_and_50_simulated_subdevices() {
    if !is_asked_for(FOREIGN) {
        return;
    }
    let Some(mut bench) = Bench::new(1) else { return };
    let client = program("examples/ethercrab_client");
    for plant in PLANTS {
        bench.simulate(&plant.segment(), false);
        plant.set_inputs(&bench);
        let child = bench.start(&client, &["main0", &plant.count().to_string(), &CYCLES.to_string()]);
        plant.check(&bench, Client::new(child), "ethercrab");
    }
}

#[test]
fn pysoem_exchanges_right_values_with_1_10_and_50_simulated_subdevices() {
    if !is_asked_for(FOREIGN) {
        return;
    }
    let Some(mut bench) = Bench::new(1) else { return };
    let Some(python) = python() else { return };
    for plant in PLANTS {
        bench.simulate(&plant.segment(), false);
        plant.set_inputs(&bench);
        let child = start_pysoem(&bench, &python, "main0", plant.count());
        plant.check(&bench, Client::new(child), "pysoem");
    }
}

#[test]
fn pysoem_exchanges_right_values_on_a_ring_with_two_interfaces() {
    if !is_asked_for(FOREIGN) {
        return;
    }
    let Some(mut bench) = Bench::new(2) else { return };
    let Some(python) = python() else { return };
    bench.simulate(&RING_OF_16.segment(), true);
    RING_OF_16.set_inputs(&bench);
    let child = start_pysoem(&bench, &python, "main0,main1", RING_OF_16.count());
    RING_OF_16.check(&bench, Client::new(child), "pysoem on a ring");
}

fn start_pysoem(bench: &Bench, python: &Path, interfaces: &str, count: usize) -> Child {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/on_the_wire/pysoem_client.py");
    bench.start(python, &[script, interfaces, &count.to_string(), &CYCLES.to_string()])
}

/// A Python with pysoem in an environment below the target directory. Only CI makes one by itself.
fn python() -> Option<PathBuf> {
    let environment = target_directory().parent()?.join("pysoem");
    let python = environment.join("bin/python");
    let succeeds = |program: &Path, arguments: &[&str]| {
        Command::new(program).args(arguments).output().is_ok_and(|output| output.status.success())
    };
    if succeeds(&python, &["-c", "import pysoem"]) {
        return Some(python);
    }
    let path = environment.display().to_string();
    let commands = format!("python3 -m venv {path} && {path}/bin/pip install {PYSOEM}");
    if std::env::var("CI").is_ok_and(|ci| ci == "true")
        && succeeds(Path::new("python3"), &["-m", "venv", &path])
        && succeeds(&python, &["-m", "pip", "install", "--quiet", PYSOEM])
    {
        return Some(python);
    }
    println!("skipped: pysoem is not installed; only CI does that by itself. By hand: {commands}");
    None
}
