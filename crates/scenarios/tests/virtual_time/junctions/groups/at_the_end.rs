//! A hot connect group at the end of a ring behind a junction: known from before, and unknown.

use super::*;

/// The group between the last permanent member and the junction: cables 4 to 6 belong to the group.
const END: [(Endpoint, Endpoint); 8] = [
    (MAIN, at(0, A)),
    (at(0, B), at(1, A)),
    (at(1, D), at(2, A)),
    (at(2, B), at(3, A)),
    (at(3, B), at(5, A)),
    (at(5, B), at(6, A)),
    (at(6, B), at(1, B)),
    (at(1, C), at(4, A)),
];

/// The group is the end of the ring. While it is absent the ring ends at the SubDevice before it. Until returned
/// SubDevices are identified they are unassigned, and the ring must not be reported as another ring or as crossed
/// lines.
// covers: JR-03, JR-04, junctions
#[test]
fn a_group_at_the_end_of_a_local_ring_returns_as_its_end() {
    let strict = [JunctionConnection::new(SubDeviceId(1), 1, SubDeviceId(6), 1)];
    let settings = [(JunctionMode::Automatic, &[][..]), (JunctionMode::Strict, &strict)];
    for (number, (setting, looks)) in [(0, false), (1, true), (0, true), (1, true)].into_iter().enumerate() {
        let setting = settings[setting];
        let what = format!("{setting:?}, looks: {looks}, run {number}");
        let mut network = network(&END, number == 2);
        let closing = |node: usize, broken| own((node, 1), (1, 1), broken);
        let mut world = if number == 3 {
            // It was never present: the connection is supervised after the rescan that finds it.
            GROUP.iter().for_each(|device| network.power_off(*device));
            let mut world = world(60 + number as u64, network, setting);
            power_on_group(&mut world);
            assert_eq!(rescan(&mut world).len(), 7, "{what}");
            world
        } else {
            let mut world = world(60 + number as u64, network, setting);
            until_joined(&mut world);
            world
        };
        GROUP.iter().rev().for_each(|device| world.power_off(*device));
        until_left(&mut world);
        if looks {
            assert_eq!(rescan(&mut world), WITHOUT_GROUP, "{what}");
        }
        power_on_group(&mut world);
        for cable in [3, 4, 5, 6] {
            let mark = edge(&mut world, &what, |world| world.cut(CableId(cable)));
            assert!(reports(&world, mark).len() <= 1, "{what}, cable {cable}");
            edge(&mut world, &what, |world| world.heal(CableId(cable)));
        }
        assert_eq!(rescan(&mut world)[..6], [Some(0), Some(1), Some(2), Some(3), Some(5), Some(6)], "{what}");
        for cable in [3, 4, 5, 6] {
            let ends = |broken| match cable {
                6 => closing(5, broken),
                cable => own((cable - 1, 1), (cable, 0), broken),
            };
            for broken in [true, false] {
                let fault = if broken { Fault::Cut } else { Fault::Heal };
                let mark = edge(&mut world, &what, |world| world.fault(fault(CableId(cable))));
                assert_eq!(reports(&world, mark), [ends(broken)], "{what}, cable {cable}");
            }
        }
        assert_eq!(crossed(&world, world.beginning()), 0, "{what}");
        assert!(!world.saw(world.beginning(), |event| matches!(event, Event::JunctionUnknown { .. })), "{what}");
        others_stay(&world, &what);
    }
}

/// The group is not known as a part of the ring; but SubDevices entered from the closing cable are not crossed.
// covers: JR-04, junctions
#[test]
fn a_break_at_an_unknown_group_in_a_local_ring_is_no_crossed_line() {
    for (seed, two_links) in [(70, false), (71, true)] {
        let mut network = network(&END, two_links);
        GROUP.iter().for_each(|device| network.power_off(*device));
        let mut world = world(seed, network, SETTINGS[1].1);
        power_on_group(&mut world);
        for cable in [4, 5, 6, 3, 2] {
            let what = format!("two links: {two_links}, cable {cable}");
            edge(&mut world, &what, |world| world.cut(CableId(cable)));
            edge(&mut world, &what, |world| world.heal(CableId(cable)));
            assert_eq!(crossed(&world, world.beginning()), 0, "{what}");
        }
        others_stay(&world, "cut and healed");
    }
}
