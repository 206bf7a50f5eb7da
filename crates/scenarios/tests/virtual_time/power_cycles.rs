//! SubDevices that lose their power and come back: with their whole configuration, while the others stay in OP.

use std::time::Duration;

use ringcat::{Declaration, Event, Options, Scan, SubDeviceId, Watchdog, automatic};
use ringcat_engine::info::Direction;
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::al::{AlState, AlStatus};
use ringcat_wire::register::map;
use scenarios::check::{Delivery, ring_events, troubles};
use scenarios::segments::{SIXTEEN, descriptions, line, ring_of_16};
use scenarios::world::{CYCLE, Mark, World};

/// Edges of a power cycle in a ring: two breaks and two repairs.
const EDGES: usize = 4;

/// All SubDevices as found, with application SDOs and a watchdog time for those with a CoE mailbox.
fn with_own_settings(scan: &Scan) -> Declaration {
    let mut declaration = automatic(&scan.subdevices, CYCLE);
    for (config, info) in declaration.subdevices.iter_mut().zip(&scan.subdevices) {
        let declared = config.clone();
        *config = match info.order_code.as_str() {
            "servo" => declared.sdo(0x6065, 0, 4711u32.to_le_bytes()),
            "analog-input-4" => declared.sdo(0x8000, 1, 77u16.to_le_bytes()).sdo(0x8000, 3, *b"sixteen bytes!!!"),
            "digital-output-8" => declared.watchdog(None, Some(500)).sync_manager(0, Direction::Outputs, Watchdog::On),
            _ => declared,
        };
    }
    declaration
}

fn world(seed: u64, network: Network) -> World {
    let mut world = World::with(seed, network, &Options::default(), with_own_settings).expect("scan and activation");
    world.settle();
    world
}

/// Configuration registers of a device.
fn configuration(world: &World, device: DeviceIndex) -> (Vec<u8>, Vec<u8>, Vec<Vec<u8>>) {
    let device = world.network().device(device);
    let controller = &device.controller;
    let mut registers = controller.register(map::STATION_ADDRESS, 2).to_vec();
    registers.extend_from_slice(controller.register(map::WATCHDOG_TIME_PROCESS_DATA, 2));
    registers.extend_from_slice(controller.register(map::FMMU_BASE, 48));
    let sync_managers = (0..4).flat_map(|n| controller.register(map::sync_manager(n), 5).to_vec()).collect();
    let objects = [(0x6065, 0), (0x8000, 1), (0x8000, 3)];
    let dictionary = device.application.dictionary();
    let values = objects.iter().filter_map(|(index, sub)| Some(dictionary.read(*index, *sub).ok()?.to_vec())).collect();
    (registers, sync_managers, values)
}

/// Switches a device off and on and waits until it is back. Returns the cycles with missing data of other devices.
fn power_cycle(world: &mut World, device: DeviceIndex, off: u64, phase: u32) -> usize {
    let mark = world.mark();
    let before = configuration(world, device);
    world.fault_in(CYCLE * phase / 1000, ringcat_sim::fault::Fault::PowerOff(device));
    world.run_cycles(off);
    world.fault_in(CYCLE * phase / 1000, ringcat_sim::fault::Fault::PowerOn(device));
    world.run_cycles(1);
    world.until(Duration::from_secs(2), "back in OP", |world| {
        world.all_in_op() && world.application().all_settled() && last(world, mark) == Some(Delivery::Complete)
    });
    world.run_cycles(20);
    assert_eq!(world.left_op(mark).into_iter().filter(|left| *left != device).count(), 0, "the others stay in OP");
    assert_eq!(configuration(world, device), before, "the whole configuration is back");
    assert_eq!(world.network().device(device).al_status(), AlStatus::new(AlState::Op));
    assert_trouble(world, mark, device.0);
    world.incomplete(mark)
}

fn last(world: &World, since: Mark) -> Option<Delivery> {
    world.evaluated(since).last().map(|evaluated| evaluated.delivery)
}

/// Lost once, returned once, nothing else.
fn assert_trouble(world: &World, since: Mark, subdevice: usize) {
    let expected =
        [Event::Lost { subdevice: SubDeviceId(subdevice) }, Event::Returned { subdevice: SubDeviceId(subdevice) }];
    assert_eq!(troubles(world.events(since)), expected.iter().collect::<Vec<_>>());
}

