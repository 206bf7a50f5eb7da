//! Distributed clocks: delays, lock, spread, SYNC signals (protocol 7).

use std::time::Duration;

use ringcat::{Event, Options, ReferenceClock, SubDeviceId, SyncSignals, automatic};
use ringcat_sim::cable::{CableId, DeviceIndex};
use ringcat_sim::network::NetworkOptions;
use ringcat_wire::al::AlStatusCode;
use scenarios::clocks::{
    EPOCH, clocked, config, delay, differences, largest_spread, lock, spread, watch, with_clocks, world,
};
use scenarios::seeds;
use scenarios::segments::{line, ring};
use scenarios::world::{CYCLE, World};

/// Delay of a pass and of a cable.
const HOP_NS: i64 = 300 + 50;

fn all(count: usize) -> Vec<usize> {
    (0..count).collect()
}

// covers: 7.2, dc-lock
#[test]
fn clocks_of_a_line_lock_and_stay_together() {
    let mut world = world(2, line(clocked(20, 50), NetworkOptions::default()), config());
    let mark = world.beginning();
    lock(&mut world, Duration::from_secs(3));
    assert!(world.saw(mark, |event| matches!(event, Event::ClocksLocked { .. })));
    let largest = largest_spread(&mut world, &all(20), 2_000);
    assert!(world.saw(mark, |event| matches!(event, Event::SyncWindow { inside: true, .. })));
    assert!(!world.saw(mark, |event| matches!(event, Event::SyncWindow { inside: false, .. })));
    assert!(largest <= 100, "{largest} ns");
    // The MainDevice's values are the true ones.
    let status = world.application().engine().clocks();
    assert_eq!(status.len(), 20);
    for (clock, truth) in status.iter().zip(differences(world.network(), &all(20))) {
        let believed = i64::from(clock.difference_ns.expect("it was read"));
        assert!((believed - truth).abs() <= 60, "{clock:?}: {truth} ns");
        assert!(clock.is_locked && clock.worst_ns <= 100, "{clock:?}");
    }
    let reference = world.application().exchange().reference_time().expect("it was read");
    let now = world.application().now();
    let network = world.network();
    let truth = network.device(DeviceIndex(0)).controller.system_time(network.now());
    let error = reference.at(now).wrapping_sub(truth) as i64;
    // Transmission time of a minimal frame and of the domain's frame.
    assert!(error.abs() <= 30_000, "{error} ns");
    let host = now.0.wrapping_add(EPOCH);
    assert!((truth.wrapping_sub(host) as i64).abs() < 2_000_000, "the reference began with the host's time");
}

/// The reference at the upper limit of the rate, others at the lower limit, and the reverse.
// covers: 7.2.1, dc-lock
#[test]
fn clocks_anywhere_within_100_ppm_lock_and_stay_together() {
    const COUNT: usize = 6;
    for reference in [100_000, -100_000] {
        let mut descriptions = clocked(COUNT, 100);
        for (device, share) in descriptions.iter_mut().zip([1, -1, 0, 1, -1, -1]) {
            device.clock_drift_ppb = reference * share;
        }
        let mut world = world(14, line(descriptions, NetworkOptions::default()), config());
        lock(&mut world, Duration::from_secs(2));
        let largest = largest_spread(&mut world, &all(COUNT), 2_000);
        assert!(largest <= 100, "reference at {reference} ppb: {largest} ns");
    }
}

// covers: 7.3, dc-sync
#[test]
fn sync0_comes_at_the_same_time_everywhere_with_its_shift() {
    const COUNT: usize = 9;
    let network = line(clocked(COUNT, 50), NetworkOptions::default());
    let mut world = World::with(3, network, &Options::default(), |scan| {
        let mut declaration = with_clocks(scan, config());
        for (number, subdevice) in declaration.subdevices.iter_mut().enumerate() {
            let shift = if number < 5 { 200_000 } else { -300_000 };
            subdevice.sync = Some(SyncSignals::sync0(1_000_000, shift));
        }
        declaration
    })
    .expect("it can be activated");
    world.until(Duration::from_secs(4), "all in OP", World::all_in_op);
    assert!(world.application().engine().clocks_locked(), "OP before the clocks are locked");
    world.run_cycles(300);
    let network = world.network();
    let now = network.now();
    let at: Vec<i64> = (0..COUNT)
        .map(|device| {
            let controller = &network.device(DeviceIndex(device)).controller;
            let next = controller.next_sync0(now).expect("it runs");
            let reference = network.device(DeviceIndex(0)).controller.system_time(next);
            (reference % 1_000_000) as i64
        })
        .collect();
    for (device, phase) in at.iter().enumerate() {
        let wanted = if device < 5 { 200_000 } else { 700_000 };
        assert!((phase - wanted).abs() <= 100, "device {device}: {phase} ns");
    }
}

