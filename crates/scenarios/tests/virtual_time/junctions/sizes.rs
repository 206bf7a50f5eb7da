//! Mode automatic detects rings behind junctions of any length, and reports those that it does not detect (JR-03).

use std::time::Duration;

use ringcat::Position;
use ringcat::{Event, JunctionMode};
use ringcat_engine::{Closing, PortOf};
use ringcat_sim::cable::{CableId, Endpoint};
use ringcat_sim::frame::Port::{A, B, C, D};
use ringcat_sim::network::Network;
use scenarios::segments::{MAIN, REDUNDANT, at, wired};
use scenarios::world::World;

use super::{crossed, in_op, reports};

/// Rings with these numbers of members, one behind the other, with a SubDevice before, between and behind them; and
/// their closing cables.
fn rings(members: &[usize], two_links: bool) -> (Network, Vec<Closing>, Vec<CableId>) {
    let (mut kinds, mut cables, mut closings, mut within) =
        (vec!["digital-input-8"], vec![(MAIN, at(0, A))], vec![], vec![]);
    let mut end: Endpoint = at(0, B);
    for count in members {
        let junction = kinds.len();
        kinds.push("junction");
        cables.push((end, at(junction, A)));
        let mut last = at(junction, D);
        for member in junction + 1..=junction + count {
            kinds.push(if member % 2 == 0 { "digital-input-8" } else { "digital-output-8" });
            within.push(CableId(cables.len()));
            cables.push((last, at(member, A)));
            last = at(member, B);
        }
        within.push(CableId(cables.len()));
        cables.push((last, at(junction, B)));
        let port = |node, port| PortOf::new(Position(node as u16), port);
        closings.push(Closing { head: port(junction, 1), tail: port(junction + count, 1) });
        // Two SubDevices in a row: open ports allow the ring to end at either.
        for _ in 0..2 {
            let behind = kinds.len();
            kinds.push("digital-input-8");
            cables.push((
                if behind == junction + count + 1 { at(junction, C) } else { at(behind - 1, B) },
                at(behind, A),
            ));
            end = at(behind, B);
        }
    }
    if two_links {
        cables.push((end, REDUNDANT));
    }
    (wired(&kinds, &cables), closings, within)
}

fn learned(world: &World) -> Vec<Closing> {
    let events = world.events(world.beginning()).iter();
    let mut learned: Vec<Closing> = events
        .filter_map(|timed| match timed.event {
            Event::JunctionLearned { closing } => Some(closing),
            _ => None,
        })
        .collect();
    learned.sort_unstable();
    learned
}

// covers: JR-03, junctions
#[test]
fn rings_of_any_length_are_learned_without_a_crossed_line_report() {
    let sizes: [&[usize]; 9] = [&[4], &[12], &[13], &[16], &[20], &[32], &[20, 20], &[32, 7], &[13, 16, 24]];
    for members in sizes {
        for two_links in [false, true] {
            let what = format!("{members:?}, two links: {two_links}");
            let (network, closings, within) = rings(members, two_links);
            let mut world = in_op(70, network, (JunctionMode::Automatic, &[]));
            assert_eq!(learned(&world), closings, "{what}");
            for cable in [within[0], within[within.len() / 2], within[within.len() - 1]] {
                let mark = world.mark();
                world.cut(cable);
                world.run_cycles(100);
                world.heal(cable);
                world.run_cycles(200);
                assert_eq!(reports(&world, mark).len(), 2, "{what}, {cable:?}");
            }
            assert_eq!(crossed(&world, world.beginning()), 0, "{what}");
        }
    }
}

/// The same with a ring that is broken at the scan.
// covers: JR-03, junctions
#[test]
fn long_rings_that_are_broken_at_the_scan_are_learned() {
    for members in [13, 20, 32] {
        for broken in [1, members / 2, members - 1] {
            let what = format!("{members} members, cable {broken}");
            let (mut network, closings, within) = rings(&[members], false);
            network.cut(within[broken]);
            network.advance_by(Duration::from_millis(1));
            let world = in_op(71, network, (JunctionMode::Automatic, &[]));
            assert_eq!(learned(&world), closings, "{what}");
            assert_eq!(crossed(&world, world.beginning()), 0, "{what}");
        }
    }
}

/// More rings than the search limit: this is reported, process data is exchanged as without rings, and no crossed line
/// is reported.
// covers: JR-03, junctions
#[test]
fn rings_that_are_not_learned_are_reported_and_delay_nothing() {
    let (network, _, _) = rings(&[2; 17], false);
    let mut world = in_op(72, network, (JunctionMode::Automatic, &[]));
    let not_learned = |world: &World| -> Vec<usize> {
        let events = world.events(world.beginning()).iter();
        let rings = events.filter_map(|timed| match timed.event {
            Event::JunctionsNotLearned { rings } => Some(rings),
            _ => None,
        });
        rings.collect()
    };
    assert_eq!(not_learned(&world), [17]);
    assert_eq!(learned(&world), []);
    world.settle();
    assert_eq!(crossed(&world, world.beginning()), 0);
    // The number of rings of the search limit.
    let (network, closings, _) = rings(&[2; 16], false);
    let world = in_op(73, network, (JunctionMode::Automatic, &[]));
    assert_eq!((not_learned(&world), learned(&world)), (Vec::new(), closings));
}
