//! Calls of distributed clocks: times given before activation, in the cycle, late or never; SYNC signals that end with
//! the application.

use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::fault::Fault;
use ringcat_sim::network::NetworkOptions;
use ringcat_wire::register::{DcSystemTimeDifference, map};
use scenarios::calls::errno::Errno;
use scenarios::calls::master::Ecrt;
use scenarios::pulses::Pulses;
use scenarios::segments::{descriptions, line, ring};

use super::{KINDS, assert_idle, configure, requested, run_all};

/// Longest start with clocks: 5 s without a lock, as with IgH.
const WITH_CLOCKS: std::time::Duration = std::time::Duration::from_secs(12);
const CYCLE_NS: u32 = 1_000_000;
const ASSIGN: u16 = 0x0300;

/// SYNC0 pulses of the first device so far.
fn pulses(ecrt: &mut Ecrt) -> u64 {
    let network = ecrt.network();
    network.device(DeviceIndex(0)).controller.sync0_pulses(network.now())
}

// covers: api, dc-sync, dc-reference
#[test]
fn sync_pulses_run_with_the_application_and_end_with_it() {
    for (count, mut ecrt) in requested() {
        for (given_before, loops_first) in [(true, 0), (false, 0), (false, 300)] {
            let (_, configs) = configure(&mut ecrt, 0..count);
            ecrt.dc(configs[0], ASSIGN, CYCLE_NS, 250_000);
            if given_before {
                let time = ecrt.application_clock();
                ecrt.application_time(time);
            }
            ecrt.activate().expect("it fits");
            // Without any time for a while, then in each cycle.
            ecrt.cycles_without_time(loops_first);
            let time = ecrt.cycle_until_op(WITH_CLOCKS).unwrap_or_else(|error| panic!("{count}: {error}"));
            let before = pulses(&mut ecrt);
            ecrt.cycles(100);
            let text = format!("{count}: given before {given_before}, {loops_first} cycles without, OP after {time:?}");
            assert!(pulses(&mut ecrt) >= before + 99, "{text}");
            assert!(ecrt.reference_clock_time().is_ok(), "{text}");
            ecrt.sync_monitor_queue().expect("there are clocks");
            assert_eq!(ecrt.sync_monitor_process(), u32::MAX, "no answer yet");
            ecrt.cycle();
            assert_ne!(ecrt.sync_monitor_process(), u32::MAX, "{text}");
            println!("{text}");
            ecrt.deactivate().expect("all follow");
            assert_idle(&mut ecrt, &text);
            let before = pulses(&mut ecrt);
            ecrt.pause(std::time::Duration::from_millis(50));
            assert!(pulses(&mut ecrt) <= before, "{text}");
        }
        // Without clocks in the configuration.
        run_all(&mut ecrt, count);
        assert_eq!(ecrt.sync_reference_clock(), Err(Errno::NxIo));
        assert_eq!(ecrt.sync_slave_clocks(), Err(Errno::NxIo));
        assert_eq!(ecrt.reference_clock_time(), Err(Errno::NxIo));
        ecrt.deactivate().expect("all follow");
        assert_idle(&mut ecrt, "without clocks");
    }
}

/// Devices with a clock.
fn with_clock(ecrt: &mut Ecrt) -> Vec<usize> {
    let found = ecrt.side.engine().subdevices();
    (0..found.len()).filter(|at| found[*at].controller.features.dc).collect()
}

/// |0x092C| of a device.
fn difference_ns(ecrt: &mut Ecrt, device: usize) -> u32 {
    let bytes = ecrt.network().device(DeviceIndex(device)).controller.register(map::DC_SYSTEM_TIME_DIFFERENCE, 4);
    DcSystemTimeDifference::decode(&[bytes[0], bytes[1], bytes[2], bytes[3]]).signed_ns().unsigned_abs()
}

