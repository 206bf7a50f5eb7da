//! More than one break: in one local ring, in two local rings, in a local ring and in the ring of two links (JR-02).

use std::time::Duration;

use ringcat::Position;
use ringcat::{Event, JunctionConnection, JunctionMode, Options, SubDeviceId, automatic};
use ringcat_engine::PortOf;
use ringcat_sim::cable::{CableId, DeviceIndex};
use ringcat_sim::fault::Fault;
use ringcat_sim::frame::Port::{A, B, C, D};
use ringcat_sim::network::Network;
use ringcat_wire::register::map;
use scenarios::check::{Delivery, troubles};
use scenarios::segments::{MAIN, REDUNDANT, RING_IN_RING, TWO_RINGS, at, wired};
use scenarios::world::{CYCLE, World};

use super::{STRICT, change, crossed, edge, ends, in_op, one_ring, reports, without_names};

/// Devices of [`TWO_RINGS`].
const KINDS: [&str; 7] =
    ["junction", "digital-output-8", "servo", "junction", "digital-input-8", "servo", "digital-input-8"];

pub fn two_rings() -> Network {
    wired(&KINDS, &TWO_RINGS)
}

const TWO_STRICT: [JunctionConnection; 2] = [
    JunctionConnection::new(SubDeviceId(0), 1, SubDeviceId(2), 1),
    JunctionConnection::new(SubDeviceId(3), 1, SubDeviceId(5), 1),
];

// covers: JR-02, junctions
#[test]
fn either_of_two_rings_may_break_and_a_second_break_is_reported() {
    for setting in [(JunctionMode::Automatic, &[][..]), (JunctionMode::Strict, &TWO_STRICT)] {
        let mut world = in_op(3, two_rings(), setting);
        for cable in [1, 2, 3, 5, 6, 7] {
            let what = format!("{setting:?}, cable {cable}");
            let mark = edge(&mut world, &what, |world| world.cut(CableId(cable)));
            assert_eq!(reports(&world, mark).len(), 1, "{what}");
            let mark = edge(&mut world, &what, |world| world.heal(CableId(cable)));
            assert_eq!(reports(&world, mark).len(), 1, "{what}");
        }
        // The second ring breaks too: frames are destroyed at the second unconnected port 0.
        edge(&mut world, "first break", |world| world.cut(CableId(2)));
        let mark = world.mark();
        world.cut(CableId(6));
        world.run_cycles(300);
        let second = |broken, breaks| {
            let (near, far) = (Some(PortOf::new(Position(4), 1)), PortOf::new(Position(5), 0));
            change(near, far, broken, breaks)
        };
        assert_eq!(reports(&world, mark), [Event::JunctionsBlocked { blocked: true, breaks: 1 }, second(true, 2)]);
        assert_eq!(world.evaluated(mark).last().map(|evaluated| evaluated.delivery), Some(Delivery::Zero));
        assert!(!world.saw(mark, |event| matches!(event, Event::Lost { .. })), "the present SubDevices are unknown");
        // One of them is repaired: all SubDevices come back, the other ring is still broken.
        world.heal(CableId(6));
        world.until(Duration::from_secs(3), "all in OP", |w| w.all_in_op() && w.application().all_settled());
        world.run_cycles(100);
        let free = Event::JunctionsBlocked { blocked: false, breaks: 2 };
        assert_eq!(reports(&world, mark)[2..], [free, second(false, 1)]);
        let mark = edge(&mut world, "first break healed", |world| world.heal(CableId(2)));
        assert!(matches!(reports(&world, mark)[..], [Event::JunctionChanged { broken: false, breaks: 0, .. }]));
    }
}

/// Both ends of a cable of [`two_rings`] that is not a closing cable.
pub fn ends_of_two(cable: usize) -> (PortOf, PortOf) {
    let (near, port) = match cable {
        1 => (0, 3),
        2 => (1, 1),
        5 => (3, 3),
        _ => (4, 1),
    };
    let far = if cable > 4 { cable - 1 } else { cable };
    (PortOf::new(Position(near as u16), port), PortOf::new(Position(far as u16), 0))
}

