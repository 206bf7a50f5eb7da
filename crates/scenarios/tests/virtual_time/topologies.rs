//! Segments other than a plain line or ring: crossed cables, unconnected ports, branches; and the reports about them.

use std::time::Duration;

use ringcat::{Event, Link, Options, Redundancy, RedundancyLoss, RingState, SubDeviceId, TimedEvent, automatic};
use ringcat_sim::cable::{CableId, DeviceIndex};
use ringcat_sim::frame::Port;
use ringcat_sim::network::Network;
use ringcat_wire::register::{PortKind, map};
use scenarios::check::{Delivery, ring_events};
use scenarios::segments::{MAIN, REDUNDANT, at, descriptions, wired, wired_with};
use scenarios::world::{CYCLE, World};

/// Comes to OP and exchanges process data; inputs and outputs are compared.
fn in_op(network: Network) -> World {
    let mut world = World::in_op(0, network);
    let mark = world.mark();
    world.run_cycles(100);
    assert_eq!(world.incomplete(mark), 0);
    assert!(world.compared() > 0 && world.all_in_op());
    world
}

fn crossed(events: &[TimedEvent]) -> Vec<(Option<u16>, Option<u8>)> {
    let of = |timed: &TimedEvent| match timed.event {
        Event::LineCrossed { position, entry_port } => Some((position.map(|position| position.0), entry_port)),
        _ => None,
    };
    events.iter().filter_map(of).collect()
}

// covers: LC-01, LC-05, topology
#[test]
fn a_crossed_subdevice_in_a_line_is_located() {
    use Port::{A, B};
    let kinds = ["junction", "digital-output-8", "junction", "servo"];
    let cables = [(MAIN, at(0, A)), (at(0, B), at(1, A)), (at(1, B), at(2, B)), (at(2, A), at(3, A))];
    let world = in_op(wired(&kinds, &cables));
    // It processes frames on their way back, after the SubDevice connected to it (protocol 2.9).
    assert_eq!(crossed(world.events(world.beginning())), [(Some(3), Some(1))]);
    assert_eq!(world.device_of(3), Some(DeviceIndex(2)));
}

// covers: topology
#[test]
fn a_subdevice_without_a_cable_in_port_0_is_reported_and_works() {
    use Port::{A, B};
    let kinds = ["coupler", "digital-output-8", "servo"];
    let cables = [(MAIN, at(0, A)), (at(0, B), at(1, A)), (at(1, B), at(2, B))];
    let world = in_op(wired(&kinds, &cables));
    let reports = |event: &Event| matches!(event, Event::UnconnectedPort0 { position } if position.0 == 2);
    assert!(world.saw(world.beginning(), reports));
    assert_eq!(crossed(world.events(world.beginning())), [(Some(2), Some(1))]);
}

// covers: LC-07, topology
#[test]
fn a_crossed_subdevice_in_a_closed_ring_is_located_and_works() {
    use Port::{A, B};
    let kinds = ["junction", "digital-output-8", "servo", "digital-input-8"];
    let cables =
        [(MAIN, at(0, A)), (at(0, B), at(1, A)), (at(1, B), at(2, B)), (at(2, A), at(3, A)), (at(3, B), REDUNDANT)];
    let mut world = in_op(wired(&kinds, &cables));
    // The only SubDevice that processes the redundant copy.
    assert_eq!(crossed(world.events(world.beginning())), [(Some(3), Some(1))]);
    assert_eq!(world.device_of(3), Some(DeviceIndex(2)));
    for cable in 0..cables.len() {
        let mark = world.mark();
        world.cut(CableId(cable));
        world.run_cycles(60);
        assert_eq!(
            world.evaluated(mark).last().map(|evaluated| evaluated.delivery),
            Some(Delivery::Complete),
            "cable {cable}"
        );
        world.heal(CableId(cable));
        world.run_cycles(60);
        assert_eq!(world.left_op(mark), []);
        assert!(world.incomplete(mark) <= 2, "cable {cable}: {}", world.incomplete(mark));
        assert!(ring_events(world.events(mark)).len() >= 2);
    }
}

