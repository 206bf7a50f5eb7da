//! Limits of position, speed and torque, and the following error.

use super::*;
use crate::application::servo::{
    ERROR_FOLLOWING, INCREMENTS_PER_REVOLUTION, MODE_CSP, MODE_CST, MODE_CSV, MODE_PROFILE_POSITION,
    MODE_PROFILE_TORQUE, MODE_PROFILE_VELOCITY,
};

const LOW: i32 = -200_000;
const HIGH: i32 = 300_000;
/// Overrun of a software limit until the loops return the axis.
const OVERRUN: i32 = 60;

fn limited(mode: i8) -> Axis {
    let objects = [(0x607D, 1, LOW.into(), 4), (0x607D, 2, HIGH.into(), 4), (0x6065, 0, -1, 4)];
    Axis::enabled(mode, &objects)
}

// covers: sim-drive
#[test]
fn no_mode_leaves_the_software_limits() {
    for mode in [MODE_CSP, MODE_CSV, MODE_CST, MODE_PROFILE_POSITION, MODE_PROFILE_VELOCITY, MODE_PROFILE_TORQUE] {
        for (direction, limit) in [(1, HIGH), (-1, LOW)] {
            let mut axis = limited(mode);
            axis.velocity = direction * 3_000_000;
            axis.torque = direction as i16 * 1_000;
            axis.position = direction * 2_000_000;
            axis.control = ENABLE | NEW_SET_POINT;
            let seen = axis.run(1_500);
            let (low, high) = bounds(&seen, |seen| seen.position);
            // In CSP the set-point jumps to the limit at once, and the motor, which could not follow, overruns it.
            let overrun = if mode == MODE_CSP { 60_000 } else { OVERRUN };
            assert!(low >= LOW - overrun && high <= HIGH + overrun, "mode {mode}: {low} to {high}");
            let beside = if mode == MODE_CSP || mode == MODE_PROFILE_POSITION { 0 } else { OVERRUN };
            assert!(
                (axis.last.position - limit).abs() <= beside,
                "mode {mode}: the axis moves to the limit, {:?}",
                axis.last
            );
            assert!(axis.last.has(INTERNAL_LIMIT) && axis.last.velocity.abs() <= 1_000, "mode {mode}: {:?}", axis.last);
            assert_eq!(axis.last.state(), OPERATION_ENABLED, "mode {mode}");
        }
    }
}

// covers: sim-drive
#[test]
fn an_axis_returns_from_a_limit() {
    for mode in [MODE_CSV, MODE_CST, MODE_PROFILE_VELOCITY, MODE_PROFILE_TORQUE] {
        let mut axis = limited(mode);
        (axis.velocity, axis.torque) = (2_000_000, 500);
        axis.run(1_000);
        (axis.velocity, axis.torque) = (-100_000, -100);
        axis.run(150);
        assert!(axis.last.position < HIGH - 1_000 && !axis.last.has(INTERNAL_LIMIT), "mode {mode}: {:?}", axis.last);
    }
}

// covers: sim-drive
#[test]
fn torque_stays_below_0x6072_and_the_limits_of_each_direction() {
    let objects = [(0x6072, 0, 800, 2), (0x60E0, 0, 500, 2), (0x60E1, 0, 1_500, 2)];
    for mode in [MODE_CSV, MODE_CST, MODE_PROFILE_TORQUE] {
        let mut axis = Axis::enabled(mode, &objects);
        (axis.velocity, axis.torque) = (4_000_000, 2_000);
        let up = axis.run(80);
        assert_eq!(bounds(&up, |seen| seen.torque.into()).1, 500, "mode {mode}");
        assert!(up[79].has(INTERNAL_LIMIT), "mode {mode}");
        (axis.velocity, axis.torque) = (-5_000_000, -2_000);
        let seen = axis.run(600);
        let down = bounds(&seen, |seen| seen.torque.into());
        assert_eq!(down.0, -800, "mode {mode}: the smaller of 800 and 1,500");
    }
}

// covers: sim-drive
#[test]
fn speed_stays_below_0x6080_in_every_mode() {
    // 1,200 revolutions per minute are 20 per second.
    let most = 20 * INCREMENTS_PER_REVOLUTION;
    for mode in [MODE_CSP, MODE_CSV, MODE_CST, MODE_PROFILE_POSITION, MODE_PROFILE_VELOCITY] {
        let objects = [(0x6080, 0, 1_200, 4), (0x6081, 0, 9_000_000, 4), (0x6065, 0, -1, 4)];
        let mut axis = Axis::enabled(mode, &objects);
        (axis.velocity, axis.torque, axis.position) = (9_000_000, 1_000, 9_000_000);
        axis.control = ENABLE | NEW_SET_POINT;
        let seen = axis.run(800);
        let (_, fastest) = bounds(&seen, |seen| seen.velocity);
        assert!((most - 200..=most + 20_000).contains(&fastest), "mode {mode}: {fastest} of {most}");
    }
}