/// Two rings break within one cycle, so that no frame shows the places. No frame comes back, which is reported; then
/// each ring is examined while the other one is closed off.
// covers: JR-02, junctions
#[test]
fn two_rings_that_break_at_once_are_reported_with_both_places() {
    let apart = [Duration::ZERO, Duration::from_micros(3), Duration::from_micros(400)];
    let settings = [(JunctionMode::Automatic, &[][..]), (JunctionMode::Strict, &TWO_STRICT)];
    for (number, (first, second)) in [(2, 6), (1, 5), (3, 7), (6, 1), (2, 5), (5, 2)].into_iter().enumerate() {
        let mut world = in_op(30 + number as u64, two_rings(), settings[number % 2]);
        let mark = world.mark();
        world.fault_in(CYCLE / 2, Fault::Cut(CableId(first)));
        world.fault_in(CYCLE / 2 + apart[number % apart.len()], Fault::Cut(CableId(second)));
        world.run_cycles(300);
        let what = format!("cables {first} and {second}: {:?}", reports(&world, mark));
        // The closing cable leaves no port 0 unconnected: it does not block frames.
        let closing = [first, second].iter().filter(|cable| [3, 7].contains(*cable)).count();
        if closing > 0 {
            let broken = |event: &Event| matches!(event, Event::JunctionChanged { broken: true, .. });
            assert!(reports(&world, mark).iter().filter(|event| broken(event)).count() == 2, "{what}");
            assert_eq!(troubles(world.events(mark)), Vec::<&Event>::new(), "{what}");
        } else {
            let place = |cable: usize, broken, breaks| {
                let (near, far) = ends_of_two(cable);
                change(Some(near), far, broken, breaks)
            };
            let (one, other) = (first.min(second), first.max(second));
            let blocked = |blocked, breaks| Event::JunctionsBlocked { blocked, breaks };
            assert_eq!(reports(&world, mark), [blocked(true, 0), place(one, true, 1), place(other, true, 2)], "{what}");
            assert_eq!(
                world.evaluated(mark).last().map(|evaluated| evaluated.delivery),
                Some(Delivery::Zero),
                "{what}"
            );
            let lost = |event: &Event| matches!(event, Event::Lost { .. } | Event::LineCrossed { .. });
            assert!(!world.saw(mark, lost), "{what}: SubDevices that are unreachable on purpose are not lost");
            // The places are known before the watchdogs of outputs expire (100 ms).
            let reported_at =
                world.events(mark).iter().filter(|timed| without_names(timed.event.clone()) == place(other, true, 2));
            let at = reported_at.map(|timed| timed.at).next().expect("it was reported");
            let begin = world.events(mark)[0].at;
            println!("{first} and {second}: both placed {:?} after the first event", at.since(begin));
            assert!(at.since(begin) < Duration::from_millis(100), "{what}");
            let mending = world.mark();
            world.heal(CableId(first));
            world.until(Duration::from_secs(3), "all in OP", |w| w.all_in_op() && w.application().all_settled());
            world.run_cycles(100);
            assert_eq!(reports(&world, mending), [blocked(false, 2), place(first, false, 1)], "{what}");
        }
        if closing > 0 {
            edge(&mut world, &what, |world| world.heal(CableId(first)));
        }
        let mark = edge(&mut world, &what, |world| world.heal(CableId(second)));
        assert!(
            matches!(reports(&world, mark)[..], [Event::JunctionChanged { broken: false, breaks: 0, .. }]),
            "{what}"
        );
    }
}

