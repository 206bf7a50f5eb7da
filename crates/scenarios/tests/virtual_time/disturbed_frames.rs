//! Own and foreign frames that are dropped, duplicated, corrupted and delayed.

use std::time::Duration;

use ringcat::{Declaration, DomainId, Event, Link, Options, Scan, automatic};
use ringcat_sim::cable::{CableId, Direction};
use ringcat_sim::fault::Fault;
use ringcat_sim::network::NetworkOptions;
use ringcat_wire::address::RegisterAddress;
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::frame::{FrameBuilder, MacAddress};
use scenarios::check::{Delivery, troubles};
use scenarios::segments::{SIXTEEN, descriptions, line, ring_of_16};
use scenarios::world::{CYCLE, World};

const FAST: Duration = Duration::from_micros(10);
const OTHER: MacAddress = MacAddress([0x00, 0x00, 0x5E, 0x00, 0x53, 0x77]);

// covers: lost-frames
#[test]
fn one_lost_frame_costs_one_cycle_and_one_corrupt_frame_no_more() {
    for ring in [true, false] {
        let network = if ring { ring_of_16(FAST) } else { line(descriptions(&SIXTEEN), NetworkOptions::default()) };
        let mut world = World::in_op(1, network);
        for cable in 0..SIXTEEN.len() {
            for corrupt in [false, true] {
                let mark = world.mark();
                let (cable, direction, count) = (CableId(cable), Some(Direction::AToB), 1);
                world.fault(match corrupt {
                    true => Fault::Corrupt { cable, direction, count },
                    false => Fault::Drop { cable, direction, count },
                });
                world.run_cycles(30);
                assert_eq!(world.incomplete(mark), 1, "cable {}, corrupt: {corrupt}", cable.0);
                assert_eq!(world.left_op(mark), []);
                assert_eq!(troubles(world.events(mark)), Vec::<&Event>::new());
            }
        }
    }
}

#[test]
fn in_a_closed_ring_the_unprocessed_copy_is_not_missed() {
    let mut world = World::in_op(2, ring_of_16(FAST));
    for cable in 0..=SIXTEEN.len() {
        let mark = world.mark();
        world.fault(Fault::Drop { cable: CableId(cable), direction: Some(Direction::BToA), count: 3 });
        world.run_cycles(10);
        // The main copy is dropped on the cable to the redundant link.
        let last = cable == SIXTEEN.len();
        assert!(world.incomplete(mark) <= usize::from(last) * 3, "cable {cable}: {}", world.incomplete(mark));
    }
    assert!(world.application().cyclic_counters().copies_lost > 0);
}

// covers: CR-04, CR-07, lost-frames
#[test]
fn a_late_or_duplicated_frame_is_counted_and_never_treated_as_new() {
    // Up to 600 ms: more than 256 frames, after which frame ids are reused.
    let delays_us = [100, 500, 740, 760, 990, 1_000, 1_010, 1_500, 2_000, 5_000, 127_000, 255_950, 256_000, 512_000];
    for (seed, delay_us) in (0..).zip(delays_us) {
        let mut world = World::in_op(seed, ring_of_16(FAST));
        // Devices that process a late frame take its outputs.
        world.evaluate_latched(false);
        for cable in [0, 7, 16] {
            for direction in [Direction::AToB, Direction::BToA] {
                let mark = world.mark();
                let late = world.application().cyclic_counters().late;
                let outdated = world.application().links().outdated();
                let by = Duration::from_micros(delay_us);
                world.fault(Fault::Delay { cable: CableId(cable), direction: Some(direction), count: 1, by });
                world.run_cycles(delay_us / 1_000 + 20);
                let counters = world.application().cyclic_counters();
                let expected = world.application().links().outdated() - outdated;
                assert_eq!(counters.late - late, expected, "delay of {delay_us} us");
                assert_eq!(expected, u64::from(delay_us >= 920), "one copy is late by {delay_us} us");
                assert!(world.incomplete(mark) <= 1);
                assert_eq!(world.left_op(mark), []);
            }
        }
        let late = world.application().cyclic_counters().late;
        world.fault(Fault::Duplicate { cable: CableId(5), direction: None, count: 10 });
        world.run_cycles(20);
        assert_eq!(world.application().cyclic_counters().late, world.application().links().outdated());
        assert!(world.application().cyclic_counters().late > late);
    }
}

