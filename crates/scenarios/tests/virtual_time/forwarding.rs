//! A ring that leads through a second, INACTIVE MainDevice, which stores and forwards (protocol 9.7): each row of the
//! table of cuts, and the MainDevice that is ACTIVE in such a ring.

use std::time::Duration;

use ringcat::simulated::SimulatedSegment;
use ringcat::{Event, Instant, Link, Links, RingState};
use ringcat_sim::cable::{CableId, Host, HostLink};
use ringcat_sim::fault::Fault;
use ringcat_sim::host::program::TurnAround;
use ringcat_sim::network::builder::SegmentBuilder;
use ringcat_sim::network::{Network, NetworkOptions};
use scenarios::check::troubles;
use scenarios::segments::{descriptions, devices};
use scenarios::world::{CYCLE, World};

const KINDS: [&str; 8] = [
    "coupler",
    "digital-output-8",
    "digital-input-8",
    "servo",
    "emulated-output-8",
    "analog-input-4",
    "digital-output-16",
    "block",
];
const FAST: Duration = Duration::from_micros(10);
/// Offset of the C bit's byte and of the working counter in a frame with one datagram of a byte.
const CIRCULATING_AT: usize = 23;
const WKC_AT: usize = 27;

/// A ring through two MainDevices; the line begins at the main link of `near`. Cables are numbered from there on, the
/// last one joins the MainDevices.
fn ring_of_two(count: usize, near: Host) -> Network {
    let options = NetworkOptions::default().with_detection_delay(FAST);
    let devices = devices(descriptions(&KINDS[..count]));
    SegmentBuilder::ring_of_two(devices, near).options(options).build().expect("the cables fit")
}

/// A BRD of one byte, as its MainDevice sends it on a link.
fn broadcast(link: Link) -> [u8; 60] {
    let mut frame = [0; 60];
    frame[..6].copy_from_slice(&[0x01, 0x01, 0x05, 0x01, 0x00, 0x00]);
    frame[6..12].copy_from_slice(&[if link == Link::Main { 0 } else { 0x08 }, 0x76, 0x0E, 0x01, 0xBD, 0x9A]);
    frame[12..18].copy_from_slice(&[0x88, 0xA4, 0x0D, 0x10, 7, 0]);
    frame[22] = 1;
    frame
}

/// A frame that comes back, and when.
fn back_at(segment: &mut SimulatedSegment, link: Link) -> Instant {
    segment.send(link, &broadcast(link));
    let until = segment.now() + CYCLE;
    segment.wait(until);
    assert!(segment.receive(&mut |_, _| ()), "it comes back");
    segment.now()
}

/// A copy that came back: SubDevices that processed it, the link, byte 0 of its source address, whether it circulated.
type Back = (u8, Link, u8, bool);

/// Sends a copy on a link and returns what comes back of it.
fn round(segment: &mut SimulatedSegment, link: Link) -> Option<Back> {
    segment.send(link, &broadcast(link));
    let until = segment.now() + CYCLE;
    let mut back = Vec::new();
    while segment.now() < until {
        segment.wait(until);
        let mut take = |link: Link, frame: &[u8]| {
            back.push((frame[WKC_AT], link, frame[6], frame[CIRCULATING_AT] & 0x40 != 0));
        };
        while segment.receive(&mut take) {}
    }
    assert!(back.len() <= 1, "each copy comes back once: {back:?}");
    back.pop()
}

/// Byte 0 without the mark that controllers set: those of the catalogue do not set it.
const fn marks(byte: u8) -> u8 {
    byte & !0x02
}

