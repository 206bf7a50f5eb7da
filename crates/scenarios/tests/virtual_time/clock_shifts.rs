//! Bus shift (the reference clock follows the host) and master shift (the host's cycles follow the reference clock)
//! (protocol 7.4).

use std::time::Duration;

use ringcat::{Event, Follower, Options, PulseGrid, SubDeviceId, SyncSignals, Trigger, phase_error};
use ringcat_sim::cable::{CableId, DeviceIndex};
use ringcat_sim::network::NetworkOptions;
use ringcat_sim::time::SimTime;
use ringcat_wire::register::map;
use scenarios::clocks::{EPOCH, clocked, config, lock, spread, with_clocks, world};
use scenarios::segments::{line, ring};
use scenarios::world::World;

fn all(count: usize) -> Vec<usize> {
    (0..count).collect()
}

// covers: 7.4, dc-reference
#[test]
fn with_bus_shift_the_reference_follows_the_host() {
    let shift = config().with_bus_shift(true);
    let mut world = world(6, line(clocked(5, 50), NetworkOptions::default()), shift);
    world.run_cycles(6_000);
    let network = world.network();
    let host = world.application().now().0.wrapping_add(EPOCH);
    let truth = network.device(DeviceIndex(0)).controller.system_time(network.now());
    let error = truth.wrapping_sub(host) as i64;
    assert!(error.abs() <= 20_000, "{error} ns");
    assert!(spread(network, &all(5)) <= 200);
}

// covers: 7.4, dc-reference
#[test]
fn the_reference_follows_the_application_time_and_a_single_given_time() {
    // The application's time runs 30 ppm faster than the host's.
    let time = |world: &World| {
        let host = world.application().now().0;
        host.wrapping_add(host / 1_000_000 * 30).wrapping_add(EPOCH)
    };
    for every_cycle in [false, true] {
        let config = config().with_bus_shift(!every_cycle);
        let mut world = world(12, line(clocked(3, 50), NetworkOptions::default()), config);
        lock(&mut world, Duration::from_secs(5));
        for _ in 0..5_000 {
            world.cycle();
            let (time, now) = (time(&world), world.application().now());
            let exchange = world.application_mut().exchange_mut();
            if every_cycle {
                exchange.sync_reference_to(time + 1_000_000);
            } else {
                exchange.set_application_time(time, now);
                assert_eq!(exchange.application_time(now), time);
            }
        }
        let network = world.network();
        let truth = network.device(DeviceIndex(0)).controller.system_time(network.now());
        let error = truth.wrapping_sub(time(&world)) as i64;
        let apart = spread(network, &all(3));
        assert!(error.abs() <= 20_000 && apart <= 1_000, "every cycle {every_cycle}: {error} ns, {apart} ns apart");
    }
}

/// With bus shift the reference follows the host through a break; with master shift the cycles follow the reference,
/// also if frames reach it from the other side.
// covers: CR-26, 7.5, dc-reference
#[test]
fn bus_shift_and_master_shift_continue_through_a_cut_and_a_repair() {
    for cable in [0, 2] {
        let shift = config().with_bus_shift(true);
        let mut world = world(11, ring(clocked(4, 50), NetworkOptions::default()), shift);
        world.run_cycles(4_000);
        for heal in [false, true] {
            if heal {
                world.heal(CableId(cable))
            } else {
                world.cut(CableId(cable))
            }
            let mut worst = 0;
            for _ in 0..1_000 {
                world.cycle();
                let host = world.application().now().0.wrapping_add(EPOCH);
                let network = world.network();
                let truth = network.device(DeviceIndex(0)).controller.system_time(network.now());
                worst = worst.max((truth.wrapping_sub(host) as i64).abs());
            }
            println!("bus shift, cable {cable}, healed {heal}: {worst} ns from the host's time");
            assert!(worst <= 20_000, "cable {cable}, healed {heal}: {worst} ns");
        }
        assert!(world.all_in_op());
    }
    for cable in [0, 2] {
        let mut world = world(12, ring(clocked(4, 80), NetworkOptions::default()), config());
        world.application_mut().set_trigger(Trigger::ReferenceClock { phase_ns: -250_000 });
        lock(&mut world, Duration::from_secs(8));
        world.run_cycles(3_000);
        for heal in [false, true] {
            if heal {
                world.heal(CableId(cable))
            } else {
                world.cut(CableId(cable))
            }
            let mut worst = 0;
            for _ in 0..1_000 {
                world.cycle();
                let scheduled =
                    SimTime(world.application().begun_at().0 - world.application().pace().last_delay.as_nanos() as u64);
                let time = world.network().device(DeviceIndex(0)).controller.system_time(scheduled);
                worst = worst.max(phase_error(time, 1_000_000, -250_000).abs());
            }
            println!("master shift, cable {cable}, healed {heal}: {worst} ns from the phase");
            assert!(worst <= 5_000, "cable {cable}, healed {heal}: {worst} ns");
        }
        assert!(world.application().follower().is_some_and(Follower::is_locked));
    }
}

