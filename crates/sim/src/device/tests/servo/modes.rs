//! Modes of operation: motion of the motor, and mode-specific bits of the statusword.

use super::*;
use crate::application::servo::{
    MODE_CSP, MODE_CST, MODE_CSV, MODE_PROFILE_POSITION, MODE_PROFILE_TORQUE, MODE_PROFILE_VELOCITY,
};

// covers: sim-drive
#[test]
fn csp_interpolates_between_set_points() {
    let mut axis = Axis::enabled(MODE_CSP, &[(0x6065, 0, 20_000, 4)]);
    let mut seen = Vec::new();
    for step in 1..=200 {
        axis.position = 1_000 * step;
        seen.push(axis.cycle());
    }
    // One million increments per second: one cycle to the set-point, and a lag that the loops compensate.
    for (step, at) in seen.iter().enumerate().skip(60) {
        assert!((at.position - 1_000 * step as i32).abs() <= 10, "step {step}: {at:?}");
        assert!((at.velocity - 1_000_000).abs() < 2_000 && at.following_error.abs() <= 10, "step {step}: {at:?}");
        assert!(at.has(BIT_12) && !at.has(BIT_13), "follows: {at:?}");
    }
    let (_, lag) = bounds(&seen, |seen| seen.following_error.abs());
    assert!((10..=8_000).contains(&lag), "inertia causes a lag at the start: {lag}");
    axis.run(100);
    assert_eq!((axis.last.position, axis.last.velocity, axis.last.torque), (200_000, 0, 0), "settled");
    assert!(axis.last.has(TARGET_REACHED));
    assert_eq!(axis.last.mode, MODE_CSP);
}

// covers: sim-drive
#[test]
fn csp_reaches_a_set_point_in_the_time_of_0x60c2() {
    for (value, index, cycles) in [(8i64, -3i64, 8), (40, -4, 4), (2, -2, 20)] {
        let mut axis = Axis::enabled(MODE_CSP, &[(0x60C2, 1, value, 1), (0x60C2, 2, index, 1), (0x6065, 0, 20_000, 4)]);
        axis.run(20);
        // One set-point, and checks without another one.
        axis.position = 4_000;
        axis.cycle();
        let speeds: Vec<i32> = (0..cycles + 6)
            .map(|_| {
                axis.client.bench.pass(Duration::from_micros(980));
                let bytes = axis.client.bench.device.application.process_data().servo().unwrap().value(0x606B, 0);
                axis.look();
                bytes.unwrap() as i32
            })
            .collect();
        let moving = speeds.iter().filter(|speed| **speed == 4_000_000 / cycles).count() as i32;
        assert!((cycles - 2..=cycles).contains(&moving), "{cycles} ms: {speeds:?}");
        assert_eq!(speeds.last(), Some(&0));
    }
}

// covers: sim-drive
#[test]
fn offsets_add_to_the_targets_of_the_cyclic_modes() {
    let mut axis = Axis::enabled(MODE_CSP, &[(0x60B0, 0, -250, 4)]);
    axis.position = 1_000;
    axis.run(100);
    assert_eq!(axis.last.position, 750);
    let mut axis = Axis::enabled(MODE_CSV, &[(0x60B1, 0, -50_000, 4)]);
    axis.velocity = 150_000;
    axis.run(100);
    assert_eq!(axis.last.velocity, 100_000);
    let mut axis = Axis::enabled(MODE_CST, &[(0x60B2, 0, -40, 2)]);
    axis.torque = 140;
    axis.run(3);
    assert_eq!(axis.last.torque, 100);
}

// covers: sim-drive
#[test]
fn csv_keeps_its_speed_without_rounding_errors() {
    let mut axis = Axis::enabled(MODE_CSV, &[]);
    axis.velocity = -333;
    axis.run(500);
    let start = axis.last.position;
    axis.run(3_000);
    assert_eq!(axis.last.position - start, -999);
    axis.velocity = 2_000_000;
    axis.run(300);
    assert_eq!(axis.last.velocity, 2_000_000);
    assert!(axis.last.has(BIT_12));
}

// covers: sim-drive
#[test]
fn cst_produces_the_requested_torque_in_the_next_step() {
    let mut axis = Axis::enabled(MODE_CST, &[]);
    for torque in [10, -2_000, 0, 3_000, -3_000] {
        axis.torque = torque;
        axis.cycle();
        assert_eq!(axis.cycle().torque, torque);
    }
}