// covers: 9.7.5, CF-01, CF-02, CF-03, CF-05, standby
#[test]
fn each_cut_of_a_ring_of_two_returns_the_copies_of_the_table() {
    use Link::{Main, Redundant};
    type Row = (Option<usize>, Option<(u8, Link, u8)>, Option<(u8, Link, u8)>);
    let near: [Row; 5] = [
        (None, Some((3, Redundant, 0x06)), Some((0, Main, 0x88))),
        (Some(0), None, Some((3, Redundant, 0x8E))),
        (Some(2), Some((2, Main, 0x02)), Some((1, Redundant, 0x8E))),
        (Some(3), Some((3, Main, 0x02)), Some((0, Redundant, 0x0C))),
        (Some(4), Some((3, Main, 0x82)), None),
    ];
    let far: [Row; 5] = [
        (None, Some((3, Redundant, 0x06)), Some((0, Main, 0x88))),
        (Some(0), Some((0, Main, 0x80)), Some((3, Redundant, 0x0A))),
        (Some(2), Some((2, Main, 0x86)), Some((1, Redundant, 0x0A))),
        (Some(3), Some((3, Main, 0x86)), None),
        (Some(4), None, Some((3, Redundant, 0x0E))),
    ];
    for (active, rows) in [(Host::First, near), (Host::Second, far)] {
        for (cut, main, redundant) in rows {
            let mut network = ring_of_two(3, active);
            network.advance_by(CYCLE);
            if let Some(cable) = cut {
                network.apply(Fault::Cut(CableId(cable)));
                network.advance_by(CYCLE);
            }
            let mut segment = SimulatedSegment::new(network);
            for (link, expected) in [(Main, main), (Redundant, redundant)] {
                let back = round(&mut segment, link);
                let row = format!("line at {active:?}, cut {cut:?}, {link} copy: {back:?}");
                assert_eq!(
                    back.map(|(count, on, byte, _)| (count, on, marks(byte))),
                    expected.map(|(count, on, byte)| (count, on, marks(byte))),
                    "{row}"
                );
                // Port 0 of the first SubDevice behind the break has closed.
                let circulated = link == Redundant && matches!(cut, Some(0 | 2));
                assert_eq!(back.is_some_and(|(.., circulated)| circulated), circulated, "{row}");
            }
        }
    }
}

// covers: CR-15, standby
#[test]
fn the_active_has_its_ring_through_the_standby_whatever_cable_is_cut() {
    for (seed, near, count) in [(1, Host::First, 8), (2, Host::Second, 8), (3, Host::First, 1), (4, Host::Second, 2)] {
        let mut world = World::in_op(seed, ring_of_two(count, near));
        world.run_cycles(200);
        assert_eq!(world.application().ring(), RingState::Closed);
        for cable in 0..count + 2 {
            for phase in [0, 40, 300, 800] {
                // A ring that opens more often counts as unsteady.
                world.run_cycles(500);
                let mark = world.mark();
                world.fault_in(CYCLE * phase / 1000, Fault::Cut(CableId(cable)));
                world.run_cycles(200);
                let here = format!("seed {seed}, cable {cable}, moment {phase}");
                assert_eq!(world.application().ring(), RingState::Open, "{here}\n{}", world.log());
                assert!(world.incomplete(mark) <= 2, "{here}: {} incomplete\n{}", world.incomplete(mark), world.log());
                let opened = world.saw(mark, |event| matches!(event, Event::RingOpened { .. }));
                assert!(opened && world.left_op(mark).is_empty() && world.all_in_op(), "{here}\n{}", world.log());
                let mark = world.mark();
                world.heal(CableId(cable));
                world.run_cycles(50);
                assert_eq!(world.application().ring(), RingState::Closed, "{here}\n{}", world.log());
                assert!(world.incomplete(mark) <= 2, "{here}: {} incomplete\n{}", world.incomplete(mark), world.log());
                assert!(world.left_op(mark).is_empty() && world.all_in_op(), "{here}\n{}", world.log());
                let troubles = troubles(world.events(mark));
                assert!(troubles.is_empty(), "{here}: {troubles:?}\n{}", world.log());
            }
        }
    }
}