// covers: 7.4, dc-master-shift
#[test]
fn cycles_follow_the_reference_clock_with_a_late_host() {
    let mut world = world(10, line(clocked(4, 80), NetworkOptions::default()), config());
    world.application_mut().set_trigger(Trigger::ReferenceClock { phase_ns: -250_000 });
    world.application_mut().links_mut().oversleep(Duration::from_micros(50));
    lock(&mut world, Duration::from_secs(8));
    world.run_cycles(3_000);
    for _ in 0..500 {
        world.cycle();
        let application = world.application();
        let late = application.pace().last_delay.as_nanos() as u64;
        let scheduled = SimTime(application.begun_at().0 - late);
        let time = world.network().device(DeviceIndex(0)).controller.system_time(scheduled);
        let error = phase_error(time, 1_000_000, -250_000);
        assert!(error.abs() <= 1_000, "{error} ns");
    }
    assert!(world.application().follower().is_some_and(Follower::is_locked));
}

/// Times written to the reference are up to 50 us late at random. On average the reference stays near the host, with so
/// little jitter that the others lock on it; no clock is reported out of its window, although the reference's own
/// register shows the host's jitter.
// covers: 7.4, dc-reference
#[test]
fn with_bus_shift_clocks_lock_and_keep_their_window_with_a_host_50_us_late() {
    const COUNT: usize = 5;
    let shift = config().with_bus_shift(true);
    for reference in [50_000, -100_000] {
        let mut descriptions = clocked(COUNT, 50);
        descriptions[0].clock_drift_ppb = reference;
        let mut world = world(18, line(descriptions, NetworkOptions::default()), shift.clone());
        world.application_mut().links_mut().send_late(Duration::from_micros(50));
        let mark = world.beginning();
        lock(&mut world, Duration::from_secs(8));
        let locked_ms = world.now().0 / 1_000_000;
        world.run_cycles(2_000);
        let (mut apart, mut sum, mut worst) = (0, 0, 0);
        for _ in 0..1_000 {
            world.cycle();
            apart = apart.max(spread(world.network(), &all(COUNT)));
            let (network, now) = (world.network(), world.application().now());
            let truth = network.device(DeviceIndex(0)).controller.system_time(network.now());
            let error = truth.wrapping_sub(now.0.wrapping_add(EPOCH)) as i64;
            (sum, worst) = (sum + error, worst.max(error.abs()));
        }
        let text = format!("{reference} ppb: {apart} ns apart, {} ns from the host, {worst} ns at most", sum / 1_000);
        println!("locked after {locked_ms} ms, {text}");
        assert!(apart <= 400 && worst <= 30_000, "{text}");
        let window =
            |inside: bool| move |event: &Event| matches!(event, Event::SyncWindow { inside: of, .. } if *of == inside);
        assert!(world.saw(mark, window(true)) && !world.saw(mark, window(false)), "{text}");
    }
}

