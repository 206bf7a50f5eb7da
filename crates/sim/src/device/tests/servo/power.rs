//! Power states, option codes, brake, quick stop, loss of process data.

use super::*;
use crate::application::servo::{ERROR_COMMUNICATION, ERROR_FOLLOWING, MODE_CSP, MODE_CSV};

/// Speed before each stop.
const SPEED: i32 = 2_000_000;

// covers: sim-drive
#[test]
fn each_commanded_transition_of_cia_402_occurs() {
    let steps = [
        (0x0000, SWITCH_ON_DISABLED, "1, by itself"),
        (ENABLE, SWITCH_ON_DISABLED, "none"),
        (SHUTDOWN, READY_TO_SWITCH_ON, "2"),
        (QUICK_STOP, SWITCH_ON_DISABLED, "7, quick stop"),
        (SHUTDOWN, READY_TO_SWITCH_ON, "2"),
        (0x0000, SWITCH_ON_DISABLED, "7, disable voltage"),
        (SHUTDOWN, READY_TO_SWITCH_ON, "2"),
        (SWITCH_ON, SWITCHED_ON, "3"),
        (SHUTDOWN, READY_TO_SWITCH_ON, "6"),
        (SWITCH_ON, SWITCHED_ON, "3"),
        (0x0000, SWITCH_ON_DISABLED, "10"),
        (SHUTDOWN, READY_TO_SWITCH_ON, "2"),
        (ENABLE, SWITCHED_ON, "3 of two"),
        (ENABLE, OPERATION_ENABLED, "4"),
        (SWITCH_ON, SWITCHED_ON, "5"),
        (ENABLE, OPERATION_ENABLED, "4"),
        (SHUTDOWN, READY_TO_SWITCH_ON, "8"),
        (SWITCH_ON, SWITCHED_ON, "3"),
        (ENABLE, OPERATION_ENABLED, "4"),
        (0x0000, SWITCH_ON_DISABLED, "9"),
        (SHUTDOWN, READY_TO_SWITCH_ON, "2"),
        (SWITCH_ON, SWITCHED_ON, "3"),
        (ENABLE, OPERATION_ENABLED, "4"),
        (QUICK_STOP, QUICK_STOP_ACTIVE, "11, and it stays with code 6"),
        (SHUTDOWN, QUICK_STOP_ACTIVE, "none"),
        (ENABLE, OPERATION_ENABLED, "16"),
        (QUICK_STOP, QUICK_STOP_ACTIVE, "11"),
        (0x0000, SWITCH_ON_DISABLED, "12"),
    ];
    let mut axis = Axis::with(&[(0x605A, 0, 6, 2)]);
    for (step, (control, state, transition)) in steps.into_iter().enumerate() {
        axis.control = control;
        axis.cycle();
        // Transitions 5 and 8 need a step of the drive at standstill.
        let seen = axis.look();
        assert_eq!(seen.state(), state, "step {step}, controlword {control:#06x}, transition {transition}");
        assert_eq!(seen.brake == 0, state == OPERATION_ENABLED || state == QUICK_STOP_ACTIVE, "brake in step {step}");
    }
}

// covers: sim-drive
#[test]
fn a_drive_is_not_ready_before_the_end_of_its_self_test() {
    let mut bench = crate::device::tests::bench::Bench::new(described());
    let state = |bench: &crate::device::tests::bench::Bench| {
        bench.device.application.process_data().value(0x6041, 0).unwrap() as u16 & STATE
    };
    bench.device.power_off(bench.now);
    bench.device.power_on(bench.now);
    assert_eq!(state(&bench), 0x0000);
    bench.power_cycle();
    bench.climb(AlState::SafeOp);
    assert_eq!(state(&bench), SWITCH_ON_DISABLED, "transition 1");
}

