//! Real Ethernet frames: RingCAT and other MainDevices, each in a process of its own, on veth pairs with simulated
//! segments. Needs RINGCAT_ON_THE_WIRE=1 (for other MainDevices also RINGCAT_FOREIGN=1), root and iproute2; otherwise
//! prints a line and passes.
//!
//! Times are printed, not checked, because the machine may be busy. If a stall may be the reason for a lost cycle, both
//! ends print their delays.

mod bench;
mod c_interface;
mod cables;
mod captures;
mod clocks;
mod clocks_in_a_ring;
mod clocks_of_two;
mod cuts_beside;
mod deaths;
#[path = "../../../cli/tests/program/documented.rs"]
mod documented;
mod eni;
mod ethernet;
mod exit_codes;
mod foreign;
mod forwarding;
mod frames;
mod gateway;
mod json;
mod junctions;
mod mail_captures;
mod messages;
mod remote;
mod running;
mod said;
mod scripts;
mod takeover;
mod taps;

use std::process::Output;

use bench::{Bench, await_op};

/// Numbers of SubDevices of the catalogue: outputs first, then inputs, optionally with a coupler and drives.
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
const TWO_HUNDRED: Plant = Plant { outputs: 90, inputs: 89, servos: 20, coupler: true };
const RING_OF_16: Plant = Plant { outputs: 8, inputs: 5, servos: 2, coupler: true };
/// All of them may receive their process data twice in a cycle.
const RING_OF_10: Plant = Plant { outputs: 5, inputs: 4, servos: 0, coupler: true };

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

    /// Sets a different value for each input terminal.
    fn set_inputs(&self, bench: &Bench) {
        for device in self.first_input()..self.first_input() + self.inputs {
            bench.order(&format!("inputs {device} {:02x}", input(device)));
        }
    }
}

fn input(device: usize) -> u8 {
    (device * 3 + 1) as u8
}

/// Number of devices in a state without error.
fn states(bench: &Bench, state: &str) -> usize {
    bench.order("status").lines().filter(|line| line.ends_with(&format!("\": {state}"))).count()
}

fn said(output: &Output) -> (String, String) {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (text(&output.stdout), text(&output.stderr))
}

/// Prints the summary of `ringcat run`.
fn show_summary(title: &str, output: &str) {
    let summary = output.find("\nsummary").map_or("", |at| &output[at + 1..]);
    println!("ringcat run, {title}:\n{summary}");
}

// covers: run
#[test]
fn ringcat_brings_1_10_50_and_200_subdevices_to_op_and_stops() {
    let Some(mut bench) = Bench::new(1) else { return };
    for plant in PLANTS.into_iter().chain([TWO_HUNDRED]) {
        bench.simulate(&plant.segment(), false);
        let (listed, errors) = said(&bench.ringcat(&["scan", "--main", "main0", "--json"]));
        assert_eq!(listed.matches("\"station\"").count(), plant.count(), "{listed}{errors}");
        // The second MainDevice on the same simulator.
        let (output, errors) = said(&bench.ringcat(&["run", "--main", "main0", "--for", "2s"]));
        assert!(output.contains("all SubDevices are in OP"), "{output}{errors}");
        assert!(output.contains("stopped: outputs zero, all SubDevices in INIT"), "{output}{errors}");
        assert_eq!(states(&bench, "INIT"), plant.count(), "{}", bench.order("status"));
        show_summary(&format!("{} SubDevices", plant.count()), &output);
        bench.show_simulator_lateness();
    }
}

// covers: sim-interfaces
#[test]
fn a_main_device_starts_after_another_was_killed_in_operation() {
    let Some(mut bench) = Bench::new(1) else { return };
    bench.simulate(&PLANTS[1].segment(), false);
    for _ in 0..3 {
        let killed = bench.run_ringcat(&["run", "--main", "main0"]);
        await_op(&bench, PLANTS[1].count());
        drop(killed);
    }
    let (output, errors) = said(&bench.ringcat(&["run", "--main", "main0", "--for", "500ms"]));
    assert!(output.contains("all SubDevices are in OP"), "{output}{errors}");
    assert!(output.contains("stopped: outputs zero, all SubDevices in INIT"), "{output}{errors}");
}