/// The same in a closed ring of two links, in which unprocessed copies of the redundant link come back.
// covers: JR-02, junctions
#[test]
fn two_local_rings_broken_in_a_ring_of_two_links_have_their_places() {
    let mut cables = TWO_RINGS.to_vec();
    cables.push((at(6, B), REDUNDANT));
    let mut world = in_op(40, wired(&KINDS, &cables), (JunctionMode::Automatic, &[]));
    let mark = world.mark();
    world.cut(CableId(2));
    world.cut(CableId(6));
    world.run_cycles(300);
    let place = |cable, broken, breaks| {
        let (near, far) = ends_of_two(cable);
        change(Some(near), far, broken, breaks)
    };
    let blocked = |blocked, breaks| Event::JunctionsBlocked { blocked, breaks };
    assert_eq!(reports(&world, mark), [blocked(true, 0), place(2, true, 1), place(6, true, 2)]);
    assert!(!world.saw(mark, |event| matches!(event, Event::Lost { .. })));
    world.heal(CableId(6));
    world.until(Duration::from_secs(3), "all in OP", |w| w.all_in_op() && w.application().all_settled());
    world.run_cycles(100);
    assert_eq!(reports(&world, mark)[3..], [blocked(false, 2), place(6, false, 1)]);
    edge(&mut world, "the other one", |world| world.heal(CableId(2)));
}

/// A ring behind a member of another ring, before and behind the break of the other ring.
// covers: JR-02, junctions
#[test]
fn nested_rings_that_break_at_once_are_reported_with_both_places() {
    let kinds = ["junction", "junction", "digital-output-8", "servo", "digital-input-8", "digital-input-8"];
    let cables = [
        (MAIN, at(0, A)),
        (at(0, D), at(1, A)),
        (at(1, D), at(2, A)),
        (at(2, B), at(3, A)),
        (at(3, B), at(1, B)),
        (at(1, C), at(4, A)),
        (at(4, B), at(0, B)),
        (at(0, C), at(5, A)),
    ];
    let strict = [
        JunctionConnection::new(SubDeviceId(0), 1, SubDeviceId(4), 1),
        JunctionConnection::new(SubDeviceId(1), 1, SubDeviceId(3), 1),
    ];
    let place = |cable: usize, broken, breaks| {
        let (node, port, far) = match cable {
            1 => (0, 3, 1),
            2 => (1, 3, 2),
            3 => (2, 1, 3),
            _ => (1, 2, 4),
        };
        change(Some(PortOf::new(Position(node as u16), port)), PortOf::new(Position(far as u16), 0), broken, breaks)
    };
    let blocked = |blocked, breaks| Event::JunctionsBlocked { blocked, breaks };
    let settings = [(JunctionMode::Strict, &strict[..]), (JunctionMode::Automatic, &[])];
    for (number, (inner, outer)) in [(3, 5), (3, 1), (2, 5), (2, 1)].into_iter().enumerate() {
        let mut world = in_op(41, wired(&kinds, &cables), settings[number % 2]);
        let mark = world.mark();
        world.cut(CableId(inner));
        world.cut(CableId(outer));
        world.run_cycles(1_500);
        let what = format!("cables {inner} and {outer}: {:?}", reports(&world, mark));
        let begin = world.events(mark)[0].at;
        let placed = |timed: &&ringcat::TimedEvent| matches!(timed.event, Event::JunctionChanged { .. });
        let at = world.events(mark).iter().rfind(placed).map(|timed| timed.at.since(begin));
        assert!(at.is_some_and(|at| at < Duration::from_millis(100)), "{at:?} after the first event, {what}");
        let either = [[inner, outer], [outer, inner]]
            .map(|[one, other]| vec![blocked(true, 0), place(one, true, 1), place(other, true, 2)]);
        assert!(either.contains(&reports(&world, mark)), "{what}");
        assert!(!world.saw(mark, |event| matches!(event, Event::Lost { .. } | Event::LineCrossed { .. })), "{what}");
        let (first, second) = if number < 2 { (outer, inner) } else { (inner, outer) };
        let mark = world.mark();
        world.heal(CableId(first));
        world.until(Duration::from_secs(3), "all in OP", |w| w.all_in_op() && w.application().all_settled());
        world.run_cycles(100);
        assert_eq!(reports(&world, mark), [blocked(false, 2), place(first, false, 1)], "{what}");
        edge(&mut world, &what, |world| world.heal(CableId(second)));
    }
}

