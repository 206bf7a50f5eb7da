//! Hot connect groups in rings behind junctions and behind their members, on one link and on two, closed and broken.

mod at_the_end;

use std::time::Duration;

use ringcat::Position;
use ringcat::{
    Declaration, DomainMember, Event, Identified, JunctionConnection, JunctionMode, Options, Scan, SubDeviceConfig,
    SubDeviceId, TimedEvent, automatic,
};
use ringcat_engine::PortOf;
use ringcat_sim::cable::{CableId, DeviceIndex, Endpoint};
use ringcat_sim::fault::Fault;
use ringcat_sim::frame::Port::{A, B, C, D};
use ringcat_sim::network::Network;
use scenarios::segments::{MAIN, REDUNDANT, at, descriptions, wired_with};
use scenarios::world::{CYCLE, Mark, World};

use super::{Setting, change, crossed, edge, reports};
use crate::hot_connect::{LIMIT, TOOL, group, infos, tool};

/// Permanent SubDevices: the second is the junction, the fourth the tail of its ring.
const BASE: [&str; 5] = ["digital-output-8", "junction", "junction", "digital-input-8", "coupler"];
const STRICT: JunctionConnection = JunctionConnection::new(SubDeviceId(1), 1, SubDeviceId(3), 1);
/// The group's devices.
const GROUP: [DeviceIndex; 2] = [DeviceIndex(5), DeviceIndex(6)];

fn network(cables: &[(Endpoint, Endpoint)], two_links: bool) -> Network {
    let mut all = cables.to_vec();
    if two_links {
        all.push((at(4, B), REDUNDANT));
    }
    wired_with(descriptions(&BASE).into_iter().chain(tool()).collect(), &all)
}

fn declare(_: &Scan) -> Declaration {
    let mut declaration = automatic(&infos(&BASE), CYCLE);
    let members = declaration.add_group(group(SubDeviceConfig::at_alias(TOOL, 0))).members;
    declaration.domains[0].members.extend(members.into_iter().map(DomainMember::new));
    declaration
}

fn world(seed: u64, network: Network, setting: Setting<'_>) -> World {
    world_that(true, seed, network, setting)
}

/// `follow`: the cabling is read again with each group that joins or leaves.
fn world_that(follow: bool, seed: u64, network: Network, (mode, connections): Setting<'_>) -> World {
    let options = Options::default().with_junctions(mode).with_follow_groups(follow);
    let mut world = World::with_junctions(seed, network, &options, declare, connections).expect("it fits");
    world.until(LIMIT, "all that are there settled", |world| world.application().all_settled());
    world.run_cycles(60);
    world
}

fn has_joined(world: &World) -> bool {
    world.application().groups()[0].has_joined()
}

fn until_joined(world: &mut World) {
    world.until(LIMIT, "the group has joined", has_joined);
    world.recognise();
    world.run_cycles(80);
    assert!(world.all_in_op() && has_joined(world));
}

fn until_left(world: &mut World) {
    world.until(LIMIT, "the group has left", |world| world.application().groups()[0].present == 0);
    // Its outputs are stopped by their watchdogs.
    world.run_cycles(150);
}

/// Only the group has left OP since the beginning.
fn others_stay(world: &World, what: &str) {
    let left = world.left_op(world.beginning());
    assert!(left.iter().all(|device| GROUP.contains(device)), "{what}: {left:?}");
}

