//! The time that the application gives: first set late, with jumps, by calls (protocol 7.2 to 7.4).

use std::time::Duration;

use ringcat::{ClockConfig, ClockDatagrams, Event, Options, PulseGrid, ReferenceClock, SubDeviceId, SyncSignals};
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::controller::Wander;
use ringcat_sim::description::DeviceDescription;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::register::map;
use scenarios::clocks::{EPOCH, clock_tree, clocked, config, lock, spread, with_clocks, world};
use scenarios::pulses::Pulses;
use scenarios::segments::{line, ring};
use scenarios::world::World;

/// DC_SYSTEM_TIME_DIFFERENCE: bit 31 is the sign.
const DIFFERENCE: ringcat_wire::address::RegisterAddress = map::DC_SYSTEM_TIME_DIFFERENCE;
/// Change of a clock's rate to either side, with a period of 50 ms: some microseconds.
const SWING_PPM: i64 = 300;
/// Cycle of SYNC0 and of the application.
const CYCLE_NS: u64 = 1_000_000;
/// Seconds from 2000 to 2026, as CLOCK_REALTIME differs from CLOCK_MONOTONIC.
const FAR_NS: u64 = 820_000_000_000_377_123;

/// Lines, junctions and rings of several sizes.
const SEGMENTS: [(&str, usize); 6] =
    [("line", 1), ("line", 10), ("tree", 10), ("ring", 10), ("tree", 50), ("ring", 50)];

/// All variants in small segments, one of them in each large segment.
fn some<T: Copy>(variants: &[T], number: usize, count: usize) -> Vec<T> {
    if count < 10 { variants.to_vec() } else { vec![variants[number % variants.len()]] }
}

pub fn network(kind: &str, count: usize) -> Network {
    wired_as(kind, clocked(count, 50))
}

pub fn wired_as(kind: &str, descriptions: Vec<DeviceDescription>) -> Network {
    match kind {
        "line" => line(descriptions, NetworkOptions::default()),
        "tree" => clock_tree(descriptions),
        _ => ring(descriptions, NetworkOptions::default()),
    }
}

/// The application's time, relative to the host's.
pub struct Host {
    pub base: u64,
}

impl Host {
    pub fn time(&self, world: &World) -> u64 {
        world.application().now().0.wrapping_add(self.base)
    }

    /// Sets the application's time and runs a cycle.
    pub fn cycle(&self, world: &mut World) {
        let (time, now) = (self.time(world), world.application().now());
        world.application_mut().exchange_mut().set_application_time(time, now);
        world.cycle();
    }

    /// The reference clock's true time minus the application's.
    pub fn error_ns(&self, world: &World) -> i64 {
        let network = world.network();
        network.device(DeviceIndex(0)).controller.system_time(network.now()).wrapping_sub(self.time(world)) as i64
    }

    /// The same without whole cycles.
    pub fn phase_ns(&self, world: &World) -> i64 {
        self.error_ns(world).rem_euclid(CYCLE_NS as i64)
    }
}

/// Clocks follow a time that the application sets first long after the set-up, whether the host steers or not, and stay
/// together.
// covers: 7.2, dc-reference
#[test]
fn a_first_application_time_after_the_set_up_is_the_system_time_within_100_ms() {
    for (number, (kind, count)) in SEGMENTS.into_iter().enumerate() {
        let variants = [(true, 400), (false, 400), (true, 2_500), (false, 2_500)];
        for (bus_shift, late_ms) in some(&variants, number, count) {
            let mut world = world(41, network(kind, count), config().with_bus_shift(bus_shift));
            world.run_cycles(late_ms);
            let host = Host { base: EPOCH.wrapping_add(FAR_NS) };
            let text = format!("{kind} of {count}, bus shift {bus_shift}, set after {late_ms} ms");
            for _ in 0..100 {
                host.cycle(&mut world);
            }
            let error = host.error_ns(&world);
            assert!(error.abs() <= 100_000, "{text}: {error} ns after 100 ms");
            lock(&mut world, Duration::from_secs(3));
            for _ in 0..if count > 10 { 1_000 } else { 2_000 } {
                host.cycle(&mut world);
                let apart = spread(world.network(), &(0..count).collect::<Vec<_>>());
                assert!(apart <= 300, "{text}: {apart} ns apart");
            }
            let error = host.error_ns(&world);
            assert!(!bus_shift || error.abs() <= 20_000, "{text}: {error} ns");
        }
    }
}

