//! Rings that are broken from the start, break during other procedures, or break twice.

use std::time::Duration;

use ringcat::{Declaration, Event, Options, RingState, Scan, SubDeviceId, automatic};
use ringcat_sim::cable::{CableId, DeviceIndex};
use ringcat_sim::fault::Fault;
use ringcat_sim::network::Network;
use ringcat_sim::time::SimTime;
use ringcat_wire::al::AlStatus;
use scenarios::check::{Delivery, ring_events, troubles};
use scenarios::segments::{SIXTEEN, cable_of_ring, ring_of_16};
use scenarios::world::{CYCLE, World};

const COUNT: u16 = SIXTEEN.len() as u16;
const FAST: Duration = Duration::from_micros(10);

fn broken(cable: usize, detection: Duration) -> Network {
    let mut network = ring_of_16(detection);
    network.cut(CableId(cable));
    network
}

fn break_at(cable: usize) -> (Event, Event) {
    let main = cable as u16;
    let opened = Event::RingOpened { main, redundant: COUNT - main };
    (opened, Event::BreakLocated { cable: cable_of_ring(cable, COUNT.into()) })
}

/// SDOs that take a while to download.
fn with_downloads(scan: &Scan) -> Declaration {
    let mut declaration = automatic(&scan.subdevices, CYCLE);
    for (config, info) in declaration.subdevices.iter_mut().zip(&scan.subdevices) {
        if info.order_code == "analog-input-4" || info.order_code == "analog-output-4" {
            for round in 0..10u16 {
                *config = config.clone().sdo(0x8000, 1, round.to_le_bytes()).sdo(0x8000, 3, *b"sixteen bytes!!!");
            }
        }
    }
    declaration
}

// covers: ring-phases
#[test]
fn a_ring_broken_anywhere_from_the_start_comes_to_op_and_closes_when_healed() {
    for detection in [FAST, Duration::from_millis(1)] {
        for cable in 0..=SIXTEEN.len() {
            let mut world = World::in_op(cable as u64, broken(cable, detection));
            world.run_cycles(100);
            let (opened, located) = break_at(cable);
            let start = world.beginning();
            assert_eq!(world.scan.main_count, cable);
            assert_eq!(ring_events(world.events(start)), [&opened, &located], "cable {cable}");
            assert_eq!(troubles(world.events(start)), Vec::<&Event>::new(), "cable {cable}");
            assert_eq!(world.application().ring(), RingState::Open);
            let mark = world.mark();
            world.heal(CableId(cable));
            world.run_cycles(50);
            let closed = Event::RingClosed { main: COUNT, redundant: 0, place: Some(cable_of_ring(cable, 16)) };
            assert_eq!(ring_events(world.events(mark)), [&closed]);
            assert_eq!(world.left_op(mark), []);
            assert!(world.incomplete(mark) <= 2, "{}", world.incomplete(mark));
            // The next break is located although the scan saw the ring open elsewhere.
            for next in [(cable + 7) % (SIXTEEN.len() + 1), cable] {
                let mark = world.mark();
                world.cut(CableId(next));
                world.run_cycles(50);
                let (opened, located) = break_at(next);
                assert_eq!(ring_events(world.events(mark)), [&opened, &located], "scanned with {cable} cut");
                assert_eq!(world.left_op(mark), []);
                world.heal(CableId(next));
                world.run_cycles(50);
            }
        }
    }
}

#[test]
fn a_subdevice_comes_back_into_a_broken_ring() {
    for (cable, device) in [(5, 12), (5, 2), (0, 7), (16, 7), (8, 8), (8, 7)] {
        let mut world = World::in_op(100 + cable as u64, broken(cable, FAST));
        world.run_cycles(60);
        // Only a SubDevice at the end of a part may leave without cutting others off.
        let mark = world.mark();
        let state = world.network().device(DeviceIndex(device)).al_status();
        assert_eq!(state, AlStatus::new(ringcat_wire::al::AlState::Op));
        world.network_mut().device_mut(DeviceIndex(device)).refuse_transition(
            ringcat_wire::al::AlState::Op,
            ringcat_wire::al::AlStatusCode(0x8001),
            1,
        );
        world.hang(DeviceIndex(device), true);
        world.run_cycles(10);
        world.hang(DeviceIndex(device), false);
        world
            .until(Duration::from_secs(5), "all in OP", |world| world.all_in_op() && world.application().all_settled());
        world.run_cycles(20);
        assert!(world.left_op(mark).iter().all(|left| left.0 == device));
    }
}