// covers: junctions
#[test]
fn two_breaks_in_one_ring_cut_off_only_the_part_between_them() {
    let mut world = in_op(4, one_ring(), (JunctionMode::Automatic, &[]));
    edge(&mut world, "first break", |world| world.cut(CableId(3)));
    let mark = world.mark();
    world.cut(CableId(4));
    world.until(Duration::from_millis(60), "3 is lost", |world| {
        world.saw(mark, |event| *event == Event::Lost { subdevice: SubDeviceId(3) })
    });
    world.run_cycles(200);
    let (near, far) = ends(4);
    assert_eq!(reports(&world, mark), [change(Some(near), far, true, 2)]);
    assert_eq!(world.evaluated(mark).last().map(|evaluated| evaluated.stale.clone()), Some(vec![3]));
    world.heal(CableId(3));
    world.until(Duration::from_secs(3), "all in OP", |world| world.all_in_op() && world.application().all_settled());
    edge(&mut world, "second repair", |world| world.heal(CableId(4)));
    let left: Vec<usize> = world.left_op(mark).iter().map(|device| device.0).collect();
    assert!(left.iter().all(|device| *device == 3), "{left:?}: the others continue");
    assert!(matches!(reports(&world, mark).last(), Some(Event::JunctionChanged { broken: false, breaks: 0, .. })));
}

// covers: junctions
#[test]
fn a_member_without_power_breaks_the_ring_at_both_ports_and_returns() {
    let mut world = in_op(5, one_ring(), (JunctionMode::Strict, &[STRICT]));
    let mark = world.mark();
    world.power_off(DeviceIndex(3));
    world.run_cycles(100);
    assert_eq!(reports(&world, mark).len(), 2);
    world.power_on(DeviceIndex(3));
    world.until(Duration::from_secs(5), "all in OP", |world| world.all_in_op() && world.application().all_settled());
    world.run_cycles(100);
    assert_eq!(reports(&world, mark).len(), 4);
    assert!(world.left_op(mark).iter().all(|device| device.0 == 3));
}

/// Devices of [`RING_IN_RING`]: an output, the junction, and an input.
fn ring_in_ring() -> Network {
    let kinds = ["digital-output-8", "junction", "servo", "digital-input-8", "analog-input-4"];
    wired(&kinds, &RING_IN_RING)
}

// covers: JR-02, junctions-in-ring
#[test]
fn a_local_ring_in_a_ring_of_two_links_tolerates_any_one_break() {
    let strict = JunctionConnection::new(SubDeviceId(1), 1, SubDeviceId(3), 1);
    for setting in [(JunctionMode::Automatic, &[][..]), (JunctionMode::Strict, &[strict])] {
        let mut world = in_op(8, ring_in_ring(), setting);
        for cable in 0..7 {
            let local = (2..5).contains(&cable);
            let what = format!("{setting:?}, cable {cable}");
            for heal in [false, true] {
                let act = |world: &mut World| if heal { world.heal(CableId(cable)) } else { world.cut(CableId(cable)) };
                let mark = edge(&mut world, &what, act);
                assert_eq!(reports(&world, mark).len(), usize::from(local), "{what}");
                let opened = world.saw(mark, |event| matches!(event, Event::RingOpened { .. }));
                assert_eq!(opened, !local && !heal, "{what}: the main ring has its own events");
            }
        }
        assert_eq!(crossed(&world, world.beginning()), 0);
        // Both in the half of the main interface: its frames pass one unconnected port 0, those of the other interface
        // too.
        edge(&mut world, "main ring behind the junction", |world| world.cut(CableId(5)));
        let mark = edge(&mut world, "local ring", |world| world.cut(CableId(3)));
        assert_eq!(reports(&world, mark).len(), 1);
        edge(&mut world, "local ring whole", |world| world.heal(CableId(3)));
        edge(&mut world, "main ring whole", |world| world.heal(CableId(5)));
        // In the half of the redundant interface its frames are destroyed; the other half continues.
        edge(&mut world, "main ring before the junction", |world| world.cut(CableId(1)));
        let mark = world.mark();
        world.cut(CableId(3));
        world.run_cycles(200);
        assert!(world.evaluated(mark).last().is_some_and(|evaluated| !evaluated.stale.is_empty()));
        assert!(!world.left_op(mark).contains(&DeviceIndex(0)));
        world.heal(CableId(3));
        world.until(Duration::from_secs(5), "all in OP", |w| w.all_in_op() && w.application().all_settled());
        edge(&mut world, "the last one", |world| world.heal(CableId(1)));
    }
}