/// A world with SYNC0 at all SubDevices, in OP, and with the application's time set in each cycle.
pub fn with_sync0(seed: u64, network: Network, config: ClockConfig, host: &Host) -> World {
    let mut world = World::with(seed, network, &Options::default(), |scan| {
        let mut declaration = with_clocks(scan, config);
        for subdevice in &mut declaration.subdevices {
            subdevice.sync = Some(SyncSignals::sync0(CYCLE_NS as u32, 200_000));
        }
        declaration
    })
    .expect("it can be activated");
    // With bus shift the reference has to come near the host's time first.
    let until_op = (0..8_000).take_while(|_| {
        host.cycle(&mut world);
        !world.all_in_op()
    });
    println!("in OP after {} ms", until_op.count());
    (0..1_000).for_each(|_| host.cycle(&mut world));
    assert!(world.all_in_op(), "{}", world.condition());
    world
}

/// Before SYNC signals start, a jump of the application's time is a jump of all clocks.
// covers: 7.2, dc-reference
#[test]
fn a_jump_of_the_application_time_is_followed_within_250_ms_without_sync_signals() {
    for (number, (kind, count)) in SEGMENTS.into_iter().enumerate() {
        for jump in some(&[FAR_NS as i64, -5_000_400_777, 3_300_000, -(FAR_NS as i64)], number, count) {
            let mut host = Host { base: EPOCH.wrapping_add(FAR_NS) };
            let mut world = world(42, network(kind, count), config().with_bus_shift(true));
            (0..2_500).for_each(|_| host.cycle(&mut world));
            host.base = host.base.wrapping_add_signed(jump);
            (0..250).for_each(|_| host.cycle(&mut world));
            let error = host.error_ns(&world);
            let text = format!("{kind} of {count}, jump of {jump} ns");
            assert!(error.abs() <= 100_000, "{text}: {error} ns");
            let mark = world.mark();
            for _ in 0..if count > 10 { 1_000 } else { 2_000 } {
                host.cycle(&mut world);
                let apart = spread(world.network(), &(0..count).collect::<Vec<_>>());
                assert!(apart <= 300, "{text}: {apart} ns apart");
            }
            let error = host.error_ns(&world);
            assert!(error.abs() <= 20_000, "{text}: {error} ns");
            assert!(!world.saw(mark, |event| matches!(event, Event::SyncWindow { inside: false, .. })), "{text}");
        }
    }
}