/// A SubDevice with one port cannot be part of a ring (CR-22): the SubDevices behind it are permanently reached over
/// the redundant link, and a break there cuts off those behind the break.
// covers: CR-22, topology
#[test]
fn a_subdevice_with_one_port_leaves_the_ring_open_which_is_reported() {
    use Port::{A, B};
    let mut descriptions = descriptions(&["digital-output-8", "digital-input-8", "servo", "digital-input-16"]);
    descriptions[1].ports[1..].fill(PortKind::NotImplemented);
    let cables = [(MAIN, at(0, A)), (at(0, B), at(1, A)), (at(2, B), at(3, A)), (at(3, B), REDUNDANT)];
    let mut world = in_op(wired_with(descriptions, &cables));
    let status = world.application().ring_status();
    assert_eq!(
        (status.state, status.link(Link::Main).answering, status.link(Link::Redundant).answering),
        (RingState::Open, 2, 2)
    );
    assert!(matches!(status.redundancy, Redundancy::Lost { cause: RedundancyLoss::Open, .. }));
    let reports = |event: &Event| matches!(event, Event::RingOpened { main: 2, redundant: 2 });
    assert!(world.saw(world.beginning(), reports));
    let mark = world.mark();
    world.cut(CableId(2));
    world.run_cycles(100);
    assert!(
        world.saw(mark, |event| *event == Event::Lost { subdevice: SubDeviceId(2) }),
        "there is no second way to it"
    );
    world.heal(CableId(2));
    world.until(Duration::from_secs(3), "all in OP", |world| world.all_in_op() && world.application().all_settled());
    assert_eq!(world.left_op(mark).iter().filter(|device| device.0 != 2).count(), 0);
}

/// A ring of five with a branch of two on a port of its second device. Cables 0 to 5 belong to the ring, 6 to the
/// branch.
pub(crate) fn ring_with_branch(port: Port) -> Network {
    use Port::{A, B};
    let kinds = ["digital-output-8", "junction", "servo", "coupler", "digital-input-8", "block", "analog-input-4"];
    let cables = [
        (MAIN, at(0, A)),
        (at(0, B), at(1, A)),
        (at(1, B), at(2, A)),
        (at(2, B), at(3, A)),
        (at(3, B), at(4, A)),
        (at(4, B), REDUNDANT),
        (at(1, port), at(5, A)),
        (at(5, B), at(6, A)),
    ];
    wired(&kinds, &cables)
}

// covers: topology
#[test]
fn a_ring_with_a_branch_keeps_all_in_op_when_any_cable_of_the_ring_is_cut() {
    // On port 2 the branch processes the redundant copy even in a closed ring (protocol 2.9).
    for port in [Port::C, Port::D] {
        let mut world = in_op(ring_with_branch(port));
        for cable in 0..6 {
            let mark = world.mark();
            world.cut(CableId(cable));
            world.run_cycles(60);
            assert_eq!(world.evaluated(mark).last().map(|evaluated| evaluated.delivery), Some(Delivery::Complete));
            world.heal(CableId(cable));
            world.run_cycles(60);
            assert_eq!(world.left_op(mark), [], "branch on {port:?}, cable {cable}");
            assert!(world.incomplete(mark) <= 2, "branch on {port:?}, cable {cable}: {}", world.incomplete(mark));
            let opened = world.events(mark).iter().filter(|t| matches!(t.event, Event::RingOpened { .. })).count();
            let closed = world.events(mark).iter().filter(|t| matches!(t.event, Event::RingClosed { .. })).count();
            assert_eq!((opened, closed), (1, 1), "branch on {port:?}, cable {cable}");
        }
    }
}

#[test]
fn a_branch_that_is_cut_off_returns_while_the_ring_continues() {
    for port in [Port::C, Port::D] {
        let mut world = in_op(ring_with_branch(port));
        for gap in [30, 400] {
            let mark = world.mark();
            world.cut(CableId(6));
            world.run_cycles(gap);
            let stale = &world.evaluated(mark).last().expect("cycles went by").stale;
            let names: Vec<_> = stale.iter().filter_map(|subdevice| world.device_of(*subdevice)).collect();
            assert!(names.iter().all(|device| [5, 6].contains(&device.0)), "{names:?} are stale");
            world.heal(CableId(6));
            world.until(Duration::from_secs(3), "all in OP", |world| {
                world.all_in_op() && world.application().all_settled()
            });
            world.run_cycles(50);
            assert!(world.left_op(mark).iter().all(|device| [5, 6].contains(&device.0)));
            assert_eq!(ring_events(world.events(mark)), Vec::<&Event>::new());
        }
    }
}

#[test]
fn a_tree_comes_to_op_and_its_branches_do_not_depend_on_each_other() {
    use Port::{A, B, C, D};
    let kinds =
        ["junction", "coupler", "digital-output-8", "junction", "servo", "digital-input-8", "block", "analog-output-4"];
    let cables = [
        (MAIN, at(0, A)),
        (at(0, D), at(1, A)),
        (at(1, B), at(2, A)),
        (at(0, B), at(3, A)),
        (at(3, D), at(4, A)),
        (at(3, C), at(5, A)),
        (at(0, C), at(6, A)),
        (at(6, B), at(7, A)),
    ];
    let mut world = in_op(wired(&kinds, &cables));
    for (cable, behind) in [(1, vec![1, 2]), (3, vec![3, 4, 5]), (6, vec![6, 7]), (4, vec![4])] {
        let mark = world.mark();
        world.cut(CableId(cable));
        world.run_cycles(300);
        let lost = world.events(mark).iter().filter(|timed| matches!(timed.event, Event::Lost { .. })).count();
        assert_eq!(lost, behind.len(), "cable {cable}");
        world.heal(CableId(cable));
        world
            .until(Duration::from_secs(3), "all in OP", |world| world.all_in_op() && world.application().all_settled());
        world.run_cycles(30);
        assert!(world.left_op(mark).iter().all(|device| behind.contains(&device.0)));
        assert_eq!(world.evaluated(mark).last().map(|evaluated| evaluated.delivery), Some(Delivery::Complete));
    }
}