// covers: sim-drive
#[test]
fn profile_position_is_a_trapezoid_and_ends_exactly_at_its_target() {
    let objects = [(0x6081, 0, 500_000, 4), (0x6083, 0, 5_000_000, 4), (0x6084, 0, 2_000_000, 4)];
    let mut axis = Axis::enabled(MODE_PROFILE_POSITION, &objects);
    axis.position = 300_000;
    axis.control = ENABLE | NEW_SET_POINT;
    axis.cycle();
    assert!(axis.last.has(BIT_12) && !axis.last.has(TARGET_REACHED), "acknowledged: {:#06x}", axis.last.status);
    axis.control = ENABLE;
    axis.cycle();
    assert!(!axis.last.has(BIT_12), "ready for the next");
    let seen = axis.until(2_000, "at its target", |seen| seen.has(TARGET_REACHED));
    // 100 ms acceleration, 250 ms deceleration, 87,500 increments during both, the rest at 500,000 per second: 425 ms.
    assert!((765..=785).contains(&seen.len()), "{} ms, expected 775", seen.len());
    let (_, fastest) = bounds(&seen, |seen| seen.velocity);
    assert!((499_000..=506_000).contains(&fastest), "{fastest}");
    for pair in seen.windows(2).skip(5) {
        let gained = pair[1].velocity - pair[0].velocity;
        assert!((-2_200..=5_200).contains(&gained), "{pair:?}");
        assert!(pair[1].position >= pair[0].position && pair[1].position <= 300_010, "no overshoot: {pair:?}");
    }
    axis.run(100);
    assert_eq!((axis.last.position, axis.last.velocity), (300_000, 0));
}

// covers: sim-drive
#[test]
fn profile_position_buffers_one_set_point_or_applies_it_at_once() {
    let mut axis = Axis::enabled(MODE_PROFILE_POSITION, &[]);
    let give = |axis: &mut Axis, position: i32, bits: u16| {
        axis.position = position;
        axis.control = ENABLE | NEW_SET_POINT | bits;
        axis.cycle();
        let taken = axis.last.has(BIT_12);
        axis.control = ENABLE;
        axis.cycle();
        taken
    };
    assert!(give(&mut axis, 500_000, 0));
    assert!(give(&mut axis, 200_000, 0), "kept");
    assert!(axis.last.has(BIT_12), "the buffer is full");
    let seen = axis.until(3_000, "at 200,000", |seen| seen.has(TARGET_REACHED) && seen.position < 300_000);
    let (_, farthest) = bounds(&seen, |seen| seen.position);
    assert!((499_990..=500_050).contains(&farthest), "first to 500,000, without an intermediate stop: {farthest}");
    // Relative to the current set-point, at once instead of the previous target.
    assert!(give(&mut axis, -50_000, 0x40));
    axis.until(1_000, "at 150,000", |seen| seen.has(TARGET_REACHED));
    axis.run(100);
    assert_eq!(axis.last.position, 150_000);
    give(&mut axis, 1_000_000, 0);
    axis.run(100);
    assert!(give(&mut axis, 0, 0x20));
    let seen = axis.until(3_000, "back", |seen| seen.has(TARGET_REACHED));
    let (_, farthest) = bounds(&seen, |seen| seen.position);
    assert!(farthest < 500_000, "the axis reversed: {farthest}");
}

// covers: sim-drive
#[test]
fn a_target_is_reached_after_the_window_time_in_its_window() {
    // Cycles in the window before the bit.
    let waited = |seen: &[Feedback], inside: &dyn Fn(&Feedback) -> bool| {
        assert!(
            seen.iter().all(|seen| !seen.has(TARGET_REACHED) || inside(seen)),
            "target reached outside of the window"
        );
        seen.iter().rev().skip(1).take_while(|seen| inside(seen)).count()
    };
    let mut axis = Axis::enabled(MODE_PROFILE_POSITION, &[(0x6067, 0, 100, 4), (0x6068, 0, 50, 2)]);
    axis.run(3);
    axis.position = 100_000;
    axis.control = ENABLE | NEW_SET_POINT;
    axis.cycle();
    let seen = axis.until(1_000, "at its target", |seen| seen.has(TARGET_REACHED));
    let cycles = waited(&seen, &|seen| (seen.position - 100_000).abs() <= 100);
    assert!((49..=51).contains(&cycles), "{cycles} ms");
    let mut axis = Axis::enabled(MODE_PROFILE_VELOCITY, &[(0x606D, 0, 500, 2), (0x606E, 0, 30, 2)]);
    axis.velocity = 400_000;
    axis.cycle();
    let seen = axis.until(500, "at speed", |seen| seen.has(TARGET_REACHED));
    let cycles = waited(&seen, &|seen| (seen.velocity - 400_000).abs() <= 500);
    assert!((29..=31).contains(&cycles), "{cycles} ms");
}