// covers: dc-sync
#[test]
fn without_lock_a_subdevice_with_sync_stays_in_safeop_with_an_error() {
    let mut descriptions = clocked(3, 0);
    // Beyond the range of the control loop (protocol 7.2.1).
    descriptions[2].clock_drift_ppb = 900_000;
    let mut world = World::with(4, line(descriptions, NetworkOptions::default()), &Options::default(), |scan| {
        let limit = Duration::from_secs(2);
        let mut declaration = with_clocks(scan, config().with_lock_limit(limit));
        declaration.subdevices[0].sync = Some(SyncSignals::sync0(1_000_000, 0));
        declaration
    })
    .expect("it can be activated");
    let mark = world.beginning();
    world.run_cycles(2_500);
    let reports = |event: &Event| match event {
        Event::ConfigurationFailed { subdevice: SubDeviceId(0), reason } => reason.starts_with(
            "the clock of position 2 did not lock within 2000 ms: expected a difference of at most 100 ns",
        ),
        _ => false,
    };
    assert!(world.saw(mark, reports));
    assert!(!world.all_in_op());
}

// covers: dc-reference
#[test]
fn a_reference_that_the_application_chooses_is_followed() {
    let chosen = config().with_reference(ReferenceClock::Declared(SubDeviceId(2)));
    let mut world = world(5, line(clocked(6, 30), NetworkOptions::default()), chosen);
    let mark = world.beginning();
    world.run_cycles(2_500);
    let reports =
        |event: &Event| matches!(event, Event::ReferenceClock { position: Some(position) } if position.0 == 2);
    assert!(world.saw(mark, reports));
    let behind: Vec<usize> = (2..6).collect();
    assert!(spread(world.network(), &behind) <= 100);
    // Clocks before it follow the time that the host predicts.
    assert!(spread(world.network(), &all(6)) <= 1_000, "{:?}", differences(world.network(), &all(6)));
}

// covers: dc-reference
#[test]
fn the_first_subdevice_with_sync_is_the_reference_on_request() {
    let network = line(clocked(4, 30), NetworkOptions::default());
    let mut world = World::with(13, network, &Options::default(), |scan| {
        let wanted = config().with_reference(ReferenceClock::FirstConfigured);
        let mut declaration = with_clocks(scan, wanted);
        declaration.subdevices[1].sync = Some(SyncSignals::sync0(1_000_000, 0));
        declaration.subdevices[3].sync = Some(SyncSignals::sync0(1_000_000, 0));
        declaration
    })
    .expect("it can be activated");
    world.run_cycles(50);
    let references = world.application().engine().clocks();
    assert_eq!(references.iter().map(|clock| clock.is_reference).collect::<Vec<_>>(), [false, true, false, false]);
}

/// The first clock is the reference although its SubDevice is undeclared; the SubDevice stays in its state.
// covers: 7.2, dc-reference
#[test]
fn an_undeclared_reference_is_followed_and_not_configured() {
    let network = line(clocked(3, 30), NetworkOptions::default());
    let mut world = World::with(19, network, &Options::default(), |scan| {
        let clocks = Some(config());
        automatic(&scan.subdevices[1..], CYCLE).with_clocks(clocks)
    })
    .expect("it can be activated");
    let before = world.network().device(DeviceIndex(0)).al_status();
    lock(&mut world, Duration::from_secs(3));
    assert!(world.application().engine().clocks()[0].is_reference);
    assert!(largest_spread(&mut world, &all(3), 200) <= 100, "{:?}", differences(world.network(), &all(3)));
    assert_eq!(world.network().device(DeviceIndex(0)).al_status(), before);
}

// covers: dc-lock
#[test]
fn a_subdevice_that_lost_its_power_has_its_clock_back_in_op() {
    let network = line(clocked(6, 50), NetworkOptions::default());
    let mut world = World::with(7, network, &Options::default(), |scan| {
        let mut declaration = with_clocks(scan, config());
        for subdevice in &mut declaration.subdevices {
            subdevice.sync = Some(SyncSignals::sync0(1_000_000, 0));
        }
        declaration
    })
    .expect("it can be activated");
    world.until(Duration::from_secs(4), "all in OP", World::all_in_op);
    world.power_off(DeviceIndex(5));
    world.run_cycles(50);
    world.power_on(DeviceIndex(5));
    world.until(Duration::from_secs(10), "all in OP again", World::all_in_op);
    assert!(spread(world.network(), &all(6)) <= 200, "{:?}", differences(world.network(), &all(6)));
    assert!(world.network().devices().all(|device| device.al_status_code() != AlStatusCode::NO_SYNC));
}

