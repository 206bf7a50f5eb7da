//! Rings in which SubDevices are plugged in the wrong way round, all of them where the two interfaces are swapped: what is
//! told of them and of their breaks (facts 9.5, CR-12).

use std::collections::BTreeMap;
use std::time::Duration;

use ringcat::{Cable, Event, PortOf, RingState};
use ringcat_sim::cable::{CableId, Endpoint};
use ringcat_sim::frame::Port;
use scenarios::check::ring_events;
use scenarios::segments::{MAIN, REDUNDANT, at, wired};
use scenarios::world::World;

const KINDS: [&str; 4] = ["coupler", "digital-output-8", "servo", "digital-input-8"];
const COUNT: usize = KINDS.len();
const ALL: usize = (1 << COUNT) - 1;

/// A ring of four, of which those in `crossed` (a bit each) are plugged in the wrong way round.
fn cables(crossed: usize) -> Vec<(Endpoint, Endpoint)> {
    let ports = |device: usize| if crossed >> device & 1 == 1 { (Port::B, Port::A) } else { (Port::A, Port::B) };
    let begin = |device: usize| if device == COUNT { REDUNDANT } else { at(device, ports(device).0) };
    let end = |device: usize| at(device, ports(device).1);
    (0..=COUNT).map(|number| (if number == 0 { MAIN } else { end(number - 1) }, begin(number))).collect()
}

/// The ends of a cable, interfaces by their names.
type Ends = Vec<Result<PortOf, &'static str>>;

fn ends(cable: Cable) -> Ends {
    let mut ends = vec![cable.near.ok_or("MAIN"), cable.far.ok_or("REDUNDANT")];
    ends.sort();
    ends
}

/// How a cable is plugged in, with positions of the scan.
fn plugged(world: &World, cable: (Endpoint, Endpoint)) -> Ends {
    let end = |end: Endpoint| match end {
        Endpoint::Device(device, port) => {
            let node = (0..COUNT).find(|position| world.device_of(*position) == Some(device)).expect("it was scanned");
            Ok(PortOf { node, port: port.index() as u8 })
        }
        other => Err(if other == MAIN { "MAIN" } else { "REDUNDANT" }),
    };
    let mut ends = vec![end(cable.0), end(cable.1)];
    ends.sort();
    ends
}

fn places(events: &[&Event]) -> Vec<Ends> {
    let place = |event: &&Event| match event {
        Event::BreakLocated { cable } => Some(ends(*cable)),
        _ => None,
    };
    events.iter().filter_map(place).collect()
}

/// How often each crossing was told, and that the interfaces are swapped.
fn crossings_told(world: &World) -> (BTreeMap<Option<usize>, usize>, usize) {
    let (mut crossed, mut swapped) = (BTreeMap::new(), 0);
    for timed in world.events(world.beginning()) {
        match &timed.event {
            Event::LineCrossed { position, .. } => {
                let device = position.and_then(|it| Some(world.device_of(usize::from(it.0))?.0));
                *crossed.entry(device).or_insert(0) += 1;
            }
            Event::InterfacesSwapped => swapped += 1,
            _ => {}
        }
    }
    (crossed, swapped)
}

#[test]
fn breaks_of_a_ring_with_any_crossed_subdevices_have_their_right_place_and_each_is_told_once_cr_12_lc_01_lc_07() {
    for crossed in 0..=ALL {
        let cables = cables(crossed);
        let mut world = World::in_op(crossed as u64, wired(&KINDS, &cables));
        assert_eq!(world.application().ring(), RingState::Closed);
        for (number, cable) in cables.iter().enumerate() {
            let what = format!("crossed {crossed:04b}, cable {number}");
            let expected = plugged(&world, *cable);
            let mark = world.mark();
            world.cut(CableId(number));
            world.run_cycles(60);
            let told = ring_events(world.events(mark));
            assert_eq!((places(&told), told.len()), (vec![expected.clone()], 2), "{what}: {told:?}");
            assert_eq!(world.application().ring_status().place.map(ends), Some(expected), "{what}");
            let mark = world.mark();
            world.heal(CableId(number));
            world.run_cycles(60);
            let told = ring_events(world.events(mark));
            let [Event::RingClosed { place, .. }] = told[..] else { panic!("{what}: {told:?}") };
            assert_eq!(place.map(ends), Some(plugged(&world, *cable)), "{what}");
        }
        let (told, swapped) = crossings_told(&world);
        assert!(told.values().all(|times| *times == 1), "crossed {crossed:04b}: {told:?}");
        let named: usize = told.keys().flatten().map(|device| 1 << device).sum();
        // Each of them is named once the ring has been open; that all are is one fact.
        let expected = if crossed == ALL { (0, 1) } else { (crossed, 0) };
        assert_eq!((named, swapped), expected, "crossed {crossed:04b}: {told:?}");
    }
}

#[test]
fn a_ring_with_crossed_subdevices_that_is_broken_from_the_start_is_told_as_it_is_cr_19_lc_05() {
    for crossed in 0..=ALL {
        let cables = cables(crossed);
        for (number, cable) in cables.iter().enumerate() {
            let mut network = wired(&KINDS, &cables);
            network.advance_by(Duration::from_millis(10));
            network.cut(CableId(number));
            let mut world = World::in_op(crossed as u64, network);
            world.run_cycles(30);
            let what = format!("crossed {crossed:04b}, cable {number}");
            let told = ring_events(world.events(world.beginning()));
            assert_eq!(places(&told), [plugged(&world, *cable)], "{what}: {told:?}");
            let (told, swapped) = crossings_told(&world);
            assert!(told.values().all(|times| *times == 1), "{what}: {told:?}");
            let named: usize = told.keys().flatten().map(|device| 1 << device).sum();
            assert_eq!((named, swapped), if crossed == ALL { (0, 1) } else { (crossed, 0) }, "{what}: {told:?}");
        }
    }
}
