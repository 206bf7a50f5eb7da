//! Homing methods 17, 18, 33, 34, 35, 37: position of the origin, and the statusword during homing.

use super::*;
use crate::application::servo::{
    INCREMENTS_PER_REVOLUTION, INDEX_PULSE, LIMIT_SWITCH, MODE_HOMING, MODE_PROFILE_POSITION,
};

const HOME_OFFSET: i32 = 1_234;
const EDGE: i32 = LIMIT_SWITCH as i32;
const INDEX: i32 = INDEX_PULSE as i32;

fn homing(method: i8) -> Axis {
    Axis::enabled(MODE_HOMING, &[(0x6098, 0, method.into(), 1), (0x607C, 0, HOME_OFFSET.into(), 4)])
}

/// Starts homing and runs until it is done.
fn home(axis: &mut Axis) -> Vec<Feedback> {
    axis.control = ENABLE | NEW_SET_POINT;
    let done = |seen: &Feedback| seen.has(BIT_12 | TARGET_REACHED);
    axis.cycle();
    axis.until(20_000, "homed", done)
}

/// The machine position that now has the home offset.
fn home_on_machine(seen: &Feedback) -> i32 {
    seen.machine - seen.position + HOME_OFFSET
}

// covers: sim-drive
#[test]
fn each_method_finds_its_position_to_the_increment() {
    let table = [(17, -EDGE), (18, EDGE), (33, INDEX - INCREMENTS_PER_REVOLUTION), (34, INDEX), (35, 0), (37, 0)];
    for (method, place) in table {
        let mut axis = homing(method);
        let seen = home(&mut axis);
        assert_eq!(home_on_machine(&axis.last), place, "method {method}");
        assert!(seen.iter().all(|seen| !seen.has(BIT_13) && seen.state() == OPERATION_ENABLED), "method {method}");
        // The axis stops close to the position, not at it: slow, and stopped by a ramp.
        assert!((axis.last.machine - place).abs() < 200, "method {method}: {:?}", axis.last);
        // It moves to the position in another mode.
        axis.mode = MODE_PROFILE_POSITION;
        axis.control = ENABLE;
        axis.cycle();
        axis.position = HOME_OFFSET;
        axis.control = ENABLE | NEW_SET_POINT;
        axis.run(100);
        assert_eq!((axis.last.position, axis.last.machine), (HOME_OFFSET, place), "method {method}");
    }
}

// covers: sim-drive
#[test]
fn the_switch_is_approached_quickly_and_left_slowly() {
    let mut axis = homing(17);
    let seen = home(&mut axis);
    let (lowest, highest) = bounds(&seen, |seen| seen.velocity);
    assert!((-510_000..=-499_000).contains(&lowest), "{lowest}");
    assert!((49_000..=56_000).contains(&highest), "{highest}");
    let overrun = bounds(&seen, |seen| seen.machine).0 + EDGE;
    // v*v/2a of 500,000 and 1e7, and the lag of the loops.
    assert!((-14_500..=-12_000).contains(&overrun), "{overrun}");
}

// covers: sim-drive
#[test]
fn a_drive_on_its_switch_leaves_it_at_once() {
    let mut axis = homing(18);
    home(&mut axis);
    // Moves onto the switch, in units of the application.
    axis.mode = MODE_PROFILE_POSITION;
    axis.control = ENABLE;
    axis.cycle();
    axis.position = HOME_OFFSET + 30_000;
    axis.control = ENABLE | NEW_SET_POINT;
    axis.run(500);
    assert_eq!(axis.client.upload(0x60FD, 0), Ok(vec![2, 0, 0, 0]), "positive limit switch");
    axis.mode = MODE_HOMING;
    axis.control = ENABLE;
    axis.cycle();
    let seen = home(&mut axis);
    assert!(bounds(&seen, |seen| seen.machine).1 <= EDGE + 30_005, "not beyond the switch");
    assert_eq!(home_on_machine(&axis.last), EDGE);
}

// covers: sim-drive
#[test]
fn status_bits_show_the_progress_of_homing() {
    let status = |axis: &Axis| axis.last.status & (BIT_13 | BIT_12 | TARGET_REACHED);
    let mut axis = homing(34);
    assert_eq!(status(&axis), TARGET_REACHED, "not started");
    axis.control = ENABLE | NEW_SET_POINT;
    axis.run(10);
    assert_eq!(status(&axis), 0, "in progress");
    axis.control = ENABLE;
    axis.until(50, "interrupted", |seen| seen.has(TARGET_REACHED));
    assert_eq!((status(&axis), axis.last.velocity), (TARGET_REACHED, axis.last.velocity), "interrupted");
    assert_eq!(axis.last.position, axis.last.machine, "nothing was found");
    let seen = home(&mut axis);
    let order: Vec<u16> = seen.iter().map(|seen| seen.status & (BIT_13 | BIT_12 | TARGET_REACHED)).collect();
    assert!(order.is_sorted(), "0, found but moving, done: {order:?}");
    axis.control = ENABLE;
    axis.run(5);
    assert_eq!(status(&axis), BIT_12 | TARGET_REACHED, "the axis stays homed");
}

// covers: sim-drive
#[test]
fn software_limits_do_not_stop_homing_and_hold_afterwards() {
    let limits = [(0x607D, 1, -10_000, 4), (0x607D, 2, 10_000, 4), (0x6098, 0, 17, 1)];
    let mut axis = Axis::enabled(MODE_HOMING, &limits);
    home(&mut axis);
    axis.mode = MODE_PROFILE_POSITION;
    axis.control = ENABLE;
    axis.cycle();
    axis.position = 1_000_000;
    axis.control = ENABLE | NEW_SET_POINT;
    axis.run(500);
    assert_eq!((axis.last.position, axis.last.machine), (10_000, 10_000 - EDGE));
    assert!(axis.last.has(INTERNAL_LIMIT));
}