/// Masters of segments whose clocks drift by up to 30 ppm.
fn drifting() -> impl Iterator<Item = (usize, Ecrt)> {
    [2, 5, 12].into_iter().flat_map(|count| {
        let drifting = || {
            let mut devices = descriptions(&KINDS[..count]);
            for (number, device) in devices.iter_mut().enumerate() {
                device.clock_drift_ppb = (number as i64 * 7_919 % 61 - 30) * 1_000 + 500;
            }
            devices
        };
        let options = NetworkOptions::default;
        [line(drifting(), options()), ring(drifting(), options())].map(|network| {
            let mut ecrt = Ecrt::new(network);
            ecrt.request().expect("it is free");
            (count, ecrt)
        })
    })
}

/// Runs the acyclic half without a cycle until the clocks are set up.
fn set_up_without_a_cycle(ecrt: &mut Ecrt, clocks: &[usize]) {
    let mut rounds_after = 0;
    for _ in 0..20_000 {
        ecrt.receive();
        ecrt.pause(std::time::Duration::from_micros(50));
        let network = ecrt.network();
        let offset = |at: usize| network.device(DeviceIndex(at)).controller.register(map::DC_SYSTEM_TIME_OFFSET, 8);
        rounds_after += u32::from(clocks.iter().all(|at| offset(*at) != [0; 8]));
        if rounds_after == 20 {
            return;
        }
    }
    panic!("the clocks are not set up before the first cycle");
}

/// In the next cycles all clocks are together, the reference has the application's phase, and no register shows more.
fn assert_together(ecrt: &mut Ecrt, clocks: &[usize], reference: usize, text: &str) {
    let cycle = i64::from(CYCLE_NS);
    for _ in 0..500 {
        ecrt.cycle();
        let application = ecrt.application_clock();
        let network = ecrt.network();
        let time = |at: usize| network.device(DeviceIndex(at)).controller.system_time(network.now());
        let phase = (time(reference).wrapping_sub(application) as i64).rem_euclid(cycle);
        let off = phase.min(cycle - phase);
        assert!(off <= 20_000, "{text}: the reference is {off} ns from its phase");
        for device in clocks.iter().copied() {
            let apart = i64::from((time(device) as u32).wrapping_sub(time(reference) as u32) as i32);
            assert!(apart.abs() <= 1_000, "{text}: clock {device} is {apart} ns from its reference");
        }
        for device in clocks.iter().copied() {
            let shown = difference_ns(ecrt, device);
            assert!(shown <= 20_000, "{text}: clock {device} shows {shown} ns");
        }
    }
}

/// As with an acyclic half of its own thread: the clocks are set up before the program gives a time and sends its first
/// frame. The first time then differs from that of the set-up by anything.
///
/// Without the correction of decision 0078 this fails: in `crates/engine/src/exchange/clocks.rs` take
/// `or_else(|| ... posted_time(now))` out of the prediction. Then the reference is written once, 820,000,000 s from the
/// application's time, and each reading of it finds the same shift again (`ApplicationTime`) for as long as the program
/// runs.
// covers: 7.2, api, dc-reference
#[test]
fn a_first_time_between_the_set_up_and_the_first_cycle_moves_all_clocks() {
    let bases = [(FAR_NS, false), (FAR_NS, true), (30_000_000, true), (FAR_NS.wrapping_neg(), false)];
    for (count, mut ecrt) in drifting() {
        for (base, chooses_last) in bases {
            let text = format!("{count}, {} ns, last chosen {chooses_last}", base as i64);
            let clocks = with_clock(&mut ecrt);
            let (_, configs) = configure(&mut ecrt, 0..count);
            ecrt.dc(configs[0], ASSIGN, CYCLE_NS, 250_000);
            let reference = if chooses_last { clocks[clocks.len() - 1] } else { clocks[0] };
            ecrt.select_reference_clock(configs[reference]);
            ecrt.clock_base = base;
            ecrt.activate().expect("it fits");
            set_up_without_a_cycle(&mut ecrt, &clocks);
            let time = ecrt.application_clock();
            ecrt.application_time(time);
            ecrt.cycle_until_op(WITH_CLOCKS).unwrap_or_else(|error| panic!("{text}: {error}"));
            ecrt.cycles(10_000);
            assert_together(&mut ecrt, &clocks, reference, &text);
            ecrt.deactivate().expect("all follow");
            assert_idle(&mut ecrt, &text);
        }
    }
}