// covers: sim-drive
#[test]
fn profile_position_continues_after_a_halt() {
    let mut axis = Axis::enabled(MODE_PROFILE_POSITION, &[]);
    axis.position = 800_000;
    axis.control = ENABLE | NEW_SET_POINT;
    axis.run(100);
    axis.control |= HALT;
    axis.until(300, "halted", |seen| seen.has(TARGET_REACHED) && seen.velocity.abs() < 10);
    let at = axis.last.position;
    assert!(at < 700_000);
    axis.control = ENABLE | NEW_SET_POINT;
    axis.until(2_000, "at the target", |seen| seen.has(TARGET_REACHED) && seen.position > 799_900);
    axis.run(100);
    assert_eq!(axis.last.position, 800_000);
}

// covers: sim-drive
#[test]
fn an_earlier_target_is_dropped_when_the_drive_is_enabled_again() {
    let mut axis = Axis::enabled(MODE_PROFILE_POSITION, &[]);
    axis.position = 800_000;
    axis.control = ENABLE | NEW_SET_POINT;
    axis.run(50);
    axis.control = ENABLE | HALT;
    axis.until(300, "at rest", |seen| seen.velocity == 0 && seen.torque == 0);
    axis.run(100);
    let at = axis.last.position;
    axis.control = 0;
    axis.cycle();
    axis.enable();
    axis.run(200);
    assert_eq!(axis.last.position, at);
}

// covers: sim-drive
#[test]
fn profile_velocity_ramps_and_reports_the_reached_target() {
    let objects = [(0x6083, 0, 4_000_000, 4), (0x6084, 0, 1_000_000, 4)];
    let mut axis = Axis::enabled(MODE_PROFILE_VELOCITY, &objects);
    assert!(axis.last.has(BIT_12), "speed 0");
    axis.velocity = 800_000;
    let seen = axis.until(400, "at speed", |seen| seen.has(TARGET_REACHED) && seen.velocity > 0);
    assert!((198..=206).contains(&seen.len()), "{} ms up, expected 200", seen.len());
    assert!(!axis.last.has(BIT_12));
    axis.velocity = -100_000;
    axis.cycle();
    axis.cycle();
    assert!(!axis.last.has(TARGET_REACHED));
    let seen = axis.until(1_200, "at the other speed", |seen| seen.has(TARGET_REACHED));
    assert!((815..=830).contains(&seen.len()), "{} ms: 800 down, 25 up, less what the window spares", seen.len());
    axis.run(100);
    assert_eq!(axis.last.velocity, -100_000);
}

// covers: sim-drive
#[test]
fn profile_torque_rises_with_its_slope() {
    let mut axis = Axis::enabled(MODE_PROFILE_TORQUE, &[(0x6087, 0, 5_000, 4)]);
    axis.torque = 500;
    let seen = axis.until(200, "at its torque", |seen| seen.has(TARGET_REACHED));
    assert!((97..=102).contains(&seen.len()), "{} ms, expected 98", seen.len());
    for pair in seen.windows(2) {
        assert!((pair[1].torque - pair[0].torque - 5).abs() <= 1, "{pair:?}");
    }
}

// covers: sim-drive
#[test]
fn modes_change_without_a_jump_and_unknown_ones_are_ignored() {
    let mut axis = Axis::at_speed(500_000, &[]);
    axis.mode = MODE_PROFILE_VELOCITY;
    let seen = axis.run(50);
    assert!(seen.iter().all(|seen| (seen.velocity - 500_000).abs() < 500), "{seen:?}");
    axis.mode = 2;
    assert_eq!(axis.run(3)[2].mode, MODE_PROFILE_VELOCITY);
    axis.mode = MODE_PROFILE_POSITION;
    let seen = axis.until(200, "at rest", |seen| seen.velocity.abs() < 2);
    let (least, most) = bounds(&seen, |seen| seen.velocity);
    assert!(seen.len() > 50 && most < 500_500 && least > -10_000, "with a ramp of 50 ms: {seen:?}");
    assert_eq!(axis.last.state(), OPERATION_ENABLED);
    axis.mode = 0;
    assert_eq!(axis.run(3)[2].mode, 0);
}