// covers: sim-drive
#[test]
fn profile_modes_stay_below_0x607f() {
    for mode in [MODE_PROFILE_POSITION, MODE_PROFILE_VELOCITY] {
        let mut axis = Axis::enabled(mode, &[(0x607F, 0, 300_000, 4)]);
        (axis.velocity, axis.position) = (9_000_000, 9_000_000);
        axis.control = ENABLE | NEW_SET_POINT;
        let (_, fastest) = bounds(&axis.run(400), |seen| seen.velocity);
        assert!((299_900..=305_000).contains(&fastest), "mode {mode}: {fastest}");
    }
}

// covers: sim-drive
#[test]
fn a_following_error_is_a_fault_after_its_time_out() {
    for (window, time_out) in [(5_000, 0), (5_000, 20), (5_000, 60)] {
        let objects = [(0x6065, 0, window, 4), (0x6066, 0, time_out, 2)];
        let mut axis = Axis::enabled(MODE_CSP, &objects);
        axis.position = 2_000_000;
        let seen = axis.until(200, "a fault", |seen| seen.error == ERROR_FOLLOWING);
        let beyond = seen.iter().filter(|seen| i64::from(seen.following_error.abs()) > window).count() as i64;
        assert!((time_out..=time_out + 3).contains(&beyond), "{beyond} ms beyond the window, allowed {time_out}");
        assert!(seen.iter().filter(|seen| i64::from(seen.following_error) > window).all(|seen| seen.has(BIT_13)));
        axis.until(300, "in fault", |seen| seen.state() == FAULT);
        assert_eq!(axis.client.upload(0x1001, 0), Ok(vec![0x21]), "error register");
    }
}

// covers: sim-drive
#[test]
fn a_following_error_that_ends_before_the_time_out_is_no_fault() {
    let mut axis = Axis::enabled(MODE_CSP, &[(0x6065, 0, 5_000, 4), (0x6066, 0, 100, 2)]);
    axis.position = 100_000;
    let seen = axis.run(300);
    assert!(bounds(&seen, |seen| seen.following_error).1 > 5_000, "the error was beyond the window");
    assert_eq!((axis.last.state(), axis.last.position), (OPERATION_ENABLED, 100_000));
    let mut axis = Axis::enabled(MODE_CSP, &[(0x6065, 0, -1, 4), (0x6066, 0, 0, 2)]);
    axis.position = 3_000_000;
    axis.run(1_000);
    assert_eq!((axis.last.state(), axis.last.position), (OPERATION_ENABLED, 3_000_000));
}

/// Numbers from a seed.
fn random(state: &mut u64) -> u64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    *state >> 24
}

fn one_in(many: u64, state: &mut u64) -> bool {
    random(state) % many < 1
}

// covers: sim-drive
#[test]
fn any_outputs_and_objects_leave_motor_and_load_within_their_physics() {
    use crate::application::servo::{ACCELERATION, BRAKE_TORQUE, PEAK_TORQUE};
    // Speed at the highest limit of the motor, and the possible increase in a cycle.
    let fastest = 10_200_000;
    let most = ((PEAK_TORQUE + BRAKE_TORQUE) * ACCELERATION / 1_000.0) as i32;
    for seed in 0..40 {
        let mut state = seed;
        let mut axis = Axis::with(&[]);
        for cycle in 0..600 {
            if one_in(8, &mut state) {
                axis.control = [ENABLE, SHUTDOWN, SWITCH_ON, QUICK_STOP, ENABLE | NEW_SET_POINT, 0x80]
                    [random(&mut state) as usize % 6]
                    | (random(&mut state) as u16 & 0x0160);
            }
            if one_in(40, &mut state) {
                axis.mode = [1, 3, 4, 6, 8, 9, 10, random(&mut state) as i8][random(&mut state) as usize % 8];
            }
            if one_in(16, &mut state) {
                let range = random(&mut state) % 32;
                axis.position = random(&mut state) as u32 as i32 >> range;
                axis.velocity = random(&mut state) as u32 as i32 >> range;
                axis.torque = random(&mut state) as i16;
            }
            if one_in(16, &mut state) {
                let objects = axis.client.bench.device.application.dictionary().objects();
                let object = &objects[random(&mut state) as usize % objects.len()];
                let entry = &object.entries[random(&mut state) as usize % object.entries.len()];
                let (index, sub_index, length) = (object.index, entry.sub_index, entry.value.len().min(4));
                let value = (random(&mut state) as u32 >> (random(&mut state) % 32)).to_le_bytes();
                let _ = axis.client.download(index, sub_index, &value[..length]);
            }
            let before = axis.last;
            let seen = axis.cycle();
            assert!(seen.velocity.abs() <= fastest, "seed {seed}, cycle {cycle}: {seen:?}");
            assert!(f64::from(seen.torque.abs()) <= PEAK_TORQUE, "seed {seed}, cycle {cycle}: {seen:?}");
            // Mail takes at most two more milliseconds of the cycle.
            let gained = (seen.velocity - before.velocity).abs();
            assert!(gained <= 4 * most, "seed {seed}, cycle {cycle}: {before:?} {seen:?}");
        }
    }
}
