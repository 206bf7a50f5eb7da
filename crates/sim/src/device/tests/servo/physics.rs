//! Energy, friction, acceleration: laws that hold for every motion.

use super::*;
use crate::application::servo::{ACCELERATION, FRICTION, MODE_CSP, MODE_CST, MODE_CSV, PEAK_TORQUE};

/// Work of the torque, heat of the friction and energy of the load, from the inputs of cycles of 1 ms.
fn energies(seen: &[Feedback]) -> (f64, f64, f64) {
    let (mut work, mut heat) = (0.0, 0.0);
    for pair in seen.windows(2) {
        let distance = f64::from(pair[1].position) - f64::from(pair[0].position);
        work += f64::from(pair[1].torque) * distance;
        heat += FRICTION * f64::from(pair[0].velocity + pair[1].velocity) / 2.0 * distance;
    }
    let energy = |at: &Feedback| f64::from(at.velocity).powi(2) / (2.0 * ACCELERATION);
    (work, heat, energy(&seen[seen.len() - 1]) - energy(&seen[0]))
}

// covers: sim-drive
#[test]
fn work_of_the_torque_equals_energy_of_the_load_and_heat_of_friction() {
    for torque in [100, 500, -1_500, 3_000] {
        let mut axis = Axis::enabled(MODE_CST, &[]);
        axis.torque = torque;
        let (skipped, cycles) = (2, 40);
        let seen = axis.run(skipped + cycles);
        let (work, heat, energy) = energies(&seen[skipped..]);
        assert!((work - heat - energy).abs() < 0.002 * work, "{torque}: {work} work, {heat} heat, {energy} energy");
        let speed = f64::from(torque) * ACCELERATION * 0.040;
        let gained = f64::from(axis.last.velocity - seen[1].velocity);
        assert!((gained / speed - 1.0).abs() < 0.02, "{torque}: {gained} of {speed} increments per second");
    }
}

// covers: sim-drive
#[test]
fn a_load_without_torque_is_decelerated_by_friction_only() {
    let mut axis = Axis::at_speed(4_000_000, &[]);
    (axis.mode, axis.torque) = (MODE_CST, 0);
    axis.run(2);
    let start = f64::from(axis.last.velocity);
    axis.run(1_000);
    // dv/dt = -FRICTION * ACCELERATION * v: exponential decay with exponent -0.5 per second.
    let expected = start * (-FRICTION * ACCELERATION).exp();
    assert!((f64::from(axis.last.velocity) / expected - 1.0).abs() < 0.002, "{} of {expected}", axis.last.velocity);
    assert_eq!(axis.last.torque, 0);
}

// covers: sim-drive
#[test]
fn acceleration_never_exceeds_the_limit_of_the_torque() {
    let mut axis = Axis::enabled(MODE_CSP, &[(0x6065, 0, -1, 4)]);
    axis.position = 1_000_000;
    let seen = axis.run(400);
    // Friction adds to braking.
    let most = (PEAK_TORQUE + FRICTION * 1e7) * ACCELERATION / 1_000.0;
    for pair in seen.windows(2) {
        let gained = f64::from(pair[1].velocity - pair[0].velocity);
        assert!(gained.abs() <= 1.001 * most, "{pair:?}");
        let distance = f64::from(pair[1].position - pair[0].position);
        let mean = f64::from(pair[0].velocity + pair[1].velocity) / 2_000.0;
        assert!((distance - mean).abs() <= most / 1_000.0, "no jumps: {pair:?}");
    }
    assert_eq!((axis.last.position, axis.last.velocity, axis.last.torque), (1_000_000, 0, 0), "settled");
}

// covers: sim-drive
#[test]
fn the_motion_does_not_depend_on_reads_of_the_inputs() {
    let course = |looks: usize| {
        let mut axis = Axis::enabled(MODE_CSV, &[]);
        let mut course = Vec::new();
        for cycle in 0..300 {
            axis.velocity = if cycle % 100 < 60 { 1_234_567 } else { -7_654 };
            let mut data = axis.control.to_le_bytes().to_vec();
            data.extend(axis.position.to_le_bytes());
            data.extend(axis.velocity.to_le_bytes());
            data.extend(axis.torque.to_le_bytes());
            data.extend(axis.mode.to_le_bytes());
            axis.client.bench.output(&data);
            let seen: Vec<Feedback> = (0..looks).map(|_| axis.look()).collect();
            axis.client.bench.pass(Duration::from_micros(980 - 20 * looks as u64));
            // The inputs after the outputs.
            course.push(seen[0]);
        }
        course
    };
    let seldom = course(1);
    assert!(seldom[299].position > seldom[0].position);
    assert_eq!(seldom, course(7));
    assert_eq!(seldom, course(40));
}