// covers: 7.5, dc-ring
#[test]
fn closed_and_broken_rings_have_the_delays_of_a_line() {
    const COUNT: usize = 8;
    for cut in [None, Some(3), Some(1)] {
        let mut network = ring(clocked(COUNT, 50), NetworkOptions::default());
        if let Some(cable) = cut {
            network.cut(CableId(cable));
            network.advance_by(Duration::from_millis(1));
        }
        let mut world = world(8, network, config());
        let mark = world.beginning();
        lock(&mut world, Duration::from_secs(8));
        assert!(cut.is_some() || !world.saw(mark, |event| matches!(event, Event::RingOpened { .. })));
        assert!(!world.saw(mark, |event| matches!(event, Event::Returned { .. } | Event::Lost { .. })));
        let first_behind = cut.unwrap_or(COUNT);
        for device in 0..COUNT {
            let hops = if device < first_behind { device } else { device - first_behind };
            let error = i64::from(delay(world.network(), device)) - HOP_NS * hops as i64;
            assert!(error.abs() <= 30, "cut {cut:?}, device {device}: {error} ns");
        }
        let (front, behind) = (all(first_behind), (first_behind..COUNT).collect::<Vec<_>>());
        assert!(largest_spread(&mut world, &front, 500) <= 100);
        assert!(spread(world.network(), &behind) <= 100);
        let across = spread(world.network(), &all(COUNT));
        assert!(across <= 5_000, "cut {cut:?}: {across} ns across");
    }
}

// covers: CR-26, 7.5, dc-ring
#[test]
fn a_cut_and_a_repair_of_any_cable_keep_all_clocks_synchronous() {
    const COUNT: usize = 6;
    for cable in 0..=COUNT {
        let mut world = world(9, ring(clocked(COUNT, 50), NetworkOptions::default()), config());
        lock(&mut world, Duration::from_secs(8));
        world.run_cycles(300);
        let (front, behind): (Vec<usize>, Vec<usize>) = ((0..cable).collect(), (cable..COUNT).collect());
        let mut worst = [0; 3];
        let mut watch = |world: &mut World, cycles: u64| {
            for _ in 0..cycles {
                world.cycle();
                let network = world.network();
                for (worst, part) in worst.iter_mut().zip([&front, &behind, &all(COUNT)]) {
                    *worst = (*worst).max(spread(network, part));
                }
            }
        };
        world.cut(CableId(cable));
        watch(&mut world, 700);
        world.heal(CableId(cable));
        watch(&mut world, 500);
        assert!(worst[0] <= 1_000 && worst[1] <= 1_000 && worst[2] <= 5_000, "cable {cable}: {worst:?} ns");
        world.run_cycles(1_000);
        let after = largest_spread(&mut world, &all(COUNT), 200);
        assert!(after <= 100, "cable {cable}: {after} ns after the repair");
    }
}

/// Both copies of a frame are sent at different times: inside a part the host has no influence, across both parts only
/// the mean of its jitter has.
// covers: 7.5, dc-ring
#[test]
fn clocks_of_an_open_ring_stay_synchronous_with_copies_5_us_apart() {
    const COUNT: usize = 6;
    let runs = seeds::from_environment().unwrap_or(0..6).flat_map(|seed| [(seed, 20, 3_000), (seed, 100, 1_200)]);
    for (seed, ppm, open_for) in runs {
        let mut world = world(seed, ring(clocked(COUNT, ppm), NetworkOptions::default()), config());
        world.application_mut().links_mut().reseed(seed);
        world.application_mut().links_mut().send_late(Duration::from_micros(5));
        lock(&mut world, Duration::from_secs(8));
        world.run_cycles(300);
        let (front, behind) = ([0, 1, 2], [3, 4, 5]);
        let mark = world.mark();
        for (heal, cycles) in [(false, open_for), (true, 500)] {
            if heal {
                world.heal(CableId(3))
            } else {
                world.cut(CableId(3))
            }
            let [front, behind, across] = watch(&mut world, [&front, &behind, &all(COUNT)], cycles);
            let text =
                format!("seed {seed}, {ppm} ppm, healed {heal}: {front}, {behind} ns inside, {across} ns across");
            println!("{text}");
            assert!(front <= 150 && behind <= 150 && across <= 2_000, "{text}");
        }
        let settled = largest_spread(&mut world, &all(COUNT), 200);
        assert!(settled <= 100, "seed {seed}, {ppm} ppm: {settled} ns after the repair");
        assert!(!world.saw(mark, |event| matches!(event, Event::SyncWindow { inside: false, .. })), "seed {seed}");
    }
}

/// The second part has never followed the first, and their rates differ by the maximum.
// covers: 7.5, dc-ring
#[test]
fn a_ring_open_from_the_start_locks_with_copies_5_us_apart() {
    let mut descriptions = clocked(6, 100);
    (descriptions[0].clock_drift_ppb, descriptions[3].clock_drift_ppb) = (-100_000, 100_000);
    let mut network = ring(descriptions, NetworkOptions::default());
    network.cut(CableId(3));
    network.advance_by(Duration::from_millis(1));
    let mut world = world(17, network, config());
    world.application_mut().links_mut().send_late(Duration::from_micros(5));
    lock(&mut world, Duration::from_secs(5));
    world.run_cycles(1_500);
    let [front, behind, across] = watch(&mut world, [&[0, 1, 2], &[3, 4, 5], &all(6)], 1_000);
    assert!(front <= 500 && behind <= 500 && across <= 5_000, "{front}, {behind} ns inside, {across} ns across");
    world.heal(CableId(3));
    world.run_cycles(2_000);
    let after = largest_spread(&mut world, &all(6), 200);
    assert!(after <= 100, "{after} ns after the repair");
}
