//! Distributed clocks with a host that sends tens of microseconds late at random: a reference that loses its power
//! comes back to OP, and SYNC0 stays synchronous while cables of a ring are cut and repaired (protocol 7.2, 7.3, 7.5).

use std::time::Duration;

use ringcat::{Event, Options, ReferenceClock, SubDeviceId, SyncSignals, automatic};
use ringcat_sim::cable::{CableId, DeviceIndex};
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::al::AlState;
use scenarios::clocks::{clocked, config, spread, watch, with_clocks};
use scenarios::segments::{line, ring};
use scenarios::world::{Mark, World};

/// All SubDevices in OP with SYNC0, on a host with this sending delay; two seconds later.
fn world(seed: u64, network: Network, late: Duration) -> World {
    let mut world = World::with(seed, network, &Options::default(), |scan| {
        let mut declaration = with_clocks(scan, config());
        declaration.subdevices.iter_mut().for_each(|config| config.sync = Some(SyncSignals::sync0(1_000_000, 0)));
        declaration
    })
    .expect("it can be activated");
    world.application_mut().links_mut().send_late(late);
    world.until(Duration::from_secs(10), "all in OP", World::all_in_op);
    world.run_cycles(2_000);
    world
}

fn window_events(world: &World, since: Mark) -> usize {
    world.events(since).iter().filter(|timed| matches!(timed.event, Event::SyncWindow { .. })).count()
}

// covers: 7.2, dc-late-host
#[test]
fn a_reference_that_was_power_cycled_is_back_in_op_within_5_s_at_any_host_jitter() {
    const COUNT: usize = 6;
    let (clocks, others): (Vec<usize>, Vec<usize>) = ((0..COUNT).collect(), (1..COUNT).collect());
    for (late_us, closed) in [(0, false), (5, false), (20, false), (50, false), (5, true), (50, true)] {
        let descriptions = clocked(COUNT, 50);
        let options = NetworkOptions::default();
        let network = if closed { ring(descriptions, options) } else { line(descriptions, options) };
        let mut world = world(31, network, Duration::from_micros(late_us));
        let text = format!("{late_us} us late, ring {closed}");
        let mark = world.mark();
        world.power_off(DeviceIndex(0));
        world.run_cycles(500);
        world.power_on(DeviceIndex(0));
        let begin = world.now();
        world.run_cycles(200);
        world
            .until(Duration::from_millis(4_800), &text, |world| world.all_in_op() && world.application().all_settled());
        let back = world.now() - begin;
        let [apart, apart_others] = watch(&mut world, [&clocks, &others], 3_000);
        let reports = window_events(&world, mark);
        println!("{text}: back after {} ms, {apart} ns apart, {reports} times reported", back.as_millis());
        // Clocks behind the reference are exact; the clock upstream of it receives the host's prediction.
        assert!(apart <= 1_000 && reports <= 6, "{text}: {apart} ns apart, {reports} times reported");
        assert!(closed || apart_others <= 100, "{text}: {apart_others} ns");
    }
}

// covers: 7.5, dc-late-host
#[test]
fn sync0_stays_synchronous_through_cuts_with_a_host_50_us_late() {
    const COUNT: usize = 8;
    let network = || ring(clocked(COUNT, 50), NetworkOptions::default());
    let clocks: Vec<usize> = (0..COUNT).collect();
    for (seed, cables) in [(41, [0, 3, 6]), (42, [1, 5, 8])] {
        let mut world = world(seed, network(), Duration::from_micros(50));
        let mark = world.mark();
        for cable in cables {
            let (front, behind): (Vec<usize>, Vec<usize>) = ((0..cable).collect(), (cable..COUNT).collect());
            world.cut(CableId(cable));
            let [first, second, across] = watch(&mut world, [&front, &behind, &clocks], 6_000);
            world.heal(CableId(cable));
            let [first_after, second_after, after] = watch(&mut world, [&front, &behind, &clocks], 2_000);
            let inside = [first, second, first_after, second_after].into_iter().max().unwrap_or(0);
            let across = across.max(after);
            println!("cable {cable}: {inside} ns inside a part, {across} ns across");
            assert!(inside <= 1_000 && across <= 5_000, "cable {cable}: {inside} ns inside, {across} ns across");
            assert!(spread(world.network(), &clocks) <= 200, "cable {cable}");
        }
        assert!(window_events(&world, mark) <= 16, "{}", window_events(&world, mark));
        assert_eq!(world.left_op(mark), []);
    }
}