/// In OP, no pulse is missing and no two are more than a fraction of the cycle nearer or farther apart than usual;
/// after a stated time they are at their phase in the application's time again. A millisecond of phase takes 3 s at
/// most.
// covers: 7.3, dc-reference, dc-sync
#[test]
fn pulses_go_on_through_a_jump_of_the_application_time_and_reach_their_phase_in_3_s() {
    for (number, (kind, count)) in SEGMENTS.into_iter().take(2).enumerate() {
        for jump in some(&[FAR_NS as i64, -5_000_400_777, 450_000, 1_000_000_000_000], number, count) {
            let config = config().with_bus_shift(true).with_pulse_grid(PulseGrid::FirstApplicationTime);
            let mut host = Host { base: EPOCH };
            let mut world = with_sync0(43, network(kind, count), config, &host);
            let text = format!("{kind} of {count}, jump of {jump} ns");
            let mark = world.mark();
            let mut pulses = Pulses::new(world.network(), 0..count, CYCLE_NS);
            let phase = |pulses: &Pulses, base: u64| {
                let next = pulses.devices()[0].next.expect("it pulses").0;
                next.wrapping_add(base) % CYCLE_NS
            };
            let before = phase(&pulses, host.base);
            host.base = host.base.wrapping_add_signed(jump);
            let mut apart = 0;
            for cycle in 0..4_000 {
                host.cycle(&mut world);
                pulses.observe(world.network());
                apart = apart.max(pulses.apart_ns().expect("all pulse"));
                if cycle == 3_000 {
                    let off = phase(&pulses, host.base) as i64 - before as i64;
                    let off = (off + CYCLE_NS as i64 * 3 / 2).rem_euclid(CYCLE_NS as i64) - CYCLE_NS as i64 / 2;
                    assert!(off.abs() <= 20_000, "{text}: {off} ns from the phase");
                }
            }
            let (worst, fewest) = (pulses.worst_ns(), pulses.fewest());
            println!("{text}: {worst} ns from the cycle at most, {apart} ns apart at most, {fewest} pulses");
            assert!(worst <= 1_000 && fewest >= 3_995 && apart <= 1_000, "{text}: {worst} ns, {apart} ns, {fewest}");
            assert!(world.all_in_op() && world.left_op(mark).is_empty(), "{text}");
        }
    }
}

/// A choice takes effect at any time, also while delays are measured.
// covers: 7.5, dc-reference
#[test]
fn another_reference_is_chosen_during_the_set_up_of_the_clocks() {
    for (kind, count) in [("line", 10), ("tree", 10), ("ring", 10)] {
        for begun in [0, 1, 2, 5, 20, 60] {
            let mut world = world(49, network(kind, count), config());
            world.run_cycles(begun);
            let choice = ReferenceClock::Declared(SubDeviceId(4));
            let position = world.application_mut().choose_reference_clock(choice);
            assert_eq!(position.map(|position| position.0), Some(4), "{kind}, after {begun} cycles");
            lock(&mut world, Duration::from_secs(3));
            let reference = world.application().engine().clocks().iter().position(|clock| clock.is_reference);
            assert_eq!(reference, Some(4), "{kind}, after {begun} cycles");
        }
    }
}

/// While SubDevices wait for the lock, samples against the previous reference are not valid for another one: pulses are
/// together from the first cycle in OP on, measured inside the SubDevices.
// covers: 7.5, dc-reference, dc-sync
#[test]
fn another_reference_is_chosen_while_the_lock_is_awaited() {
    for (kind, count) in [("line", 2), ("tree", 5), ("ring", 2)] {
        for begun in (50..400).step_by(50) {
            let host = Host { base: EPOCH };
            let mut world = World::with(51, network(kind, count), &Options::default(), |scan| {
                let mut declaration = with_clocks(scan, config());
                let signals = || Some(SyncSignals::sync0(CYCLE_NS as u32, 200_000));
                declaration.subdevices.iter_mut().for_each(|subdevice| subdevice.sync = signals());
                declaration
            })
            .expect("it can be activated");
            world.application_mut().exchange_mut().set_clock_datagrams(ClockDatagrams::Called);
            let mut cycles = 0;
            while !world.all_in_op() {
                if cycles == begun {
                    let choice = ReferenceClock::Declared(SubDeviceId(1));
                    world.application_mut().choose_reference_clock(choice);
                }
                call_and_cycle(&host, &mut world);
                cycles += 1;
                assert!(cycles < 8_000, "{kind} of {count}: {}", world.condition());
            }
            let mut pulses = Pulses::new(world.network(), 0..count, CYCLE_NS);
            let mut apart = 0;
            for _ in 0..300 {
                call_and_cycle(&host, &mut world);
                pulses.observe(world.network());
                apart = pulses.apart_ns().expect("all pulse").max(apart);
            }
            let text = format!("{kind} of {count}, chosen after {begun}, in OP after {cycles}");
            assert!(apart <= 1_000, "{text}: {apart} ns apart");
        }
    }
}

