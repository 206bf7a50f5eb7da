//! Segments of more than 255 SubDevices: 300 and 1,000 of all kinds, on one link and in a ring, from power-on to OP and
//! through breaks.

use std::time::Duration;

use ringcat::{ClockConfig, Event, Options, RingState, SubDeviceId, automatic};
use ringcat_sim::cable::{CableId, DeviceIndex};
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::address::StationAddress;
use scenarios::check::{Delivery, ring_events, troubles};
use scenarios::segments::{cable_of_ring, descriptions, line, ring};
use scenarios::world::World;

/// A round trip through a thousand takes longer than half a millisecond.
const CYCLE: Duration = Duration::from_millis(2);
const KINDS: [&str; 8] = [
    "digital-output-8",
    "digital-input-8",
    "emulated-output-8",
    "coupler",
    "digital-input-16",
    "servo",
    "emulated-input-8",
    "digital-output-16",
];
const COUNTS: [usize; 2] = [300, 1_000];

fn segment(count: usize, is_ring: bool) -> Network {
    let kinds: Vec<&str> = KINDS.into_iter().cycle().take(count).collect();
    let build = if is_ring { ring } else { line };
    build(descriptions(&kinds), NetworkOptions::default())
}

fn in_op(count: usize, is_ring: bool) -> World {
    declared(segment(count, is_ring), false)
}

/// From power-on to OP, also with clocks or in a ring that is broken.
fn declared(network: Network, clocks: bool) -> World {
    let declare = |scan: &ringcat::Scan| {
        let clocks = clocks.then(ClockConfig::default);
        automatic(&scan.subdevices, CYCLE).with_clocks(clocks)
    };
    let mut world = World::with(7, network, &Options::default(), declare).expect("it fits");
    // Inputs of a drive that reaches OP change while frames are under way.
    world.evaluate_latched(false);
    world.settle();
    world.evaluate_latched(true);
    world
}

fn is_complete(world: &World) -> bool {
    world.evaluated(world.beginning()).last().is_some_and(|evaluated| evaluated.delivery == Delivery::Complete)
}

// covers: large-segments
#[test]
fn segments_of_300_and_1000_come_to_op_with_all_their_process_data() {
    for count in COUNTS {
        for is_ring in [false, true] {
            let mut world = in_op(count, is_ring);
            let what = format!("{count}, ring {is_ring}");
            assert_eq!((world.scan.subdevices.len(), world.scan.main_count), (count, count), "{what}");
            for (position, info) in world.scan.subdevices.iter().enumerate() {
                let station = StationAddress(0x1001 + position as u16);
                assert_eq!((usize::from(info.position.0), info.station), (position, station), "{what}");
                assert_eq!(world.device_of(position), Some(DeviceIndex(position)), "{what}");
            }
            let mark = world.mark();
            let before = world.compared();
            world.run_cycles(50);
            assert!(world.all_in_op(), "{what}");
            assert_eq!((world.incomplete(mark), world.left_op(mark)), (0, vec![]), "{what}");
            assert!(world.compared() > before + 50 * count as u64 / 2, "{what}");
            let links = world.application().ring_status().links;
            assert_eq!(usize::from(links[0].answering), count, "{what}");
            assert_eq!(troubles(world.events(world.beginning())), Vec::<&Event>::new(), "{what}");
        }
    }
}

// covers: large-segments
#[test]
fn breaks_at_both_sides_of_position_255_keep_all_inputs_and_have_their_places() {
    for count in COUNTS {
        let mut world = in_op(count, true);
        for cable in [0, 1, 255, 256, 257, count - 256, count - 1, count] {
            let mark = world.mark();
            world.cut(CableId(cable));
            world.run_cycles(60);
            let what = format!("{count}, cable {cable}");
            assert!(is_complete(&world), "{what}");
            let links = world.application().ring_status().links;
            assert_eq!(links.map(|link| usize::from(link.answering)), [cable, count - cable], "{what}");
            let reports = ring_events(world.events(mark));
            let place = reports.iter().find_map(|event| match event {
                Event::BreakLocated { cable } => Some(*cable),
                _ => None,
            });
            assert_eq!(place, Some(cable_of_ring(cable, count)), "{what}");
            world.heal(CableId(cable));
            world.run_cycles(60);
            assert_eq!(world.application().ring(), RingState::Closed, "{what}");
            assert!(is_complete(&world) && world.left_op(mark).is_empty(), "{what}");
            assert_eq!(troubles(world.events(mark)), Vec::<&Event>::new(), "{what}");
        }
    }
}

// covers: large-segments
#[test]
fn a_subdevice_behind_position_255_that_loses_its_power_comes_back() {
    for is_ring in [false, true] {
        let mut world = in_op(300, is_ring);
        for device in [254, 255, 256, 299] {
            let mark = world.mark();
            world.power_off(DeviceIndex(device));
            world.run_cycles(40);
            let lost = |event: &Event| matches!(event, Event::Lost { subdevice } if *subdevice == SubDeviceId(device));
            assert!(world.saw(mark, lost), "{device}");
            world.power_on(DeviceIndex(device));
            world.until(Duration::from_secs(5), "all in OP", |world| world.all_in_op() && is_complete(world));
        }
    }
}

// covers: large-segments
#[test]
fn a_ring_broken_from_the_start_comes_to_op_with_more_than_255_per_side() {
    for (count, cable) in [(300, 20), (300, 280), (1_000, 256), (1_000, 744)] {
        let mut network = segment(count, true);
        network.advance_by(Duration::from_millis(10));
        network.cut(CableId(cable));
        let mut world = declared(network, false);
        assert_eq!((world.scan.main_count, world.scan.redundant_count), (cable, count - cable));
        let mark = world.mark();
        world.run_cycles(20);
        assert!(world.all_in_op() && world.incomplete(mark) == 0, "{count}, cable {cable}");
        let of = |position| world.device_of(position);
        assert!((0..count).all(|position| of(position) == Some(DeviceIndex(position))), "{count}, cable {cable}");
    }
}

// covers: large-segments
#[test]
fn clocks_of_300_in_a_line_and_in_a_ring_lock() {
    for is_ring in [false, true] {
        let mut world = declared(segment(300, is_ring), true);
        world.until(Duration::from_secs(5), "locked", |world| world.application().engine().clocks_locked());
        assert!(world.all_in_op());
        assert_eq!(troubles(world.events(world.beginning())), Vec::<&Event>::new());
    }
}