/// Seconds from 2000 to 2026: CLOCK_REALTIME instead of CLOCK_MONOTONIC.
const FAR_NS: u64 = 820_000_000_000_377_123;
/// Time in which pulses are at their phase again: a cycle at 400 ppm, and 0.5 s.
const PHASE: usize = 3_000;

/// The program gives another clock from one cycle to the next. No pulse is missing, all stay in OP, and after 3 s the
/// pulses are at their phase in the new time.
// covers: 7.3, api, dc-reference, dc-sync
#[test]
fn a_jump_from_monotonic_to_real_time_in_op_is_followed_within_3_s() {
    for (count, mut ecrt) in requested().filter(|(count, _)| [1, 12].contains(count)) {
        for jump in [FAR_NS, FAR_NS.wrapping_neg(), 499_000] {
            let (_, configs) = configure(&mut ecrt, 0..count);
            let synced: Vec<usize> = (0..count).filter(|at| [0, 7].contains(at)).collect();
            synced.iter().for_each(|at| ecrt.dc(configs[*at], ASSIGN, CYCLE_NS, 250_000));
            let time = ecrt.application_clock();
            ecrt.application_time(time);
            ecrt.activate().expect("it fits");
            ecrt.cycle_until_op(WITH_CLOCKS).unwrap_or_else(|error| panic!("{count}: {error}"));
            ecrt.cycles(8_000);
            let mut pulses = Pulses::new(ecrt.network(), synced.clone(), CYCLE_NS.into());
            let phase = |pulses: &Pulses, base: u64| {
                let next = pulses.devices()[0].next.expect("it pulses").0;
                next.wrapping_add(base) as i64 - time as i64
            };
            let cycle = i64::from(CYCLE_NS);
            let before = phase(&pulses, ecrt.clock_base);
            ecrt.clock_base = ecrt.clock_base.wrapping_add(jump);
            let (mut apart, mut off) = (0, 0);
            for number in 0..PHASE + 500 {
                ecrt.cycle();
                pulses.observe(ecrt.network());
                apart = apart.max(pulses.apart_ns().expect("all pulse"));
                if number >= PHASE {
                    let now = phase(&pulses, ecrt.clock_base).wrapping_sub(before).rem_euclid(cycle);
                    off = off.max(now.min(cycle - now));
                }
            }
            let (worst, fewest) = (pulses.worst_ns(), pulses.fewest());
            let text = format!("{count}, jump of {} ns", jump as i64);
            println!("{text}: {off} ns from the phase, {worst} ns from the cycle, {apart} ns apart, {fewest} pulses");
            assert!(off <= 20_000, "{text}: {off} ns from the phase");
            assert!(worst <= 1_000 && apart <= 1_000, "{text}: {worst} ns, {apart} ns");
            assert!(fewest >= PHASE as u64 + 495, "{text}: {fewest} pulses");
            assert!(ecrt.is_running(), "{text}: {}", ecrt.describe());
            // A SubDevice that starts its signals after the jump pulses with the others.
            if let Some(last) = synced.last().filter(|last| **last > 0) {
                ecrt.network().apply(Fault::PowerOff(DeviceIndex(*last)));
                ecrt.cycles(100);
                ecrt.network().apply(Fault::PowerOn(DeviceIndex(*last)));
                ecrt.cycle_until_op(WITH_CLOCKS).unwrap_or_else(|error| panic!("{text}: {error}"));
                ecrt.cycles(4_000);
                let apart = apart_ns(&mut ecrt, &synced);
                assert!(apart <= 1_000, "{text}: {apart} ns apart after a return");
            }
            ecrt.deactivate().expect("all follow");
            assert_idle(&mut ecrt, &text);
        }
    }
}

