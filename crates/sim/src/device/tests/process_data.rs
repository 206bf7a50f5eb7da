//! Inputs and outputs of the devices of the catalogue.

use core::time::Duration;

use ringcat_wire::al::AlState;

use super::bench::Bench;
use crate::application::InputSource;
use crate::application::behaviours::counter_10_ms;
use crate::application::servo::{DriveState, MODE_CSP};
use crate::catalogue;
use crate::description::DeviceDescription;

fn described(name: &str) -> DeviceDescription {
    catalogue::by_name(name).unwrap()
}

#[test]
fn outputs_are_latched_in_op_alone() {
    for (name, data) in
        [("digital-output-4", vec![0x05]), ("digital-output-8", vec![0xA5]), ("digital-output-16", vec![0x34, 0x12])]
    {
        let mut bench = Bench::up_to(described(name), AlState::SafeOp);
        bench.output(&data);
        assert_eq!(bench.device.outputs(), vec![0; data.len()], "{name}: safe state");
        bench.request(AlState::Op);
        assert_eq!(bench.device.outputs(), data, "{name}");
        let latched = bench.device.outputs_latched();
        bench.output(&data);
        bench.output(&data);
        assert_eq!(bench.device.outputs_latched(), latched + 2, "{name}");
        bench.request(AlState::SafeOp);
        assert_eq!(bench.device.outputs(), vec![0; data.len()], "{name}: safe state again");
        bench.request(AlState::PreOp);
        assert!(bench.device.outputs().is_empty(), "{name}");
    }
}

#[test]
fn inputs_are_read_as_set() {
    for (name, data) in
        [("digital-input-4", vec![0x0A]), ("digital-input-8", vec![0x5A]), ("digital-input-16", vec![0x78, 0x56])]
    {
        let mut bench = Bench::up_to(described(name), AlState::SafeOp);
        assert_eq!(bench.input(), vec![0; data.len()], "{name}");
        bench.device.set_inputs(&data);
        assert_eq!(bench.input(), data, "{name}");
        bench.request(AlState::Op);
        assert_eq!(bench.input(), data, "{name}");
        assert_eq!(bench.device.inputs(), data, "{name}");
    }
}

#[test]
fn inputs_set_before_safeop_are_valid_in_safeop() {
    let mut bench = Bench::named("digital-input-8");
    bench.device.set_inputs(&[0x77]);
    bench.climb(AlState::SafeOp);
    assert_eq!(bench.input(), [0x77]);
}

#[test]
fn inputs_that_are_a_function_of_time_are_computed_at_each_read() {
    let mut bench = Bench::up_to(described("digital-input-8"), AlState::Op);
    bench.device.set_input_source(InputSource::Function(counter_10_ms));
    let reads: Vec<u8> = (0..4)
        .map(|_| {
            bench.pass(Duration::from_millis(10));
            bench.input()[0]
        })
        .collect();
    assert!(reads.windows(2).skip(1).all(|pair| pair[1] == pair[0] + 1), "{reads:?}");
}

#[test]
fn emulated_terminals_move_data_without_events() {
    let mut bench = Bench::up_to(described("emulated-output-8"), AlState::Op);
    bench.output(&[0x3C]);
    assert_eq!(bench.device.outputs(), [0x3C]);
    assert_eq!(bench.device.controller.digital_outputs(), Some([0x3C, 0, 0, 0]));
    bench.pass(Duration::from_millis(150));
    assert_eq!(bench.device.outputs(), [0], "the watchdog switches the pins off");
    let mut bench = Bench::up_to(described("emulated-input-8"), AlState::Op);
    bench.device.set_inputs(&[0xC3]);
    assert_eq!(bench.input(), [0xC3]);
}