// covers: ring-phases
#[test]
fn a_ring_that_breaks_during_scan_or_configuration_comes_to_op() {
    for at_us in (0..90_000).step_by(1_500) {
        for (cable, detection) in [(0, FAST), (6, FAST), (16, FAST), (9, Duration::from_millis(2))] {
            let mut network = ring_of_16(detection);
            network.schedule(SimTime::from_micros(at_us), Fault::Cut(CableId(cable)));
            let mut world = World::with(at_us, network, &Options::default(), with_downloads)
                .unwrap_or_else(|error| panic!("cut at {at_us} us, cable {cable}: {error}"));
            world.settle();
            world.run_cycles(100);
            assert!(world.all_in_op());
            let lost = world.saw(world.beginning(), |event| matches!(event, Event::Lost { .. }));
            assert!(!lost, "no SubDevice is lost by a single break at {at_us} us, cable {cable}");
            let place = world.events(world.beginning()).iter().rfind(|t| matches!(t.event, Event::BreakLocated { .. }));
            assert_eq!(place.map(|timed| &timed.event), Some(&break_at(cable).1), "cut at {at_us} us, cable {cable}");
        }
    }
}

// covers: ring-phases
#[test]
fn a_break_and_its_repair_during_downloads_lose_no_object() {
    for after in [12, 14, 17, 20, 25, 30] {
        let mut world =
            World::with(after, ring_of_16(FAST), &Options::default(), with_downloads).expect("scan and activation");
        world.run_cycles(after);
        let cable = CableId(3 + after as usize % 9);
        world.fault_in(CYCLE / 3, Fault::Cut(cable));
        world.run_cycles(4);
        world.fault_in(CYCLE / 7, Fault::Heal(cable));
        world.settle();
        world.run_cycles(20);
        for device in [3, 7, 14] {
            let dictionary = world.network().device(DeviceIndex(device)).application.dictionary();
            assert_eq!(dictionary.read(0x8000, 1), Ok(9u16.to_le_bytes().as_slice()));
            assert_eq!(dictionary.read(0x8000, 3), Ok(b"sixteen bytes!!!".as_slice()));
        }
        let mut failures = world.events(world.beginning()).iter().filter(|timed| {
            matches!(timed.event, Event::ConfigurationFailed { .. } | Event::StateError { .. } | Event::Lost { .. })
        });
        assert_eq!(failures.next(), None, "a break after {after} cycles is no failure of any SubDevice");
    }
}

// covers: CR-18, ring-phases
#[test]
fn two_breaks_isolate_a_part_which_returns_without_further_losses() {
    for (first, second, isolated) in [(4, 7, 4..7), (10, 3, 3..10), (1, 2, 1..2), (0, 3, 0..3), (13, 16, 13..16)] {
        for gap in [30, 500] {
            let mut world = World::in_op(7, ring_of_16(FAST));
            world.run_cycles(5);
            let mark = world.mark();
            world.cut(CableId(first));
            world.run_cycles(20);
            world.cut(CableId(second));
            world.run_cycles(gap);
            for subdevice in isolated.clone() {
                let lost = |event: &Event| *event == Event::Lost { subdevice: SubDeviceId(subdevice) };
                world.until(Duration::from_millis(60), "all of the piece are lost", |world| world.saw(mark, lost));
            }
            let stale = &world.evaluated(mark).last().expect("cycles went by").stale;
            assert!(stale.iter().all(|left| isolated.contains(left)), "{stale:?}: the others continue");
            let healing = world.mark();
            world.heal(CableId(first));
            world.until(Duration::from_secs(3), "all in OP again", |world| {
                world.all_in_op() && world.application().all_settled()
            });
            world.run_cycles(50);
            world.heal(CableId(second));
            world.run_cycles(50);
            assert_eq!(world.evaluated(mark).last().map(|evaluated| evaluated.delivery), Some(Delivery::Complete));
            let left: Vec<usize> = world.left_op(mark).iter().map(|device| device.0).collect();
            assert!(left.iter().all(|left| isolated.contains(left)), "{left:?} left OP, {isolated:?} were isolated");
            for subdevice in 0..SIXTEEN.len() {
                let lost = |event: &Event| *event == Event::Lost { subdevice: SubDeviceId(subdevice) };
                assert_eq!(world.saw(mark, lost), isolated.contains(&subdevice), "{subdevice}");
                let returned = world
                    .events(healing)
                    .iter()
                    .filter(|timed| timed.event == Event::Returned { subdevice: SubDeviceId(subdevice) });
                assert_eq!(returned.count(), usize::from(isolated.contains(&subdevice)), "{subdevice}");
            }
            let reports = ring_events(world.events(healing));
            let Some(Event::RingClosed { main: COUNT, redundant: 0, place: Some(place) }) = reports.last() else {
                panic!("{reports:?}")
            };
            assert_eq!(*place, cable_of_ring(second, 16));
        }
    }
}

// covers: CR-12, ring-cut
#[test]
fn a_thousand_cycles_with_a_break_are_one_event() {
    let mut world = World::in_op(8, ring_of_16(FAST));
    let mark = world.mark();
    world.cut(CableId(6));
    world.run_cycles(1_000);
    let (opened, located) = break_at(6);
    assert_eq!(ring_events(world.events(mark)), [&opened, &located]);
    assert!(world.incomplete(mark) <= 1);
}