/// Largest distance of the pulses of devices within some cycles.
fn apart_ns(ecrt: &mut Ecrt, devices: &[usize]) -> u64 {
    let mut pulses = Pulses::new(ecrt.network(), devices.to_vec(), CYCLE_NS.into());
    let mut apart = 0;
    for _ in 0..100 {
        ecrt.cycle();
        pulses.observe(ecrt.network());
        apart = apart.max(pulses.apart_ns().expect("all pulse"));
    }
    apart
}

/// Programs set their time before the activation: pulses begin with the first time, not with that of the activation.
// covers: 7.3, api, dc-sync
#[test]
fn pulses_begin_with_the_first_time_that_was_set_before_the_activation() {
    const SHIFT: i32 = 250_000;
    for (count, mut ecrt) in requested().filter(|(count, _)| [1, 12].contains(count)) {
        for is_set_twice in [false, true] {
            let (_, configs) = configure(&mut ecrt, 0..count);
            ecrt.dc(configs[0], ASSIGN, CYCLE_NS, SHIFT);
            let first = ecrt.application_clock();
            ecrt.application_time(first);
            ecrt.pause(std::time::Duration::from_nanos(1_234_567));
            if is_set_twice {
                let time = ecrt.application_clock();
                ecrt.application_time(time);
                ecrt.pause(std::time::Duration::from_nanos(345_678));
            }
            ecrt.activate().expect("it fits");
            ecrt.cycle_until_op(WITH_CLOCKS).unwrap_or_else(|error| panic!("{count}: {error}"));
            ecrt.cycles(4_000);
            let pulses = Pulses::new(ecrt.network(), vec![0], CYCLE_NS.into());
            let next = pulses.devices()[0].next.expect("it pulses").0.wrapping_add(ecrt.clock_base);
            let cycle = i64::from(CYCLE_NS);
            let off = (next as i64 - first as i64 - i64::from(SHIFT)).rem_euclid(cycle);
            let off = off.min(cycle - off);
            assert!(off <= 20_000, "{count}, set twice {is_set_twice}: {off} ns from the phase");
            ecrt.deactivate().expect("all follow");
            assert_idle(&mut ecrt, &format!("{count}, {is_set_twice}"));
        }
    }
}

/// The time is first set when all SubDevices are on their way to SAFEOP: signals that start then or later have the same
/// grid.
// covers: 7.3, api, dc-sync
#[test]
fn pulses_that_start_before_and_after_the_first_time_have_one_grid() {
    for (count, mut ecrt) in requested().filter(|(count, _)| *count == 12) {
        for without in [20, 100, 300] {
            let (_, configs) = configure(&mut ecrt, 0..count);
            let synced: Vec<usize> = with_clock(&mut ecrt);
            synced.iter().for_each(|at| ecrt.dc(configs[*at], ASSIGN, CYCLE_NS, 250_000));
            let last = *synced.last().filter(|last| **last > 0).expect("two clocks");
            ecrt.network().apply(Fault::PowerOff(DeviceIndex(last)));
            ecrt.activate().expect("it fits");
            ecrt.cycles_without_time(without);
            ecrt.cycles(400);
            ecrt.network().apply(Fault::PowerOn(DeviceIndex(last)));
            ecrt.cycle_until_op(WITH_CLOCKS).unwrap_or_else(|error| panic!("{without}: {error}"));
            ecrt.cycles(4_000);
            let apart = apart_ns(&mut ecrt, &synced);
            assert!(apart <= 1_000, "{count}, {without} cycles without a time: {apart} ns apart");
            ecrt.deactivate().expect("all follow");
            assert_idle(&mut ecrt, &format!("{count}, {without}"));
        }
    }
}