/// Stops from [`SPEED`]; returns duration, distance and final state.
fn stop(axis: &mut Axis, control: u16) -> (usize, i32, u16) {
    axis.control = control;
    let start = axis.cycle().position;
    let seen = axis.until(1_000, "still", |seen| seen.velocity.abs() < 2);
    axis.run(3);
    (seen.len(), axis.last.position - start, axis.last.state())
}

// covers: sim-drive
#[test]
fn quick_stop_follows_its_option_code() {
    // Distances are v*v/2a for 1e7 and 5e7 per second squared, and for 3,000 thousandths of the torque (1.5e8).
    let (slow, quick, hardest) = (200_000, 40_000, 13_333);
    // The brake alone has 1,000 thousandths.
    let table = [
        (0, quick, SWITCH_ON_DISABLED),
        (1, slow, SWITCH_ON_DISABLED),
        (2, quick, SWITCH_ON_DISABLED),
        (3, hardest, SWITCH_ON_DISABLED),
        (5, slow, QUICK_STOP_ACTIVE),
        (6, quick, QUICK_STOP_ACTIVE),
        (7, hardest, QUICK_STOP_ACTIVE),
    ];
    for (option, distance, state) in table {
        let mut axis = Axis::at_speed(SPEED, &[(0x605A, 0, option, 2)]);
        let (_, moved, end) = stop(&mut axis, QUICK_STOP);
        assert_eq!(end, state, "option {option}");
        assert!((moved - distance).abs() < 4_000, "option {option}: {moved}, expected about {distance}");
        assert_eq!(axis.last.brake, u8::from(state == SWITCH_ON_DISABLED), "option {option}");
    }
}

// covers: sim-drive
#[test]
fn disable_operation_and_shutdown_stop_by_ramp_or_by_brake() {
    let (slow, brake) = (200_000, 40_000);
    let table = [
        (0x605C, 0, SWITCH_ON, brake, SWITCHED_ON),
        (0x605C, 1, SWITCH_ON, slow, SWITCHED_ON),
        (0x605B, 0, SHUTDOWN, brake, READY_TO_SWITCH_ON),
        (0x605B, 1, SHUTDOWN, slow, READY_TO_SWITCH_ON),
    ];
    for (object, option, control, distance, state) in table {
        let mut axis = Axis::at_speed(-SPEED, &[(object, 0, option, 2)]);
        let (_, moved, end) = stop(&mut axis, control);
        assert_eq!(end, state, "{object:#06x} = {option}");
        assert!((moved + distance).abs() < 4_000, "{object:#06x} = {option}: {moved}, expected about {distance}");
    }
}

// covers: sim-drive
#[test]
fn halt_keeps_the_drive_enabled_and_ends_with_the_bit() {
    for (option, distance) in [(1, 200_000), (2, 40_000), (3, 13_333)] {
        let mut axis = Axis::at_speed(SPEED, &[(0x605D, 0, option, 2)]);
        let (_, moved, end) = stop(&mut axis, ENABLE | HALT);
        assert_eq!(end, OPERATION_ENABLED, "option {option}");
        assert!((moved - distance).abs() < 4_000, "option {option}: {moved}");
        assert!(axis.last.has(TARGET_REACHED) && !axis.last.has(BIT_12), "{:#06x}", axis.last.status);
        axis.control = ENABLE;
        axis.until(200, "at speed again", |seen| seen.velocity > SPEED - 1000);
    }
}

// covers: sim-drive
#[test]
fn a_fault_stops_the_motor_and_then_waits_for_a_rising_reset() {
    for (option, longest) in [(0, 45), (1, 230), (2, 65), (3, 40)] {
        let mut axis = Axis::at_speed(SPEED, &[(0x605E, 0, option, 2), (0x6065, 0, 1_000, 4), (0x6066, 0, 0, 2)]);
        axis.mode = MODE_CSP;
        axis.position = axis.last.position + 1_000_000;
        axis.until(5, "a fault", |seen| seen.error != 0);
        assert!(axis.last.has(BIT_13) && axis.last.error == ERROR_FOLLOWING, "{:?}", axis.last);
        if option != 0 {
            assert_eq!((axis.last.state(), axis.last.brake), (FAULT_REACTION_ACTIVE, 0), "13, option {option}");
        }
        axis.until(longest, "in fault at rest", |seen| seen.state() == FAULT && seen.velocity == 0);
        assert_eq!(axis.last.brake, 1, "14");
        axis.control = 0x0080;
        assert_eq!(axis.cycle().state(), SWITCH_ON_DISABLED, "15");
        assert_eq!(axis.last.error, 0);
        axis.mode = MODE_CSV;
        axis.velocity = 0;
        axis.enable();
    }
}