const SETTINGS: [(bool, Setting<'static>); 4] = [
    (false, (JunctionMode::Automatic, &[])),
    (false, (JunctionMode::Strict, &[STRICT])),
    (true, (JunctionMode::Automatic, &[])),
    (true, (JunctionMode::Strict, &[STRICT])),
];

// covers: hot-connect
#[test]
fn a_group_behind_a_ring_member_joins_and_leaves_closed_and_broken() {
    let cables = [
        (MAIN, at(0, A)),
        (at(0, B), at(1, A)),
        (at(1, D), at(2, A)),
        (at(2, B), at(3, A)),
        (at(3, B), at(1, B)),
        (at(1, C), at(4, A)),
        (at(2, D), at(5, A)),
        (at(5, B), at(6, A)),
    ];
    const PLUG: CableId = CableId(6);
    for (seed, (two_links, setting)) in (0..).zip([SETTINGS[0], SETTINGS[3]]) {
        let mut network = network(&cables, two_links);
        network.cut(PLUG);
        let mut world = world(seed, network, setting);
        let mut breaks: Vec<Vec<usize>> = vec![vec![], vec![2], vec![3], vec![4]];
        if two_links {
            breaks.extend([vec![0], vec![1], vec![5], vec![8], vec![5, 3], vec![8, 2]]);
        }
        for broken in breaks {
            let what = format!("{setting:?}, two links: {two_links}, broken: {broken:?}");
            for cable in &broken {
                edge(&mut world, &what, |world| world.cut(CableId(*cable)));
            }
            let mark = world.mark();
            world.heal(PLUG);
            until_joined(&mut world);
            assert_eq!(reports(&world, mark), [], "{what}");
            world.cut(PLUG);
            until_left(&mut world);
            assert_eq!((reports(&world, mark), crossed(&world, mark)), (vec![], 0), "{what}");
            // It also stays while the ring breaks and is repaired.
            world.heal(PLUG);
            until_joined(&mut world);
            for cable in &broken {
                edge(&mut world, &what, |world| world.heal(CableId(*cable)));
            }
            for cable in &broken {
                edge(&mut world, &what, |world| world.cut(CableId(*cable)));
            }
            for cable in &broken {
                edge(&mut world, &what, |world| world.heal(CableId(*cable)));
            }
            others_stay(&world, &what);
            world.cut(PLUG);
            until_left(&mut world);
        }
    }
}

/// The group between the two permanent members: cables 3 to 5 belong to the group.
const PIECE: [(Endpoint, Endpoint); 8] = [
    (MAIN, at(0, A)),
    (at(0, B), at(1, A)),
    (at(1, D), at(2, A)),
    (at(2, B), at(5, A)),
    (at(5, B), at(6, A)),
    (at(6, B), at(3, A)),
    (at(3, B), at(1, B)),
    (at(1, C), at(4, A)),
];

fn piece(follow: bool, seed: u64, two_links: bool, setting: Setting<'_>) -> World {
    let mut network = network(&PIECE, two_links);
    GROUP.iter().for_each(|device| network.power_off(*device));
    world_that(follow, seed, network, setting)
}

/// Rescans the segment; returns the places of the declared SubDevices.
fn rescan(world: &mut World) -> Vec<Option<usize>> {
    let mark = world.mark();
    let pending = world.application_mut().engine_mut().start_rescan(LIMIT);
    let rescan = world.finish(2 * LIMIT, pending).expect("it holds still");
    assert_eq!((world.incomplete(mark), rescan.moved().count()), (0, 0), "{:?}", rescan.subdevices);
    let index = |identified| if let Identified::Declared(index) = identified { Some(index.0) } else { None };
    rescan.subdevices.iter().map(|found| index(found.identified)).collect()
}

fn own(near: (usize, u8), far: (usize, u8), broken: bool) -> Event {
    let port = |(node, port)| PortOf::new(Position(node as u16), port);
    change(Some(port(near)), port(far), broken, usize::from(broken))
}

/// Both ends of a cable of the ring with the group in it, after the group is known.
fn own_with_group(cable: usize, broken: bool) -> Event {
    let (near, far) = match cable {
        2 => ((1, 3), (2, 0)),
        6 => ((5, 1), (1, 1)),
        cable => ((cable - 1, 1), (cable, 0)),
    };
    own(near, far, broken)
}

/// Events identify the SubDevices of the ring with the group: station address, indices in the declaration (JR-07,
/// CR-12).
fn names_fit(world: &World, mark: Mark) -> bool {
    let stations = world.application().engine().stations();
    world.events(mark).iter().all(|timed| match timed.event {
        Event::JunctionChanged { near: Some(near), far, station, declared, .. } => {
            let with_group = |at: Position| WITH_GROUP[usize::from(at.0)].map(SubDeviceId);
            declared == [near.position(), far.position()].map(with_group)
                && station == declared[1].map(|it| stations[it.0])
        }
        Event::BreakLocated { cable } | Event::RingClosed { place: Some(cable), .. } => {
            let expected = |node: usize| WITH_GROUP[node].map(|it| (Some(SubDeviceId(it)), stations[it]));
            let occupants = timed.occupants.map(|both| both.map(|occupant| (occupant.declared, occupant.station)));
            occupants == cable.positions().map(|at| expected(usize::from(at?.0)))
        }
        _ => true,
    })
}

fn power_on_group(world: &mut World) {
    for device in GROUP {
        world.power_on(device);
        world.run_cycles(3);
    }
    until_joined(world);
}

/// Positions with the group, by index in the declaration.
const WITH_GROUP: [Option<usize>; 7] = [Some(0), Some(1), Some(2), Some(5), Some(6), Some(3), Some(4)];
const WITHOUT_GROUP: [Option<usize>; 5] = [Some(0), Some(1), Some(2), Some(3), Some(4)];

/// Automatically, or with a requested rescan.
// covers: CR-17, JR-07, junctions, ring-events
#[test]
fn a_group_in_a_local_ring_is_part_of_it_only_while_present() {
    let asked = SETTINGS.map(|setting| (false, setting));
    for (seed, (follow, (two_links, setting))) in
        (20..).zip(asked.into_iter().chain([1, 2].map(|it| (true, SETTINGS[it]))))
    {
        let mut world = piece(follow, seed, two_links, setting);
        let what = format!("{setting:?}, two links: {two_links}, by itself: {follow}");
        let look = |world: &mut World, expected: &[Option<usize>]| match follow {
            true => world.run_cycles(150),
            false => assert_eq!(rescan(world), expected, "{what}"),
        };
        for round in 0..2 {
            let mark = world.mark();
            power_on_group(&mut world);
            assert_eq!(reports(&world, mark).len(), 1, "{what}: the gap is closed");
            look(&mut world, &WITH_GROUP);
            for cable in [2, 3, 4, 5, 6] {
                for broken in [true, false] {
                    let fault = if broken { Fault::Cut } else { Fault::Heal };
                    let mark = edge(&mut world, &what, |world| world.fault(fault(CableId(cable))));
                    let expected = vec![own_with_group(cable, broken)];
                    assert_eq!((reports(&world, mark), crossed(&world, mark)), (expected, 0), "{what}, cable {cable}");
                    assert!(names_fit(&world, mark), "{what}, cable {cable}");
                }
            }
            if two_links && round == 0 {
                // The cable behind the junction, of the ring of two links.
                let mark = edge(&mut world, &what, |world| world.cut(CableId(7)));
                edge(&mut world, &what, |world| world.heal(CableId(7)));
                let places = |timed: &&TimedEvent| timed.occupants.iter().all(Option::is_some);
                assert_eq!(world.events(mark).iter().filter(places).count(), 2, "{what}: broken, and whole");
                assert!(names_fit(&world, mark), "{what}");
            }
            let mark = world.mark();
            GROUP.iter().rev().for_each(|device| world.power_off(*device));
            until_left(&mut world);
            let ends = [own_with_group(3, true), {
                let Event::JunctionChanged { near, far, .. } = own_with_group(5, true) else { unreachable!() };
                change(near, far, true, 2)
            }];
            assert_eq!(reports(&world, mark), ends, "{what}: both of its ends are open");
            // The SubDevices behind the gap are known: the gap is one cable now.
            look(&mut world, &WITHOUT_GROUP);
            world.run_cycles(60);
            assert_eq!(reports(&world, mark).len(), 2, "{what}: as reported");
            if round == 0 && !follow {
                let mark = world.mark();
                power_on_group(&mut world);
                assert_eq!(reports(&world, mark), [own((2, 1), (3, 0), false)], "{what}");
                world.power_off(GROUP[1]);
                world.power_off(GROUP[0]);
                until_left(&mut world);
                assert_eq!(reports(&world, mark)[1..], [own((2, 1), (3, 0), true)], "{what}");
            }
        }
        others_stay(&world, &what);
        assert_eq!(crossed(&world, world.beginning()), 0, "{what}");
    }
}

/// One break and one repair are reported, the repair with its true place, for any order of the break and the rescan.
// covers: JR-07, junctions
#[test]
fn a_break_during_the_join_of_a_group_is_reported_once() {
    for (number, cable) in [4, 3, 5, 4, 6, 2].into_iter().enumerate() {
        let (two_links, setting) = SETTINGS[number % SETTINGS.len()];
        let what = format!("{setting:?}, two links: {two_links}, cable {cable}");
        let mut world = piece(number % 2 == 0, 30 + number as u64, two_links, setting);
        power_on_group(&mut world);
        let mark = world.mark();
        // Before, during and right after the rescan.
        world.fault_in(Duration::from_micros([0, 1_500, 4_000][number % 3]), Fault::Cut(CableId(cable)));
        let pending = world.application_mut().engine_mut().start_rescan(LIMIT);
        let rescan = world.finish(2 * LIMIT, pending).expect("it holds still");
        assert!(rescan.is_complete() && rescan.subdevices.len() == 7, "{what}");
        world.run_cycles(100);
        let broken = reports(&world, mark);
        assert!(matches!(broken[..], [Event::JunctionChanged { broken: true, breaks: 1, .. }]), "{what}: {broken:?}");
        let mark = edge(&mut world, &what, |world| world.heal(CableId(cable)));
        assert_eq!(reports(&world, mark), [own_with_group(cable, false)], "{what}");
        let mark = edge(&mut world, &what, |world| world.cut(CableId(cable)));
        assert_eq!((reports(&world, mark), crossed(&world, mark)), (vec![own_with_group(cable, true)], 0), "{what}");
        others_stay(&world, &what);
    }
}

/// Two breaks of one ring, or one of each ring: the cabling is not updated until the gap is the only break.
// covers: junctions
#[test]
fn a_group_that_left_a_broken_ring_is_no_longer_part_of_it() {
    for (number, (cable, (two_links, setting))) in
        [(6, SETTINGS[0]), (2, SETTINGS[1]), (8, SETTINGS[2]), (7, SETTINGS[3])].into_iter().enumerate()
    {
        let what = format!("{setting:?}, two links: {two_links}, cable {cable}");
        let mut world = piece(false, 40 + number as u64, two_links, setting);
        power_on_group(&mut world);
        rescan(&mut world);
        edge(&mut world, &what, |world| world.cut(CableId(cable)));
        GROUP.iter().rev().for_each(|device| world.power_off(*device));
        until_left(&mut world);
        let work = world.application_mut().engine_mut().start_rescan(LIMIT);
        let _ = world.finish(2 * LIMIT, work);
        world.heal(CableId(cable));
        world.until(LIMIT, "all that are there settled", |world| world.application().all_settled());
        world.run_cycles(120);
        assert_eq!(rescan(&mut world), WITHOUT_GROUP, "{what}");
        let mark = world.mark();
        power_on_group(&mut world);
        assert_eq!(reports(&world, mark), [own((2, 1), (3, 0), false)], "{what}");
        assert_eq!(rescan(&mut world), WITH_GROUP, "{what}");
        for cable in [3, 4, 5] {
            let mark = edge(&mut world, &what, |world| world.cut(CableId(cable)));
            assert_eq!(
                (reports(&world, mark), crossed(&world, mark)),
                (vec![own_with_group(cable, true)], 0),
                "{what}"
            );
            edge(&mut world, &what, |world| world.heal(CableId(cable)));
        }
    }
}

// covers: hot-connect
#[test]
fn a_group_in_a_local_ring_joins_and_leaves_without_a_rescan() {
    for (seed, (two_links, setting)) in (10..).zip(SETTINGS) {
        let mut world = piece(false, seed, two_links, setting);
        let what = format!("{setting:?}, two links: {two_links}");
        let changes = |world: &World, mark| -> Vec<bool> {
            let is = |event: &Event| matches!(event, Event::JunctionChanged { broken: true, .. });
            reports(world, mark).iter().map(is).collect()
        };
        assert_eq!(changes(&world, world.beginning()), [true], "{what}");
        for _ in 0..2 {
            let mark = world.mark();
            for device in GROUP {
                world.power_on(device);
                world.run_cycles(3);
            }
            until_joined(&mut world);
            assert_eq!(changes(&world, mark), [false], "{what}");
            for cable in [2, 3, 4, 5, 6] {
                for broken in [true, false] {
                    let fault = if broken { Fault::Cut } else { Fault::Heal };
                    let mark = edge(&mut world, &what, |world| world.fault(fault(CableId(cable))));
                    assert_eq!(crossed(&world, mark), 0, "{what}");
                    let expected = match cable {
                        2 => vec![own((1, 3), (2, 0), broken)],
                        // The group is not part of the scanned cabling: both of its ends are reported between these.
                        3 | 5 => vec![own((2, 1), (3, 0), broken)],
                        4 => vec![],
                        _ => vec![own((3, 1), (1, 1), broken)],
                    };
                    assert_eq!(reports(&world, mark), expected, "{what}, cable {cable}");
                }
            }
            let mark = world.mark();
            GROUP.iter().rev().for_each(|device| world.power_off(*device));
            until_left(&mut world);
            assert_eq!(reports(&world, mark), [own((2, 1), (3, 0), true)], "{what}");
            others_stay(&world, &what);
        }
    }
}