/// A cycle with both calls of the second policy.
fn call_and_cycle(host: &Host, world: &mut World) {
    let now = world.application().now();
    let exchange = world.application_mut().exchange_mut();
    exchange.sync_reference(now);
    exchange.sync_clocks();
    host.cycle(world);
}

/// Another reference while pulses run: pulses go on, and all clocks follow the chosen one.
// covers: 7.5, dc-reference
#[test]
fn another_reference_is_chosen_while_pulses_run() {
    for (kind, count) in [("line", 10), ("tree", 10), ("ring", 10), ("ring", 50)] {
        let host = Host { base: EPOCH };
        let mut world = with_sync0(44, network(kind, count), config(), &host);
        let all: Vec<usize> = (0..count).collect();
        let (mark, mut pulses) = (world.mark(), Pulses::new(world.network(), 0..count, CYCLE_NS));
        for chosen in [4, 1, 0] {
            let application = world.application_mut();
            let position = application.choose_reference_clock(ReferenceClock::Declared(SubDeviceId(chosen)));
            assert_eq!(position.map(|position| usize::from(position.0)), Some(chosen), "{kind} of {count}");
            let (mut apart, mut settled) = (0, 0);
            for cycle in 0..1_500 {
                host.cycle(&mut world);
                pulses.observe(world.network());
                let now = spread(world.network(), &all);
                apart = apart.max(now);
                settled = if cycle < 1_000 { 0 } else { settled.max(now) };
            }
            let text = format!("{kind} of {count}, reference {chosen}: {apart} ns apart, then {settled} ns");
            println!("{text}");
            // Clocks upstream of the reference follow the time that the host predicts.
            assert!(apart <= 1_000 && settled <= if chosen == 0 { 200 } else { 1_000 }, "{text}");
            let is = |event: &Event| match event {
                Event::ReferenceClock { position } => position.is_some_and(|at| usize::from(at.0) == chosen),
                _ => false,
            };
            assert!(world.saw(mark, is), "{text}");
        }
        assert!(
            pulses.worst_ns() <= 1_000 && pulses.fewest() >= 4_495,
            "{} ns, {}",
            pulses.worst_ns(),
            pulses.fewest()
        );
        assert!(world.left_op(mark).is_empty() && world.all_in_op());
    }
}

/// DC_SYSTEM_TIME_DIFFERENCE of a device: 0 while no time was written to it.
fn written(world: &World, device: usize) -> bool {
    let controller = &world.network().device(DeviceIndex(device)).controller;
    controller.register(map::DC_SYSTEM_TIME_DIFFERENCE, 4) != [0; 4]
}

/// With the policy of calls nothing is written to a clock that was not called for. Calls in each cycle, or in each
/// fifth one, bring the clocks together, and the reference to the application's time.
// covers: 7.4, dc-reference
#[test]
fn clocks_follow_calls_and_run_free_without() {
    for (number, (kind, count)) in SEGMENTS.into_iter().take(4).enumerate() {
        let every = [1, 5][number % 2];
        let mut world = world(45, network(kind, count), config());
        world.application_mut().exchange_mut().set_clock_datagrams(ClockDatagrams::Called);
        let host = Host { base: EPOCH };
        let (all, text) = ((0..count).collect::<Vec<_>>(), format!("{kind} of {count}, each {every} cycles"));
        (0..500).for_each(|_| host.cycle(&mut world));
        assert!(all.iter().all(|device| !written(&world, *device)), "{text}: without a call");
        // Differences are only read.
        for _ in 0..100 {
            world.application_mut().exchange_mut().monitor_clocks();
            host.cycle(&mut world);
        }
        assert!(all.iter().all(|device| !written(&world, *device)), "{text}: monitored");
        let free = spread(world.network(), &all);
        assert!(count == 1 || free >= 3_000, "{text}: {free} ns");
        let mut run = |reference: bool, cycles: u64| {
            for cycle in 0..cycles {
                let (time, now) = (host.time(&world), world.application().now());
                let exchange = world.application_mut().exchange_mut();
                exchange.set_application_time(time, now);
                if cycle % every == 0 {
                    exchange.sync_clocks();
                    if reference {
                        exchange.sync_reference(now);
                    }
                }
                world.cycle();
            }
            let apart = (0..200).map(|_| {
                world.application_mut().exchange_mut().sync_clocks();
                world.cycle();
                spread(world.network(), &all)
            });
            (apart.max().unwrap_or(0), host.error_ns(&world), written(&world, 0))
        };
        let enough = if every == 1 { 8_000 } else { 16_000 };
        let (apart, _, is_steered) = run(false, enough);
        println!("{text}: {apart} ns apart by calls");
        assert!(apart <= 300 && !is_steered, "{text}: {apart} ns, reference steered {is_steered}");
        let (apart, error, is_steered) = run(true, enough);
        println!("{text}: {apart} ns apart, {error} ns from the application's time by calls");
        assert!(apart <= 500 && error.abs() <= 30_000 && is_steered, "{text}: {apart} ns, {error} ns");
    }
}

