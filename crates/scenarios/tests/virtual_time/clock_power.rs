//! Clocks that lose their registers with their power, as their pins show it (protocol 7.2, 7.5).

use std::time::Duration;

use ringcat::{Options, SyncSignals};
use ringcat_sim::cable::DeviceIndex;
use scenarios::clocks::{EPOCH, clocked, config, differences, lock, spread, with_clocks};
use scenarios::world::World;

use crate::clock_times::wired_as;

/// Drift of the clocks against each other and the host, in parts per million.
const DRIFT: i64 = 50;
const SEGMENTS: [(&str, usize); 5] = [("line", 1), ("line", 7), ("tree", 10), ("ring", 10), ("ring", 50)];

fn all(count: usize) -> Vec<usize> {
    (0..count).collect()
}

/// A segment with SYNC0 at all SubDevices, which are in OP, and with locked clocks.
fn locked(kind: &str, count: usize) -> World {
    let mut world = World::with(61, wired_as(kind, clocked(count, DRIFT)), &Options::default(), |scan| {
        let mut declaration = with_clocks(scan, config());
        declaration.subdevices.iter_mut().for_each(|it| it.sync = Some(SyncSignals::sync0(1_000_000, 0)));
        declaration
    })
    .expect("it can be activated");
    world.until(Duration::from_secs(6), "all in OP", World::all_in_op);
    lock(&mut world, Duration::from_secs(3));
    world
}

/// System time of a clock minus that of the host.
fn ahead_ns(world: &World, device: usize) -> i64 {
    let network = world.network();
    let time = network.device(DeviceIndex(device)).controller.system_time(network.now());
    time.wrapping_sub(EPOCH).wrapping_sub(network.now().0) as i64
}

/// No clock has kept the system time: the system time continues with the time of the host.
// covers: 7.2, dc-reference
#[test]
fn the_system_time_continues_after_all_subdevices_have_lost_their_power() {
    for (kind, count) in SEGMENTS {
        for (off_ms, apart_ms) in [(40, 0), (400, 0), (40, 3), (40, 120)] {
            let text = format!("{kind} of {count}, {off_ms} ms without power, one each {apart_ms} ms");
            let mut world = locked(kind, count);
            all(count).into_iter().for_each(|device| world.power_off(DeviceIndex(device)));
            world.run_cycles(off_ms);
            let (before, begin) = (ahead_ns(&world, 0), world.network().now().0);
            for device in all(count) {
                world.power_on(DeviceIndex(device));
                world.run_cycles(apart_ms);
            }
            world.until(Duration::from_secs(20), "all in OP again", World::all_in_op);
            world.run_cycles(500);
            let passed = (world.network().now().0 - begin) as i64;
            let change = ahead_ns(&world, 0) - before;
            println!("{text}: {change} ns in {} ms", passed / 1_000_000);
            // Both the clock and the host drift.
            let allowed = passed * 2 * DRIFT / 1_000_000 + 200_000;
            assert!(change.abs() <= allowed, "{text}: {change} ns of {allowed}");
            assert!(
                spread(world.network(), &all(count)) <= 300,
                "{text}: {:?}",
                differences(world.network(), &all(count))
            );
        }
    }
}

/// The others do not follow a clock that begins at its power-on.
// covers: 7.5, dc-reference
#[test]
fn clocks_stay_together_while_their_reference_loses_its_power() {
    for (kind, count) in SEGMENTS.into_iter().filter(|(kind, count)| *kind != "line" && *count > 1) {
        for off_ms in [1, 5, 20, 60] {
            let text = format!("{kind} of {count}, {off_ms} ms without power");
            let mut world = locked(kind, count);
            let others: Vec<usize> = (1..count).collect();
            world.power_off(DeviceIndex(0));
            world.run_cycles(off_ms);
            world.power_on(DeviceIndex(0));
            let mut largest = 0;
            for _ in 0..3_000 {
                world.cycle();
                // A clock that frames reach on another path than before is off by the delay of that path.
                largest = largest.max(ahead_ns(&world, 1).abs().max(ahead_ns(&world, count - 1).abs()));
            }
            assert!(largest <= 1_000_000, "{text}: {largest} ns from the time of the host");
            world.until(Duration::from_secs(10), "all in OP again", World::all_in_op);
            world.run_cycles(1_000);
            let apart = spread(world.network(), &others).max(spread(world.network(), &all(count)));
            assert!(apart <= 300, "{text}: {:?}", differences(world.network(), &all(count)));
        }
    }
}