#[test]
fn analogue_inputs_follow_a_sawtooth() {
    let mut bench = Bench::up_to(described("analog-input-4"), AlState::Op);
    bench.input();
    let first = bench.input();
    bench.pass(Duration::from_millis(1));
    bench.input();
    let second = bench.input();
    assert_eq!(first.len(), 16);
    assert_ne!(first, second);
}

#[test]
fn analogue_outputs_are_latched() {
    let mut bench = Bench::up_to(described("analog-output-4"), AlState::Op);
    bench.output(&[1, 2, 3, 4, 5, 6, 7, 8]);
    assert_eq!(bench.device.outputs(), [1, 2, 3, 4, 5, 6, 7, 8]);
}

#[test]
fn a_block_returns_its_outputs() {
    let mut bench = Bench::up_to(described("block"), AlState::SafeOp);
    let data: Vec<u8> = (0..400u16).map(|place| place as u8).collect();
    bench.output(&data);
    assert_eq!(bench.input(), vec![0; 400], "safe state");
    bench.request(AlState::Op);
    bench.output(&data);
    assert_eq!(bench.input(), data);
}

/// Controlword, target position, target velocity, mode, gap.
fn command(control: u16, position: i32) -> Vec<u8> {
    let mut data = control.to_le_bytes().to_vec();
    data.extend_from_slice(&position.to_le_bytes());
    data.extend_from_slice(&[0; 4]);
    data.extend_from_slice(&[MODE_CSP as u8, 0]);
    data
}

fn cycle(bench: &mut Bench, control: u16, position: i32) -> (u16, i32) {
    bench.output(&command(control, position));
    bench.pass(Duration::from_millis(1));
    let inputs = bench.input();
    let word = u16::from_le_bytes([inputs[0], inputs[1]]);
    (word, i32::from_le_bytes([inputs[2], inputs[3], inputs[4], inputs[5]]))
}

// covers: sim-devices
#[test]
fn a_servo_passes_its_state_machine_and_follows_the_target() {
    let mut bench = Bench::up_to(described("servo"), AlState::Op);
    for (control, status) in [(0x0000, 0x0040), (0x0006, 0x0021), (0x0007, 0x0023), (0x000F, 0x0027)] {
        assert_eq!(cycle(&mut bench, control, 0).0 & 0x006F, status, "controlword {control:#06x}");
    }
    for step in 1..=10 {
        cycle(&mut bench, 0x000F, 100 * step);
    }
    // The load has inertia and needs time to settle.
    for _ in 0..50 {
        cycle(&mut bench, 0x000F, 1000);
    }
    let (word, position) = cycle(&mut bench, 0x000F, 1000);
    assert_eq!((word & 0x1427, position), (0x1427, 1000), "enabled, follows, target reached");
}

#[test]
fn a_servo_that_loses_its_outputs_goes_to_fault_and_recovers() {
    let mut bench = Bench::up_to(described("servo"), AlState::Op);
    for control in [0x0006, 0x0007, 0x000F] {
        cycle(&mut bench, control, 0);
    }
    bench.pass(Duration::from_millis(110));
    assert_eq!(bench.status().1.0, 0x001B);
    assert_eq!(bench.device.application.process_data().servo().unwrap().state(), DriveState::Fault);
    assert_eq!(bench.input()[12..], [0x00, 0x75], "error code");
    bench.acknowledge(AlState::SafeOp);
    bench.write_outputs();
    bench.request(AlState::Op);
    assert_eq!(cycle(&mut bench, 0x0080, 0).0 & 0x006F, 0x0040);
}

#[test]
fn a_hanging_device_keeps_its_old_outputs_and_inputs() {
    let mut bench = Bench::up_to(described("block"), AlState::Op);
    bench.output(&[1; 400]);
    bench.device.hang(true, bench.now);
    bench.output(&[2; 400]);
    assert_eq!(bench.input(), [1; 400]);
    bench.device.hang(false, bench.now);
    bench.pass(Duration::ZERO);
    assert_eq!(bench.input(), [2; 400]);
}
