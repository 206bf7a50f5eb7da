//! Watchdogs (protocol 3.7).

use super::*;

/// SM2 as outputs with watchdog trigger.
fn outputs() -> Bench {
    let mut bench = Bench::new();
    bench.write(0x0810, &[0x00, 0x11, 2, 0, 0x64, 0, 1, 0]);
    bench
}

// covers: 3.7, sim-controller
#[test]
fn without_outputs_for_100_ms_the_watchdog_expires_once() {
    let mut bench = outputs();
    assert_eq!(bench.register(0x0440), [0, 0]);
    bench.write(0x1100, &[1, 2]);
    assert_eq!(bench.register(0x0440), [1, 0]);
    let deadline = bench.now + Duration::from_millis(100);
    assert_eq!(bench.controller.next_deadline(), Some(deadline));
    bench.controller.tick(SimTime(deadline.0 - 1));
    assert_eq!(bench.pdi_read(0x1100, 2), Some(vec![1, 2]));
    bench.now = deadline;
    bench.controller.tick(deadline);
    assert_eq!((bench.register(0x0440), bench.register(0x0442)), ([0, 0], [1, 0]));
    assert_eq!(bench.controller.al_event() & 0x40, 0x40);
    assert_eq!((bench.pdi_read(0x1100, 2), bench.controller.next_deadline()), (None, None));
    assert_eq!(bench.pdi_read(0x0440, 1), Some(vec![0]));
    assert_eq!(bench.controller.al_event() & 0x40, 0);
    bench.write(0x1100, &[3, 4]);
    assert_eq!((bench.register(0x0440), bench.pdi_read(0x1100, 2)), ([1, 0], Some(vec![3, 4])));
}

// covers: 3.7, sim-controller
#[test]
fn divider_and_time_set_the_limit() {
    let mut bench = outputs();
    // (98 + 2) x 40 ns = 4 us, times 5.
    bench.write(0x0400, &[98, 0]);
    bench.write(0x0420, &[5, 0]);
    bench.write(0x1100, &[1, 2]);
    assert_eq!(bench.controller.next_deadline(), Some(bench.now + Duration::from_micros(20)));
}

// covers: 3.7
#[test]
fn time_0_switches_the_watchdog_off() {
    let mut bench = outputs();
    bench.write(0x0420, &[0, 0]);
    assert_eq!(bench.register(0x0440), [1, 0]);
    bench.write(0x1100, &[1, 2]);
    bench.wait(Duration::from_secs(10));
    assert_eq!((bench.register(0x0440), bench.pdi_read(0x1100, 2)), ([1, 0], Some(vec![1, 2])));
}

// covers: 3.7
#[test]
fn an_incomplete_or_damaged_write_does_not_trigger() {
    let mut bench = outputs();
    bench.write(0x1100, &[1]);
    bench.damaged(&[(Command::Apwr, 0, 0x1100, &[1, 2])]);
    assert_eq!(bench.register(0x0440), [0, 0]);
}

// covers: 3.7
#[test]
fn the_counters_are_cleared_together_and_stop_at_255() {
    let mut bench = outputs();
    for _ in 0..300 {
        bench.write(0x1100, &[1, 2]);
        bench.wait(Duration::from_millis(101));
    }
    assert_eq!(bench.register(0x0442), [0xFF, 0]);
    assert_eq!(bench.write(0x0443, &[0x55]), 1);
    assert_eq!(bench.register(0x0442), [0, 0]);
}

// covers: 3.7
#[test]
fn the_pdi_watchdog_starts_when_the_application_stops() {
    let mut bench = Bench::new();
    assert_eq!(bench.register::<2>(0x0110)[0] & 2, 2);
    bench.controller.set_pdi_alive(false, bench.now);
    bench.wait(Duration::from_millis(99));
    assert_eq!(bench.register::<2>(0x0110)[0] & 2, 2);
    bench.wait(Duration::from_millis(1));
    assert_eq!((bench.register::<2>(0x0110)[0] & 2, bench.register(0x0443)), (0, [1]));
    bench.controller.set_pdi_alive(true, bench.now);
    assert_eq!(bench.register::<2>(0x0110)[0] & 2, 2);
}