/// The reference is not read: it has the time that was written last. The application's time runs 300 ppm faster than
/// the host's, and jumps in the end.
// covers: 7.4, dc-reference
#[test]
fn a_reference_that_alone_is_steered_follows_a_time_that_drifts() {
    for (kind, count) in SEGMENTS.into_iter().take(4) {
        let mut world = world(48, network(kind, count), config());
        world.application_mut().exchange_mut().set_clock_datagrams(ClockDatagrams::Called);
        let mut host = Host { base: EPOCH };
        let mut run = |host: &mut Host, cycles: u64, distributes: bool| {
            for _ in 0..cycles {
                host.base += 300;
                let (time, now) = (host.time(&world), world.application().now());
                let exchange = world.application_mut().exchange_mut();
                exchange.set_application_time(time, now);
                exchange.sync_reference(now);
                if distributes {
                    exchange.sync_clocks();
                }
                world.cycle();
            }
            host.error_ns(&world)
        };
        let error = run(&mut host, 8_000, true);
        assert!(error.abs() <= 30_000, "{kind} of {count}: {error} ns with readings");
        let error = run(&mut host, 8_000, false);
        assert!(error.abs() <= 30_000, "{kind} of {count}: {error} ns without readings");
        host.base += 7_000_000;
        let error = run(&mut host, 8_000, false);
        assert!(error.abs() <= 30_000, "{kind} of {count}: {error} ns after a jump");
    }
}

/// One clock is beyond the range of its control loop. With IgH's limits all SubDevices with SYNC signals go on after
/// 5 s and an event names each; otherwise they stay in SAFEOP.
// covers: 7.3, dc-sync, dc-lock
#[test]
fn unlocked_clocks_are_a_warning_after_5_s_or_a_stay_in_safeop() {
    for (kind, count) in [("line", 10), ("tree", 10), ("ring", 10), ("ring", 50)] {
        let mut descriptions = clocked(count, 50);
        descriptions[count - 1].clock_drift_ppb = 900_000;
        for goes_on in if count == 10 { vec![true, false] } else { vec![true] } {
            let choice = if goes_on { config().as_igh() } else { config().with_lock_limit(Duration::from_secs(5)) };
            let network = wired_as(kind, descriptions.clone());
            let mut world = World::with(46, network, &Options::default(), |scan| {
                let mut declaration = with_clocks(scan, choice);
                for subdevice in declaration.subdevices.iter_mut().take(5) {
                    subdevice.sync = Some(SyncSignals::sync0(CYCLE_NS as u32, 0));
                }
                declaration
            })
            .expect("it can be activated");
            let (mark, text) = (world.beginning(), format!("{kind} of {count}, goes on {goes_on}"));
            world.run_cycles(5_000);
            assert!(!world.all_in_op(), "{text}");
            world.run_cycles(1_500);
            assert_eq!(world.all_in_op(), goes_on, "{text}");
            for subdevice in (0..5).map(SubDeviceId) {
                let warned =
                    |event: &Event| matches!(event, Event::WentOnUnlocked { subdevice: of, .. } if *of == subdevice);
                let failed = |event: &Event| match event {
                    Event::ConfigurationFailed { subdevice: of, .. } => *of == subdevice,
                    _ => false,
                };
                assert_eq!(
                    (world.saw(mark, warned), world.saw(mark, failed)),
                    (goes_on, !goes_on),
                    "{text}, {subdevice:?}"
                );
            }
            assert!(!world.application().engine().clocks_locked(), "{text}");
        }
    }
}

