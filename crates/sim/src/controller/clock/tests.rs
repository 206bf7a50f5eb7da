//! Tests of the clock: drift, jitter, and the closed control loop (protocol 7.2.1).

use super::*;

const RESET: LoopSettings = LoopSettings { start: 0x1000, difference_depth: 4, speed_depth: 12 };

fn drifting(ppm: i64) -> Clock {
    let mut clock = Clock::new(77, ClockErrors { drift_ppb: ppm * 1_000, ..ClockErrors::default() });
    clock.restart(SimTime::ZERO);
    clock
}

/// Writes ideal time to the clock every `period_ns` for `samples` samples; returns the largest difference of the last
/// tenth.
fn follow(clock: &mut Clock, from: SimTime, period_ns: u64, samples: u64) -> (SimTime, i64) {
    let (mut now, mut worst) = (from, 0);
    let correction = 0u64.wrapping_sub(77);
    for sample in 0..samples {
        now = SimTime(now.0 + period_ns);
        clock.compare(now.0 as u32, correction, now, RESET);
        if sample >= samples - samples / 10 {
            worst = worst.max((clock.local(now).wrapping_add(correction) as i64 - now.0 as i64).abs());
        }
    }
    (now, worst)
}

// covers: sim-clocks
#[test]
fn a_drift_of_100_ppm_is_100_us_in_a_second() {
    let mut clock = Clock::new(5, ClockErrors { drift_ppb: 100_000, ..ClockErrors::default() });
    clock.restart(SimTime(1_000));
    assert_eq!(clock.local(SimTime(1_000_001_000)), 1_000_100_005);
    let mut slow = Clock::new(0, ClockErrors { drift_ppb: -100_000, ..ClockErrors::default() });
    slow.restart(SimTime(0));
    assert_eq!(slow.local(SimTime(1_000_000_000)), 999_900_000);
}

// covers: 7.2, sim-clocks
#[test]
fn fifteen_thousand_fast_samples_compensate_any_drift() {
    for ppm in [-100, -50, -1, 0, 10, 50, 100] {
        let mut clock = drifting(ppm);
        let (now, worst) = follow(&mut clock, SimTime::ZERO, 66_667, 15_000);
        assert!(worst <= 20, "{ppm} ppm: {worst} ns after a second");
        // At a cycle of 1 ms the difference stays within the limit.
        let (_, worst) = follow(&mut clock, now, 1_000_000, 5_000);
        assert!(worst <= 20, "{ppm} ppm: {worst} ns at 1 ms");
        let ppb = i64::from(clock.loop_registers().1) * 12;
        assert_eq!(ppb.signum(), -ppm.signum() * i64::from(ppm.abs() > 1 || ppb != 0), "{ppm} ppm: {ppb}");
    }
}

#[test]
fn one_sample_per_millisecond_is_enough_within_seconds() {
    for ppm in [-100, -50, 50, 100] {
        let mut clock = drifting(ppm);
        let (_, worst) = follow(&mut clock, SimTime::ZERO, 1_000_000, 10_000);
        assert!(worst <= 20, "{ppm} ppm: {worst} ns");
    }
}

// covers: 7.2.1
#[test]
fn a_restart_of_the_filters_clears_the_drift_compensation() {
    let mut clock = drifting(50);
    let (now, _) = follow(&mut clock, SimTime::ZERO, 66_667, 15_000);
    let before = clock.local(now);
    clock.restart_loop(now);
    assert_eq!((clock.loop_registers(), clock.local(now)), ((0x8000_0000, 0), before));
    assert_eq!(clock.local(SimTime(now.0 + 1_000_000_000)) - before, 1_000_050_000);
}

// covers: 7.5, sim-clocks
#[test]
fn a_payload_of_zero_drives_the_clock_to_its_limit() {
    let mut clock = drifting(0);
    let mut now = SimTime(1_000_000_000);
    for _ in 0..1_000 {
        now = SimTime(now.0 + 1_000_000);
        clock.compare(0, 0, now, RESET);
    }
    assert_eq!(clock.loop_registers().1, -3_969);
}

#[test]
fn jitter_delays_a_time_stamp_up_to_its_limit_and_not_the_clock() {
    let errors = ClockErrors { receive_jitter: Duration::from_nanos(40), ..ClockErrors::default() };
    let clock = Clock::new(9, errors);
    let late: Vec<u64> =
        (0..1_000).map(|n| clock.stamp(Port::B, SimTime(n * 1_000)) - clock.local(SimTime(n * 1_000))).collect();
    assert_eq!((late.iter().min(), late.iter().max()), (Some(&0), Some(&40)));
    let mean = late.iter().sum::<u64>() / 1_000;
    assert!((17..=23).contains(&mean), "{mean}");
    assert_eq!(clock.stamp(Port::B, SimTime(7)), clock.stamp(Port::B, SimTime(7)));
}

#[test]
fn a_local_time_is_converted_to_virtual_time() {
    let mut clock = drifting(100);
    let (now, _) = follow(&mut clock, SimTime::ZERO, 1_000_000, 50);
    let at = clock.when(clock.local(now) + 12_345_678, now);
    assert_eq!(clock.local(at), clock.local(now) + 12_345_678);
}
