//! Rings behind junctions that a scan detects: in mode automatic several rings, nested, one of them broken, although
//! open ports allow many solutions (JR-03); of a broken ring all but one end of the broken cable.

use ringcat::Position;
use ringcat::{Cable, Event, JunctionMode};
use ringcat_engine::{Closing, PortOf};
use ringcat_sim::cable::CableId;
use ringcat_sim::frame::Port::{A, B, C, D};
use scenarios::segments::{MAIN, REDUNDANT, at, wired};
use scenarios::world::World;

use super::{STRICT, crossed, edge, in_op, one_ring, reports};

/// Junction 0 has a ring with two more junctions, 1 and 3, with a ring each, and behind it another junction, 5.
const KINDS: [&str; 8] = [
    "junction",
    "junction",
    "digital-output-8",
    "junction",
    "digital-input-8",
    "junction",
    "digital-output-8",
    "digital-input-16",
];

// covers: JR-03, junctions
#[test]
fn four_nested_rings_are_learned_closed_and_with_any_one_broken() {
    let mut cables = vec![
        (MAIN, at(0, A)),
        (at(0, D), at(1, A)),
        (at(1, D), at(2, A)),
        (at(2, B), at(1, B)),
        (at(1, C), at(3, A)),
        (at(3, D), at(4, A)),
        (at(4, B), at(3, B)),
        (at(3, C), at(0, B)),
        (at(0, C), at(5, A)),
        (at(5, D), at(6, A)),
        (at(6, B), at(5, B)),
        (at(5, C), at(7, A)),
    ];
    let closing = |(head, head_port), (tail, tail_port)| Closing {
        head: PortOf::new(Position(head as u16), head_port),
        tail: PortOf::new(Position(tail as u16), tail_port),
    };
    let all = [closing((0, 1), (3, 2)), closing((1, 1), (2, 1)), closing((3, 1), (4, 1)), closing((5, 1), (6, 1))];
    for two_links in [false, true] {
        if two_links {
            cables.push((at(7, B), REDUNDANT));
        }
        // First cables of rings and cables between members. A broken closing cable hides its ring (JR-03).
        let some: &[Option<usize>] =
            if two_links { &[None, Some(4)] } else { &[None, Some(1), Some(4), Some(5), Some(9)] };
        for broken in some.iter().copied() {
            let what = format!("two links: {two_links}, cable {broken:?}");
            let mut network = wired(&KINDS, &cables);
            broken.into_iter().for_each(|cable| network.cut(CableId(cable)));
            let mut world = in_op(50, network, (JunctionMode::Automatic, &[]));
            let learned = world.events(world.beginning()).iter().filter_map(|timed| match timed.event {
                Event::JunctionLearned { closing } => Some(closing),
                _ => None,
            });
            let mut learned: Vec<Closing> = learned.collect();
            learned.sort_unstable();
            assert_eq!(learned, all, "{what}");
            assert_eq!(reports(&world, world.beginning()).len(), usize::from(broken.is_some()), "{what}");
            assert_eq!(crossed(&world, world.beginning()), 0, "{what}");
            if let Some(cable) = broken {
                let mark = edge(&mut world, &what, |world| world.heal(CableId(cable)));
                assert_eq!(reports(&world, mark).len(), 1, "{what}");
            }
        }
    }
}

/// A cable that was broken at the scan has an unknown end: it is not a cable of an interface, and is listed after its
/// first repair.
// covers: JR-07, cable-errors
#[test]
fn a_local_cable_broken_at_the_scan_is_listed_after_its_repair() {
    let cables = |world: &World| -> Vec<Cable> {
        world.application().engine().cable_errors().into_iter().map(|it| it.cable).collect()
    };
    let whole = cables(&in_op(60, one_ring(), (JunctionMode::Strict, &[STRICT])));
    for broken in [2, 3, 4] {
        let what = format!("cable {broken}");
        let mut network = one_ring();
        network.cut(CableId(broken));
        let mut world = in_op(61, network, (JunctionMode::Strict, &[STRICT]));
        let others: Vec<Cable> = whole.iter().enumerate().filter(|(at, _)| *at != broken).map(|(_, it)| *it).collect();
        assert_eq!(cables(&world), others, "{what}");
        edge(&mut world, &what, |world| world.heal(CableId(broken)));
        assert_eq!(cables(&world), whole, "{what}");
        // Errors are counted for it as for any other cable.
        world.corrupt(CableId(broken), 30);
        world.run_cycles(1_600);
        let reports = |timed: &&ringcat::TimedEvent| {
            matches!(timed.event, Event::CableErrors { cable, .. }
            if cable == whole[broken])
        };
        assert_eq!(world.events(world.beginning()).iter().filter(reports).count(), 1, "{what}");
    }
}