/// A clock that is moved by 6 us is reported when it leaves the window and when it is back; with bus shift each clock
/// is read, without it the broadcast read is used.
// covers: 7.2, dc-lock
#[test]
fn clocks_that_leave_their_window_and_return_are_reported() {
    for bus_shift in [false, true] {
        let shift = config().with_bus_shift(bus_shift);
        let mut world = world(20, line(clocked(3, 30), NetworkOptions::default()), shift);
        lock(&mut world, Duration::from_secs(8));
        world.run_cycles(1_000);
        let mark = world.mark();
        let offset = world.application().engine().clocks()[2].offset_ns + 6_000;
        let bytes = offset.to_le_bytes().to_vec();
        let written = world.application_mut().engine_mut().start_register_write(
            SubDeviceId(2),
            map::DC_SYSTEM_TIME_OFFSET,
            bytes,
        );
        for inside in [false, true] {
            let reports = |event: &Event| matches!(event, Event::SyncWindow { inside: of, .. } if *of == inside);
            world.until(Duration::from_secs(4), "the window", |world| world.saw(mark, reports));
        }
        drop(written);
    }
}

/// The application sets its time from the first cycle on, and pulses come at multiples of the cycle after that time.
// covers: 7.3, dc-sync
#[test]
fn pulses_are_aligned_to_the_first_application_time_or_to_system_time() {
    const BEGIN: u64 = 123_456;
    for (grid, wanted) in [(PulseGrid::SystemTime, 200_000), (PulseGrid::FirstApplicationTime, 323_456)] {
        let network = line(clocked(3, 50), NetworkOptions::default());
        let mut world = World::with(13, network, &Options::default(), |scan| {
            let mut declaration = with_clocks(scan, config().with_pulse_grid(grid));
            for subdevice in &mut declaration.subdevices {
                subdevice.sync = Some(SyncSignals::sync0(1_000_000, 200_000));
            }
            declaration
        })
        .expect("it can be activated");
        let first = world.application().now().0.wrapping_add(EPOCH) / 1_000_000 * 1_000_000 + BEGIN;
        for cycle in 0..4_000 {
            let now = world.application().now();
            world.application_mut().exchange_mut().set_application_time(first + cycle * 1_000_000, now);
            world.cycle();
        }
        assert!(world.all_in_op());
        let network = world.network();
        for device in 0..3 {
            let next = network.device(DeviceIndex(device)).controller.next_sync0(network.now()).expect("it runs");
            let phase = network.device(DeviceIndex(0)).controller.system_time(next) % 1_000_000;
            assert!(phase.abs_diff(wanted) <= 100, "{grid:?}, device {device}: {phase} ns");
        }
    }
}

/// One clock is beyond the range of its control loop (protocol 7.2.1).
// covers: 7.3, dc-lock
#[test]
fn with_the_choices_of_igh_a_subdevice_goes_on_after_5_s_without_lock() {
    let mut descriptions = clocked(3, 0);
    descriptions[2].clock_drift_ppb = 900_000;
    let mut world = World::with(14, line(descriptions, NetworkOptions::default()), &Options::default(), |scan| {
        let mut declaration = with_clocks(scan, config().as_igh());
        declaration.subdevices[0].sync = Some(SyncSignals::sync0(1_000_000, 0));
        declaration
    })
    .expect("it can be activated");
    let (mark, begin) = (world.beginning(), world.now());
    world.until(Duration::from_secs(9), "all in OP", World::all_in_op);
    assert!(world.now() - begin >= Duration::from_secs(5), "it waits for 5 s");
    let went_on: Vec<_> = world
        .events(mark)
        .iter()
        .filter_map(|timed| match &timed.event {
            Event::WentOnUnlocked { subdevice, reason } => Some((*subdevice, reason.clone())),
            _ => None,
        })
        .collect();
    let [(SubDeviceId(0), reason)] = &went_on[..] else { panic!("{went_on:?}") };
    let expected = "the clock of position 2 did not lock within 5000 ms: expected a difference of at most 10000 ns";
    assert!(reason.starts_with(expected), "{reason}");
    assert!(!world.application().engine().clocks_locked());
}