// covers: recovery
#[test]
fn a_power_cycle_in_a_ring_costs_the_others_at_most_four_edges() {
    let mut world = world(1, ring_of_16(Duration::from_micros(10)));
    let mut worst = 0;
    for (device, kind) in SIXTEEN.iter().enumerate() {
        for phase in [0, 10, 40, 500] {
            let incomplete = power_cycle(&mut world, DeviceIndex(device), 60, phase);
            println!("{kind:>20} off and on, {phase:>3} thousandths into the cycle: {incomplete} incomplete cycles");
            assert!(incomplete <= EDGES, "{incomplete} incomplete cycles, {EDGES} edges");
            worst = worst.max(incomplete);
        }
    }
    println!("ring of 16, one SubDevice off and on: at most {worst} cycles that missed another one ({EDGES} allowed)");
}

#[test]
fn a_power_cycle_in_a_ring_costs_no_more_than_its_edges_with_slow_detection_too() {
    for (detection, per_edge) in [(1_000, 3), (20_000, 22)] {
        let mut world = world(2, ring_of_16(Duration::from_micros(detection)));
        for device in [0, 4, 9, 15] {
            let incomplete = power_cycle(&mut world, DeviceIndex(device), 150, 300);
            println!("device {device} off and on, detection {detection} us: {incomplete} incomplete cycles");
            assert!(incomplete <= EDGES * per_edge, "{incomplete}");
        }
    }
}

#[test]
fn a_short_power_interruption_is_followed_by_a_new_configuration() {
    let mut world = world(3, ring_of_16(Duration::from_micros(10)));
    for device in [2, 4, 9] {
        let incomplete = power_cycle(&mut world, DeviceIndex(device), 1, 200);
        assert!(incomplete <= EDGES, "{incomplete}");
    }
}

// covers: recovery
#[test]
fn the_last_subdevice_of_a_line_comes_back_while_the_others_stay_in_op() {
    let kinds = ["coupler", "digital-input-8", "digital-output-8", "servo"];
    let mut world = world(4, line(descriptions(&kinds), NetworkOptions::default()));
    let incomplete = power_cycle(&mut world, DeviceIndex(3), 60, 100);
    println!("last of a line off and on: {incomplete} incomplete cycles");
    assert_eq!(ring_events(world.events(world.beginning())), Vec::<&Event>::new(), "a line is not a broken ring");
    assert!(incomplete <= EDGES, "{incomplete}");
}

#[test]
fn a_subdevice_that_loses_power_while_it_is_being_configured_comes_back_too() {
    for after in [2, 5, 9, 14, 20] {
        let mut world = world(5, ring_of_16(Duration::from_micros(10)));
        let device = DeviceIndex(4);
        let mark = world.mark();
        world.power_off(device);
        world.run_cycles(30);
        world.power_on(device);
        world.run_cycles(after);
        world.power_off(device);
        world.run_cycles(30);
        world.power_on(device);
        world.until(Duration::from_secs(2), "back in OP", |world| {
            world.all_in_op() && world.application().all_settled()
        });
        world.run_cycles(20);
        assert_eq!(last(&world, mark), Some(Delivery::Complete));
        assert!(world.left_op(mark).iter().all(|left| *left == device));
        assert!(!world.saw(mark, |event| matches!(event, Event::Unexpected { .. })), "it is known");
    }
}

// covers: recovery
#[test]
fn two_neighbours_of_a_ring_come_back_from_a_power_cycle_together() {
    let mut world = world(6, ring_of_16(Duration::from_micros(10)));
    for (one, other) in [(2, 3), (8, 9), (14, 15)] {
        let mark = world.mark();
        world.power_off(DeviceIndex(one));
        world.power_off(DeviceIndex(other));
        world.run_cycles(40);
        world.power_on(DeviceIndex(other));
        world.run_cycles(10);
        world.power_on(DeviceIndex(one));
        world.until(Duration::from_secs(2), "back in OP", |world| {
            world.all_in_op() && world.application().all_settled()
        });
        world.run_cycles(20);
        assert_eq!(last(&world, mark), Some(Delivery::Complete));
        assert!(world.left_op(mark).iter().all(|left| [one, other].contains(&left.0)), "{:?}", world.left_op(mark));
    }
}