// covers: sim-drive
#[test]
fn a_reset_bit_set_before_the_fault_resets_nothing() {
    let mut axis = Axis::enabled(MODE_CSP, &[(0x6065, 0, 1_000, 4)]);
    axis.control = ENABLE | 0x0080;
    axis.cycle();
    axis.position = 1_000_000;
    axis.until(200, "in fault", |seen| seen.state() == FAULT);
    assert_eq!(axis.run(5)[4].state(), FAULT);
    axis.control = 0;
    axis.cycle();
    axis.control = 0x0080;
    assert_eq!(axis.cycle().state(), SWITCH_ON_DISABLED);
}

// covers: sim-drive
#[test]
fn lost_process_data_causes_the_reaction_of_the_abort_connection_code() {
    for (option, state, error) in [
        (1, FAULT, ERROR_COMMUNICATION),
        (2, SWITCH_ON_DISABLED, 0),
        (3, SWITCH_ON_DISABLED, 0),
        (0, OPERATION_ENABLED, 0),
    ] {
        let mut axis = Axis::at_speed(SPEED, &[(0x6007, 0, option, 2)]);
        axis.client.bench.pass(Duration::from_millis(150));
        assert_eq!(axis.client.bench.status().1.0, 0x001B, "the watchdog expired");
        axis.look();
        axis.client.bench.pass(Duration::from_millis(500));
        axis.look();
        axis.look();
        assert_eq!((axis.last.state(), axis.last.error), (state, error), "option {option}");
        assert_eq!(axis.last.velocity == 0, option != 0, "option {option}: {}", axis.last.velocity);
        assert!(!axis.last.has(0x0200), "not remote");
    }
}

// covers: sim-drive
#[test]
fn the_brake_stops_a_load_that_loses_its_torque() {
    let mut axis = Axis::at_speed(SPEED, &[]);
    axis.control = 0;
    axis.cycle();
    let seen = axis.run(60);
    assert!(seen.iter().all(|seen| seen.state() == SWITCH_ON_DISABLED && seen.brake == 1 && seen.torque == 0));
    let speeds: Vec<i32> = seen.iter().map(|seen| seen.velocity).collect();
    // 1,000 thousandths brake 50,000 increments per second each millisecond; friction adds at most a fiftieth.
    let evenly = speeds.windows(2).take(38).all(|pair| (50_000..=51_100).contains(&(pair[0] - pair[1])));
    assert!(evenly && speeds[45] == 0, "{speeds:?}");
    assert_eq!(seen[45].position, seen[59].position, "the brake holds");
}

// covers: sim-drive
#[test]
fn a_power_cycle_keeps_the_position_of_the_load_and_clears_the_origin() {
    let mut axis = Axis::enabled(MODE_CSP, &[(0x607C, 0, 777, 4)]);
    axis.position = 5_000;
    axis.run(100);
    axis.mode = crate::application::servo::MODE_HOMING;
    axis.cycle();
    axis.control = ENABLE | NEW_SET_POINT;
    axis.until(20, "homed", |seen| seen.has(BIT_12));
    assert_eq!((axis.last.position, axis.last.machine), (777, 5_000));
    axis.client.bench.power_cycle();
    axis.client.bench.climb(AlState::SafeOp);
    axis.look();
    assert_eq!((axis.last.position, axis.last.machine), (5_000, 5_000));
}