/// Enhanced detection opens the ring of two links for a moment when ports change, and reports no crossing in a local
/// ring that is entered from behind.
// covers: LC-03, LC-06, crossed-enhanced
#[test]
fn a_broken_local_ring_is_no_crossed_line_for_enhanced_detection() {
    let strict = JunctionConnection::new(SubDeviceId(1), 1, SubDeviceId(3), 1);
    for (mode, connections) in [(JunctionMode::Automatic, &[][..]), (JunctionMode::Strict, &[strict])] {
        let options = Options::default().with_junctions(mode).with_enhanced_line_crossed(true);
        let declare = |scan: &ringcat::Scan| automatic(&scan.subdevices, CYCLE);
        let mut world = World::with_junctions(44, ring_in_ring(), &options, declare, connections).expect("it fits");
        world.settle();
        world.run_cycles(100);
        let lost_links =
            |world: &World| world.network().device(DeviceIndex(4)).controller.register(map::LOST_LINK_COUNTER, 4)[1];
        let before = lost_links(&world);
        for cable in 2..5 {
            for broken in [true, false] {
                let mark = world.mark();
                world.fault(if broken { Fault::Cut(CableId(cable)) } else { Fault::Heal(CableId(cable)) });
                world.run_cycles(200);
                let what = format!("{mode:?}, cable {cable}, broken: {broken}");
                assert_eq!((crossed(&world, mark), reports(&world, mark).len()), (0, 1), "{what}");
                assert_eq!(world.left_op(mark), [], "{what}");
                // The edge itself, the redundant link taken down, and brought up again.
                assert!(world.incomplete(mark) <= 3, "{what}: {}", world.incomplete(mark));
                let opened = |event: &Event| matches!(event, Event::RingOpened { .. });
                assert!(!world.saw(mark, opened), "{what}: a controlled break is not reported");
                assert_eq!(world.application().ring(), ringcat::RingState::Closed, "{what}");
            }
        }
        assert!(lost_links(&world) > before, "the redundant link was down in between");
    }
}

/// Two local rings break at once while enhanced detection holds the redundant link down: the link does not come back in
/// the usual time, since no frame comes back. The breaks are located nevertheless.
// covers: JR-02, LC-03, junctions
#[test]
fn breaks_of_two_rings_during_a_controlled_break_are_located_too() {
    let mut cables = TWO_RINGS.to_vec();
    cables.push((at(6, B), REDUNDANT));
    let options = Options::default().with_junctions(JunctionMode::Automatic).with_enhanced_line_crossed(true);
    let place = |cable: usize, breaks| {
        let (near, far) = ends_of_two(cable);
        change(Some(near), far, true, breaks)
    };
    for cycles in [1, 2, 4, 6, 8, 10, 14, 20, 30] {
        let declare = |scan: &ringcat::Scan| automatic(&scan.subdevices, CYCLE);
        let network = wired(&KINDS, &cables);
        let mut world = World::with_junctions(41, network, &options, declare, &[]).expect("scan and activation");
        world.settle();
        world.run_cycles(100);
        // Its ports change, so that the segment is scanned for crossed lines with the redundant link down.
        world.cut(CableId(2));
        world.run_cycles(100);
        world.heal(CableId(2));
        let mark = world.mark();
        world.run_cycles(cycles);
        world.cut(CableId(2));
        world.cut(CableId(6));
        // The first one was reported as broken before, and not yet as repaired.
        let is_located = |world: &World| reports(world, mark).contains(&place(6, 2));
        let begin = world.now();
        for _ in 0..400 {
            world.run_cycles(100);
            if is_located(&world) {
                break;
            }
        }
        println!(
            "cuts {cycles} cycles after the change: {:?} later: {:?}",
            world.now().since(begin),
            reports(&world, mark)
        );
        assert!(is_located(&world), "cuts {cycles} cycles after the change: {:?}", reports(&world, mark));
    }
}