/// The sender is on average 200 us late: clocks upstream of the reference follow the estimate of the host, and do not
/// lock. Without SYNC signals no SubDevice waits for them, and the other clocks are as exact as before; with SYNC
/// signals these SubDevices wait in SAFEOP.
// covers: 7.2, 7.3, dc-late-host
#[test]
fn a_clock_without_sync_upstream_of_the_reference_delays_no_subdevice() {
    for (count, reference, closed) in [(3, 1, false), (3, 1, true), (12, 1, false), (12, 5, false), (12, 5, true)] {
        for front_has_sync in [false, true] {
            let text = format!("reference {reference} of {count}, ring {closed}, SYNC in front {front_has_sync}");
            let descriptions = clocked(count, 50);
            let options = NetworkOptions::default();
            let network = if closed { ring(descriptions, options) } else { line(descriptions, options) };
            let mut world = World::with(51, network, &Options::default(), |scan| {
                let chosen = config().with_reference(ReferenceClock::Declared(SubDeviceId(reference)));
                let mut declaration = with_clocks(scan, chosen);
                for subdevice in declaration.subdevices.iter_mut().skip(if front_has_sync { 0 } else { reference }) {
                    subdevice.sync = Some(SyncSignals::sync0(1_000_000, 0));
                }
                declaration
            })
            .expect("it can be activated");
            world.application_mut().links_mut().send_late(Duration::from_micros(400));
            if front_has_sync {
                world.run_cycles(10_000);
                assert!(!world.all_in_op(), "{text}: clocks in front locked at this delay");
                assert_eq!(world.network().device(DeviceIndex(0)).al_status().state, AlState::SafeOp.code(), "{text}");
                continue;
            }
            // 15,000 distributions before the lock, each with such a delay.
            world.until(Duration::from_secs(15), &text, World::all_in_op);
            let engine = world.application().engine();
            assert!(engine.clocks_locked(), "{text}");
            let required: Vec<bool> = engine.clocks().iter().map(|clock| clock.is_required).collect();
            assert_eq!(required, (0..count).map(|at| at >= reference).collect::<Vec<_>>(), "{text}");
            let mark = world.mark();
            let behind: Vec<usize> = (reference..count).collect();
            let [apart] = watch(&mut world, [&behind], 3_000);
            assert!(apart <= 100, "{text}: {apart} ns apart");
            assert_eq!((window_events(&world, mark), world.left_op(mark)), (0, Vec::new()), "{text}");
            // The clock of a SubDevice that does not answer is required all the same: it is not shown as unused.
            world.power_off(DeviceIndex(count - 1));
            world.run_cycles(100);
            let clocks = world.application().engine().clocks();
            assert!(clocks[count - 1].is_required && !clocks[0].is_required, "{text}: {clocks:?}");
        }
    }
}

/// SubDevices with SYNC signals upstream of the reference follow its predicted time: the prediction has the rate of the
/// reference, so that they lock and are as exact as those behind, whatever the cycle.
// covers: 7.2, 7.3, dc-reference
#[test]
fn clocks_upstream_of_the_reference_lock_and_are_exact_in_short_and_long_cycles() {
    // Clocks that differ by 190 ppm swing around the prediction (docs/dc.md, "What drift does to the loop").
    for (count, ppm, cycle_us) in [(2, 50, 1_000), (3, 50, 1_000), (10, 50, 250), (10, 50, 4_000), (3, 50, 4_000)] {
        for closed in [false, true] {
            let text = format!("{count} of {ppm} ppm, ring {closed}, each {cycle_us} us");
            let (descriptions, options) = (clocked(count, ppm), NetworkOptions::default());
            let network = if closed { ring(descriptions, options) } else { line(descriptions, options) };
            let cycle = Duration::from_micros(cycle_us);
            let mut world = World::with(52, network, &Options::default(), |scan| {
                let chosen = config().with_reference(ReferenceClock::Declared(SubDeviceId(count - 1)));
                let mut declaration = automatic(&scan.subdevices, cycle).with_clocks(chosen);
                let signals = Some(SyncSignals::sync0(cycle_us as u32 * 1_000, 0));
                declaration.subdevices.iter_mut().for_each(|subdevice| subdevice.sync = signals);
                declaration
            })
            .expect("it can be activated");
            world.until(Duration::from_secs(4), &text, World::all_in_op);
            let (in_op, all) = (world.now(), (0..count).collect::<Vec<_>>());
            world.run_cycles(2_000_000 / cycle_us);
            let [apart] = watch(&mut world, [&all], 2_000_000 / cycle_us);
            println!("{text}: in OP after {} ms, {apart} ns apart", in_op.0 / 1_000_000);
            assert!(apart <= 100, "{text}: {apart} ns apart");
        }
    }
}