// covers: standby
#[test]
fn a_standby_whose_links_go_down_leaves_the_active_a_line() {
    for (seed, near) in [(1, Host::First), (2, Host::Second)] {
        let mut world = World::in_op(seed, ring_of_two(8, near));
        let mark = world.mark();
        HostLink::SECOND.iter().for_each(|link| world.network_mut().disconnect(*link, true));
        world.run_cycles(200);
        assert_eq!(world.application().ring(), RingState::Open, "{}", world.log());
        assert!(world.incomplete(mark) <= 2 && world.left_op(mark).is_empty(), "{}", world.log());
        let mark = world.mark();
        HostLink::SECOND.iter().for_each(|link| world.network_mut().disconnect(*link, false));
        world.run_cycles(200);
        assert_eq!(world.application().ring(), RingState::Closed, "{}", world.log());
        assert!(world.incomplete(mark) <= 2 && world.left_op(mark).is_empty(), "{}", world.log());
    }
}

// covers: standby
#[test]
fn each_pass_of_a_standby_takes_its_turn_around_time() {
    let time = |least: u64, most: u64, cut: Option<usize>| {
        let mut network = ring_of_two(3, Host::First);
        if let Some(cable) = cut {
            network.apply(Fault::Cut(CableId(cable)));
        }
        network.advance_by(CYCLE);
        let mut segment = SimulatedSegment::new(network);
        let turn_around = TurnAround { least: Duration::from_micros(least), most: Duration::from_micros(most) };
        segment.network_mut().set_turn_around(Host::Second, turn_around);
        let begin = segment.now();
        back_at(&mut segment, Link::Redundant) - begin
    };
    let us = Duration::from_micros;
    let (once, twice) = (time(0, 0, None), time(0, 0, Some(2)));
    assert_eq!((time(40, 40, None), time(40, 40, Some(2))), (once + us(40), twice + us(80)));
    let random = time(5, 25, None) - once;
    assert!(us(5) <= random && random <= us(25) && random == time(5, 25, None) - once, "{random:?}");
    // The wire time of the shortest frame: its last bit has come before the standby sends its first one.
    assert!(once > us(2 * 5), "{once:?}");
}

// covers: standby
#[test]
fn frames_that_waited_in_a_stopped_standby_are_not_sent_on() {
    for (seed, near) in [(1, Host::First), (2, Host::Second)] {
        for phase in [0, 100, 700] {
            let mut world = World::in_op(seed, ring_of_two(8, near));
            // Behind the cut only the standby reaches the SubDevices.
            world.cut(CableId(4));
            world.run_cycles(300);
            let mark = world.mark();
            world.fault_in(CYCLE * phase / 1000, Fault::StopHost(Host::Second, true));
            world.run_cycles(20);
            assert!(world.incomplete(mark) > 10, "the standby forwards nothing\n{}", world.log());
            let before = world.application().links().forwarded();
            let mark = world.mark();
            world.fault_in(CYCLE * phase / 1000, Fault::StopHost(Host::Second, false));
            world.run_cycles(20);
            let after = world.application().links().forwarded();
            let here = format!("seed {seed}, moment {phase}: {before:?}, {after:?}\n{}", world.log());
            // Of 20 cycles with a frame on each link, those of the last five may still be of use.
            assert!(after.too_old - before.too_old >= 20, "{here}");
            assert!(world.incomplete(mark) <= 2, "{here}");
        }
    }
}

// covers: standby
#[test]
fn a_standby_that_loses_its_power_leaves_a_line_and_closes_the_ring_again() {
    for (seed, near) in [(1, Host::First), (2, Host::Second)] {
        for phase in [0, 60, 500] {
            let mut world = World::in_op(seed, ring_of_two(8, near));
            for (fault, expected) in [
                (Fault::PowerHostOff(Host::Second), RingState::Open),
                (Fault::PowerHostOn(Host::Second), RingState::Closed),
            ] {
                let mark = world.mark();
                world.fault_in(CYCLE * phase / 1000, fault);
                world.run_cycles(200);
                let here = format!("seed {seed}, moment {phase}, {expected:?}\n{}", world.log());
                assert_eq!(world.application().ring(), expected, "{here}");
                assert!(world.incomplete(mark) <= 2 && world.left_op(mark).is_empty(), "{here}");
            }
        }
    }
}