/// One domain that waits for its frames for five cycles.
fn patient(world: &mut World) {
    world.application_mut().exchange_mut().set_timeout(DomainId(0), 5 * CYCLE);
}

// covers: lost-frames
#[test]
fn a_domain_with_frames_under_way_is_skipped_and_counted() {
    let mut world = World::in_op(3, line(descriptions(&SIXTEEN), NetworkOptions::default()));
    patient(&mut world);
    world.run_cycles(5);
    world.evaluate_latched(false);
    let mark = world.mark();
    let by = 3 * CYCLE + CYCLE / 2;
    world.fault(Fault::Delay { cable: CableId(3), direction: Some(Direction::AToB), count: 1, by });
    world.run_cycles(20);
    let counters = world.application().cyclic_counters();
    assert_eq!(counters.skipped, 3, "the frame was out for three cycles more");
    let skips = world.events(mark).iter().filter(|timed| timed.event == Event::Skipped { domain: DomainId(0) });
    assert_eq!(skips.count(), 3);
    assert_eq!(world.incomplete(mark), 0, "it was complete when it came");
    assert_eq!(counters.late, 0);
}

/// A frame of another MainDevice.
fn foreign(index: u8) -> Vec<u8> {
    let mut bytes = vec![0; 100];
    let length = {
        let mut builder = FrameBuilder::ethernet(&mut bytes, MacAddress::ETHERCAT_GROUP, OTHER).expect("room");
        builder.datagram(Command::Brd, index, Target::Broadcast(RegisterAddress(0x0130)), 2).expect("room");
        builder.finish()
    };
    bytes.truncate(length);
    bytes
}

// covers: lost-frames
#[test]
fn frames_of_another_main_device_are_counted_and_handed_over() {
    let mut world = World::in_op(4, ring_of_16(FAST));
    let mark = world.mark();
    for (link, index) in [(Link::Main, 5), (Link::Redundant, 6), (Link::Main, 0x85)] {
        world.application_mut().links_mut().inject(link, &foreign(index));
    }
    world.application_mut().links_mut().inject(Link::Main, &[0x55; 64]);
    world.run_cycles(5);
    let cyclic = world.application().cyclic_counters();
    assert_eq!(cyclic.foreign + world.application().acyclic_counters().foreign, 3);
    assert_eq!(cyclic.other, 1);
    let handed_over: Vec<_> = world
        .events(mark)
        .iter()
        .filter_map(|timed| match &timed.event {
            Event::ForeignFrame { arrived_on, bytes } => Some((*arrived_on, bytes.clone())),
            _ => None,
        })
        .collect();
    for expected in [(Link::Main, foreign(5)), (Link::Redundant, foreign(6)), (Link::Main, foreign(0x85))] {
        assert!(handed_over.contains(&expected), "{expected:?}");
    }
    assert_eq!(world.incomplete(mark), 0);
}

#[test]
fn an_own_frame_with_changed_datagrams_is_counted_as_corrupt() {
    let mut world = World::in_op(5, line(descriptions(&SIXTEEN), NetworkOptions::default()));
    world.run_cycles(3);
    // Like a frame of the engine, but with one datagram only: same id, same Idx.
    let before = world.application().cyclic_counters().corrupt;
    for id in 0..=255 {
        let mut bytes = foreign(0);
        bytes[6..12].copy_from_slice(&[0x00, 0x00, 0x5E, 0x00, 0x53, 0x01]);
        bytes[7] = id;
        world.application_mut().links_mut().inject(Link::Main, &bytes);
    }
    world.run_cycles(3);
    assert!(world.application().cyclic_counters().corrupt + world.application().cyclic_counters().late >= before + 256);
    assert_eq!(world.evaluated(world.beginning()).last().map(|evaluated| evaluated.delivery), Some(Delivery::Complete));
}

/// All SubDevices as found, with a longer cycle.
fn slowly(scan: &Scan) -> Declaration {
    automatic(&scan.subdevices, 4 * CYCLE)
}

#[test]
fn a_round_trip_of_more_than_two_milliseconds_fits_a_cycle_of_four() {
    let options = NetworkOptions::default().with_hop_delay(Duration::from_micros(80));
    let mut world =
        World::with(6, line(descriptions(&SIXTEEN), options), &Options::default(), slowly).expect("activation");
    world.settle();
    let mark = world.mark();
    world.run_cycles(50);
    assert_eq!(world.incomplete(mark), 0);
    assert!(world.application().links().flight_ns() > 2_000_000);
}