/// A ring of four with the third SubDevice crossed, and a branch that processes only the redundant copy: a closed ring
/// does not show which of the two is crossed.
fn crossed_ring() -> Network {
    use Port::{A, B, C};
    let kinds = ["junction", "digital-output-8", "servo", "digital-input-8", "coupler"];
    let cables = [
        (MAIN, at(0, A)),
        (at(0, B), at(1, A)),
        (at(1, B), at(2, B)),
        (at(2, A), at(3, A)),
        (at(3, B), REDUNDANT),
        (at(0, C), at(4, A)),
    ];
    wired(&kinds, &cables)
}

fn enhanced(network: Network) -> World {
    let options = Options::default().with_enhanced_line_crossed(true);
    let declare = |scan: &ringcat::Scan| automatic(&scan.subdevices, CYCLE);
    let mut world = World::with(0, network, &options, declare).expect("scan and activation");
    world.settle();
    world
}

// covers: LC-02, crossed-enhanced
#[test]
fn without_enhanced_detection_a_closed_ring_shows_a_crossing_without_place() {
    let world = in_op(crossed_ring());
    assert_eq!(world.application().ring(), RingState::Closed);
    assert_eq!(crossed(world.events(world.beginning())), [(None, None)]);
}

// covers: LC-03, crossed-enhanced
#[test]
fn enhanced_detection_locates_crossings_at_the_scan_and_closes_the_ring_again() {
    let world = enhanced(crossed_ring());
    let found = crossed(world.events(world.beginning()));
    let positions: Vec<Option<usize>> =
        found.iter().map(|(position, _)| world.device_of(usize::from(position.unwrap())).map(|it| it.0)).collect();
    assert_eq!((positions, found[0].1), (vec![Some(2)], Some(1)));
    assert_eq!(world.application().ring(), RingState::Closed);
}

// covers: LC-04, crossed-enhanced
#[test]
fn a_branch_on_port_2_of_a_closed_ring_is_suspicious_until_the_ring_is_opened() {
    let suspicious = in_op(ring_with_branch(Port::C));
    assert_eq!(crossed(suspicious.events(suspicious.beginning())), [(None, None)]);
    let known = enhanced(ring_with_branch(Port::C));
    assert_eq!(crossed(known.events(known.beginning())), []);
}

/// Number of lost links of the device at the redundant link.
fn lost_links(world: &World) -> u8 {
    world.network().device(DeviceIndex(4)).controller.register(map::LOST_LINK_COUNTER, 4)[1]
}

// covers: LC-03, crossed-enhanced
#[test]
fn enhanced_detection_repeats_when_ports_change_and_costs_two_edges() {
    let mut world = enhanced(ring_with_branch(Port::D));
    world.run_cycles(100);
    // The branch is unplugged: ports change, the ring stays closed.
    let (mark, before) = (world.mark(), lost_links(&world));
    world.cut(CableId(7));
    world.run_cycles(60);
    world.heal(CableId(7));
    world.until(Duration::from_secs(3), "all in OP", |world| world.all_in_op() && world.application().all_settled());
    world.run_cycles(200);
    assert_eq!(crossed(world.events(mark)), []);
    assert_eq!(ring_events(world.events(mark)), Vec::<&Event>::new(), "a controlled break is not reported");
    assert_eq!(world.application().ring(), RingState::Closed);
    assert!(world.left_op(mark).iter().all(|device| device.0 == 6));
    assert!(lost_links(&world) > before, "the redundant link was down in between");
}

// covers: LC-02, crossed-enhanced
#[test]
fn links_that_cannot_be_taken_down_fall_back_to_simple_detection() {
    let options = Options::default().with_enhanced_line_crossed(true);
    let mut tap = scenarios::tap::Tap::new(ring_with_branch(Port::C));
    tap.forbid_disconnecting();
    let mut main_device = ringcat::MainDevice::request(tap, &options);
    let mut events = Vec::new();
    main_device.scan_with(|event| events.push(event.clone())).expect("the segment answers");
    assert_eq!(crossed(&events), [(None, None)]);
    let reports = |timed: &TimedEvent| timed.event == Event::CannotDisconnect { link: Link::Redundant };
    assert_eq!(events.iter().filter(|timed| reports(timed)).count(), 1);
}