/// The SubDevice whose clock is too far off has SYNC signals itself: it waits once, and is reported once.
// covers: 7.3, dc-sync
#[test]
fn a_subdevice_with_an_unlocked_clock_continues_after_5_s_with_one_warning() {
    let mut descriptions = clocked(4, 50);
    descriptions[3].clock_drift_ppb = 900_000;
    let mut world = World::with(47, wired_as("line", descriptions), &Options::default(), |scan| {
        let mut declaration = with_clocks(scan, config().as_igh());
        declaration.subdevices.iter_mut().for_each(|it| it.sync = Some(SyncSignals::sync0(CYCLE_NS as u32, 0)));
        declaration
    })
    .expect("it can be activated");
    let mark = world.beginning();
    world.run_cycles(6_500);
    assert!(world.all_in_op(), "{:?}", world.events(mark));
    let of_last = |event: &Event| matches!(event, Event::WentOnUnlocked { subdevice: SubDeviceId(3), .. });
    let count = world.events(mark).iter().filter(|timed| of_last(&timed.event)).count();
    assert_eq!(count, 1, "{:?}", world.events(mark));
}

/// The limit of IgH is 10 us: a clock that stays within it, but not within 300 ns, counts as locked, and one beyond is
/// a warning. Differences are read inside the SubDevice.
// covers: 7.2, 7.3, dc-lock
#[test]
fn a_clock_within_10_us_counts_as_locked_with_the_choices_of_igh() {
    let swing = |ppm| Wander { amplitude_ppb: ppm * 1_000, period: Duration::from_millis(50) };
    for (kind, ppm, is_within) in [("line", SWING_PPM, true), ("ring", SWING_PPM, true), ("line", 900, false)] {
        for as_igh in [true, false] {
            let mut descriptions = clocked(4, 0);
            match is_within {
                true => descriptions[3].clock_wander = swing(ppm),
                false => descriptions[3].clock_drift_ppb = ppm * 1_000,
            }
            let choice = if as_igh { config().as_igh() } else { config().with_lock_window_ns(300) };
            let mut world = World::with(48, wired_as(kind, descriptions), &Options::default(), |scan| {
                let mut declaration = with_clocks(scan, choice);
                declaration.subdevices.iter_mut().for_each(|it| it.sync = Some(SyncSignals::sync0(CYCLE_NS as u32, 0)));
                declaration
            })
            .expect("it can be activated");
            let mut worst = Vec::new();
            for _ in 0..if is_within { 30 } else { 65 } {
                let mut most = 0;
                for _ in 0..100 {
                    world.run_cycles(1);
                    let register = world.network().device(DeviceIndex(3)).controller.register(DIFFERENCE, 4);
                    let bytes = [register[0], register[1], register[2], register[3]];
                    most = most.max(u32::from_le_bytes(bytes) & 0x7FFF_FFFF);
                }
                worst.push(most);
            }
            let text = format!("{kind}, {ppm} ppm, as IgH {as_igh}: {worst:?} ns");
            println!("{text}");
            let settled = &worst[5..];
            assert!(
                settled.iter().all(|ns| if is_within { (300..10_000).contains(ns) } else { *ns > 10_000 }),
                "{text}"
            );
            let warned = world.saw(world.beginning(), |event| matches!(event, Event::WentOnUnlocked { .. }));
            assert_eq!(warned, as_igh && !is_within, "{text}");
            assert_eq!(world.all_in_op(), as_igh, "{text}");
            assert_eq!(world.application().engine().clocks_locked(), as_igh && is_within, "{text}");
        }
    }
}
