//! Rescan of the whole segment during process data exchange: places, new, moved and missing SubDevices.

use std::time::Duration;

use ringcat::{Event, Identified, Options, PortOf, Rescan, RingState, SubDeviceId, SubDeviceState, automatic};
use ringcat_sim::cable::{CableId, DeviceIndex, Endpoint};
use ringcat_sim::frame::Port;
use ringcat_sim::network::builder::SegmentBuilder;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::address::Position;
use ringcat_wire::al::AlState;
use scenarios::segments::{descriptions, devices, ring};
use scenarios::world::{CYCLE, World};

const LIMIT: Duration = Duration::from_secs(2);
const OP: SubDeviceState = SubDeviceState::Settled(AlState::Op);
/// Devices of [`workshop`] in the order of construction, and cables in the order of connection.
const MOVABLE: DeviceIndex = DeviceIndex(6);
const NEW: DeviceIndex = DeviceIndex(5);
const LEAVING: DeviceIndex = DeviceIndex(7);
const AT_THE_JUNCTION: CableId = CableId(6);
const AT_THE_END: CableId = CableId(8);

/// A junction with a line of three behind it, the last without power at first, and two branches of one device: the
/// first of them can be connected to the end of the line instead. All connected devices work.
fn workshop() -> Network {
    let kinds = ["coupler", "digital-input-8", "junction", "digital-output-8", "digital-input-16", "analog-input-4"];
    let branch = |kind: &str| devices(descriptions(&[kind]));
    let network = SegmentBuilder::line(devices(descriptions(&kinds)))
        .branch(DeviceIndex(2), Port::D, branch("digital-output-16"))
        .branch(DeviceIndex(2), Port::C, branch("digital-input-4"))
        .cable(Endpoint::Device(NEW, Port::B), Endpoint::Device(MOVABLE, Port::B))
        .options(NetworkOptions::default().with_detection_delay(Duration::from_micros(10)))
        .build();
    let mut network = network.expect("a segment can be built");
    network.power_off(NEW);
    network.cut(AT_THE_END);
    network
}

fn rescan(world: &mut World) -> Rescan {
    let mark = world.mark();
    let pending = world.application_mut().engine_mut().start_rescan(LIMIT);
    let rescan = world.finish(LIMIT, pending).expect("the segment holds still");
    assert_eq!(world.incomplete(mark), 0, "no working counter changes");
    assert_eq!(world.left_op(mark), []);
    rescan
}

/// Index in the declaration for each position.
fn declared(rescan: &Rescan) -> Vec<Option<usize>> {
    let index = |identified| if let Identified::Declared(index) = identified { Some(index.0) } else { None };
    rescan.subdevices.iter().map(|found| index(found.identified)).collect()
}

// covers: rescan
#[test]
fn a_rescan_finds_new_moved_and_missing_subdevices() {
    let declare = |scan: &ringcat::Scan| {
        let mut declaration = automatic(&scan.subdevices, CYCLE);
        // Processing order: coupler, input, junction, movable, output, input, leaving.
        declaration.subdevices[3].optional = true;
        declaration.subdevices[6].optional = true;
        declaration
    };
    let mut world = World::with(1, workshop(), &Options::default(), declare).expect("scan and activation");
    world.settle();
    world.evaluate_latched(false);
    let calm = rescan(&mut world);
    assert_eq!(declared(&calm), (0..7).map(Some).collect::<Vec<_>>());
    assert_eq!((calm.moved().count(), calm.missing.len(), calm.topology.nodes.len()), (0, 0, 7));

    let before = world.mark();
    world.power_on(NEW);
    world.run_cycles(50);
    let with_new = rescan(&mut world);
    assert_eq!(declared(&with_new)[4..], [Some(4), Some(5), None, Some(6)]);
    let Identified::Undeclared(identity) = with_new.subdevices[6].identified else { panic!("{with_new:?}") };
    assert_eq!(identity.product_code, world.network().device(NEW).description.identity.product_code);
    assert_eq!(
        (with_new.moved().count(), with_new.missing.len()),
        (0, 0),
        "a SubDevice in between does not move others"
    );
    assert_eq!(world.network().device(NEW).al_status().al_state(), Some(AlState::Init), "it is left alone");
    assert_eq!(world.incomplete(before), 0);

    // The cable is moved. The SubDevice keeps its power and its address.
    world.cut(AT_THE_JUNCTION);
    world.until(LIMIT, "gone", |world| world.application().states()[3] == SubDeviceState::Absent);
    world.heal(AT_THE_END);
    world.until(LIMIT, "back", |world| world.application().states()[3] == OP);
    world.run_cycles(50);
    let mark = world.mark();
    let moved = rescan(&mut world);
    let moves: Vec<_> = moved.moved().map(|it| (it.subdevice, it.from, it.to)).collect();
    assert_eq!(moves, [(SubDeviceId(3), Position(3), Position(6))]);
    let last = moved.topology.nodes[6];
    assert_eq!((last.parent, last.entry_port), (Some((5, 1)), 1), "behind the new one, crossed");
    let reports = Event::Moved { subdevice: SubDeviceId(3), from: Position(3), to: Position(6) };
    assert!(world.saw(mark, |event| *event == reports));

    world.power_off(LEAVING);
    world.until(LIMIT, "gone", |world| world.application().states()[6] == SubDeviceState::Absent);
    world.run_cycles(50);
    let gone = rescan(&mut world);
    assert_eq!((gone.missing.as_slice(), gone.subdevices.len()), ([SubDeviceId(6)].as_slice(), 7));
}

// covers: rescan
#[test]
fn a_rescan_of_a_changing_ring_ends_in_time_with_right_places() {
    let kinds = ["coupler", "digital-input-8", "digital-output-8", "digital-input-16", "digital-output-16"];
    let options = NetworkOptions::default().with_detection_delay(Duration::from_micros(10));
    let mut world = World::in_op(2, ring(descriptions(&kinds), options));
    let whole = rescan(&mut world);
    world.cut(CableId(2));
    world.run_cycles(50);
    let broken = rescan(&mut world);
    assert_eq!((whole.counts.main, broken.counts.main, broken.counts.redundant), (5, 2, 3));
    for rescan in [&whole, &broken] {
        assert_eq!(declared(rescan), (0..5).map(Some).collect::<Vec<_>>());
        assert_eq!((rescan.moved().count(), rescan.missing.len()), (0, 0));
    }
    // A plug with bad contact, faster than two scans.
    let limit = Duration::from_millis(200);
    let mut pending = world.application_mut().engine_mut().start_rescan(limit);
    let begin = world.application().now();
    let result = loop {
        world.heal(CableId(2));
        world.run_cycles(1);
        world.cut(CableId(2));
        world.run_cycles(1);
        if let Some(result) = pending.take() {
            break result;
        }
        assert!(world.application().now().since(begin) < 2 * limit, "it ends in time");
    };
    // Between two edges a complete scan is possible.
    assert!(matches!(&result, Ok(rescan) if rescan.is_complete()) || result.is_err(), "{result:?}");
    world.heal(CableId(2));
    world.settle();
}

/// Cables with damaged frames: positions of the ends and counts.
fn damaged(world: &World) -> Vec<(Option<usize>, Option<usize>, u64)> {
    let counted = world.application().engine().cable_errors();
    let damaged = counted.iter().filter(|it| it.errors.invalid_frames > 0);
    let node = |end: Option<PortOf>| end.map(|end| usize::from(end.position().0));
    damaged.map(|it| (node(it.cable.near), node(it.cable.far), it.errors.invalid_frames)).collect()
}

fn place(world: &World) -> Option<(Option<usize>, Option<usize>)> {
    let node = |end: Option<PortOf>| end.map(|end| usize::from(end.position().0));
    world.application().ring_status().place.map(|cable| (node(cable.near), node(cable.far)))
}

// covers: rescan
#[test]
fn after_a_rescan_breaks_and_errors_use_the_new_cabling() {
    const BRANCH: DeviceIndex = DeviceIndex(5);
    const BETWEEN: CableId = CableId(3);
    let kinds = ["coupler", "junction", "digital-input-8", "digital-output-8", "digital-input-16"];
    let network = SegmentBuilder::ring(devices(descriptions(&kinds)))
        .branch(DeviceIndex(1), Port::D, devices(descriptions(&["digital-output-16"])))
        .options(NetworkOptions::default().with_detection_delay(Duration::from_micros(10)))
        .build()
        .expect("a segment can be built");
    let declare = |scan: &ringcat::Scan| {
        let mut declaration = automatic(&scan.subdevices, CYCLE);
        // Processing order: coupler, junction, its branch, and the rest of the ring.
        declaration.subdevices[2].optional = true;
        declaration
    };
    let mut world = World::with(3, network, &Options::default(), declare).expect("scan and activation");
    world.settle();
    world.evaluate_latched(false);
    let damage = |world: &mut World| {
        for _ in 0..3 {
            world.corrupt(BETWEEN, 1);
            world.run_cycles(20);
        }
        // Counters are read once a second.
        world.run_cycles(1_600);
    };
    damage(&mut world);
    let first = damaged(&world);
    let [(Some(3), Some(4), before)] = first[..] else { panic!("{first:?}") };
    // The branch is unplugged: positions behind it are lower by one.
    world.power_off(BRANCH);
    world.until(LIMIT, "gone", |world| world.application().states()[2] == SubDeviceState::Absent);
    world.run_cycles(50);
    let gone = rescan(&mut world);
    assert_eq!((gone.missing.as_slice(), gone.moved().count()), ([SubDeviceId(2)].as_slice(), 0));
    assert_eq!(damaged(&world), [(Some(2), Some(3), before)], "the same cable keeps its count");
    damage(&mut world);
    let again = damaged(&world);
    assert!(matches!(again[..], [(Some(2), Some(3), now)] if now > before), "{again:?}");
    let located = |world: &mut World, at| {
        world.cut(BETWEEN);
        world.run_cycles(100);
        assert_eq!(place(world), Some(at));
        // While the ring is broken, the former cabling is kept.
        rescan(world);
        world.run_cycles(100);
        assert_eq!(place(world), Some(at));
        world.heal(BETWEEN);
        world.until(LIMIT, "closed", |world| world.application().ring_status().state == RingState::Closed);
        world.run_cycles(200);
        assert_eq!(place(world), None);
    };
    located(&mut world, (Some(2), Some(3)));
    // The ring is closed again, and the places are as before.
    world.power_on(BRANCH);
    world.until(LIMIT, "back", |world| world.application().states()[2] == OP);
    world.run_cycles(100);
    assert_eq!(declared(&rescan(&mut world)), (0..6).map(Some).collect::<Vec<_>>());
    located(&mut world, (Some(3), Some(4)));
}

/// In an open ring the processing order of a branch behind the port from which the ring continues is different (CR-09).
// covers: CR-09, CR-17, rescan
#[test]
fn a_break_that_changes_the_processing_order_moves_no_subdevice() {
    use ringcat_sim::frame::Port::{A, B, D};
    use scenarios::segments::{MAIN, REDUNDANT, at, wired};
    let cables =
        [(MAIN, at(0, A)), (at(0, D), at(1, A)), (at(1, B), at(2, A)), (at(2, B), REDUNDANT), (at(0, B), at(3, A))];
    let kinds = ["junction", "digital-input-8", "digital-output-8", "digital-input-16"];
    let mut world = World::in_op(0, wired(&kinds, &cables));
    for cable in (0..4).map(ringcat_sim::cable::CableId) {
        world.cut(cable);
        world.run_cycles(50);
        let mark = world.mark();
        let work = world.application_mut().engine_mut().start_rescan(LIMIT);
        let rescan = world.finish(2 * LIMIT, work).expect("it holds still");
        assert!(rescan.is_complete() && rescan.subdevices.len() == 4, "{cable:?}");
        assert_eq!(rescan.moved().count(), 0, "{cable:?}: {:?}", rescan.subdevices);
        assert!(!world.saw(mark, |event| matches!(event, Event::Moved { .. })), "{cable:?}");
        world.heal(cable);
        world.run_cycles(50);
    }
}

/// The branch on port 2 of a closed ring processes the redundant copy: this is not a break (CR-09).
// covers: CR-09, CR-17, rescan
#[test]
fn a_rescan_of_a_closed_ring_with_a_branch_on_port_2_gives_true_places() {
    use ringcat_sim::frame::Port::{A, B, D};
    use scenarios::segments::{MAIN, REDUNDANT, at, wired};
    const LEAVING: DeviceIndex = DeviceIndex(4);
    let cables = [
        (MAIN, at(0, A)),
        (at(0, D), at(1, A)),
        (at(1, B), at(2, A)),
        (at(2, B), REDUNDANT),
        (at(0, B), at(3, A)),
        (at(1, D), at(4, A)),
    ];
    let kinds = ["junction", "junction", "digital-output-8", "digital-input-16", "digital-output-16"];
    // Scanned in the closed ring, or in the open ring with another processing order.
    for open_at_scan in [None, Some(CableId(2)), Some(CableId(0))] {
        let mut network = wired(&kinds, &cables);
        open_at_scan.into_iter().for_each(|cable| network.cut(cable));
        let declare = |scan: &ringcat::Scan| {
            let mut declaration = automatic(&scan.subdevices, CYCLE);
            declaration.subdevices.iter_mut().for_each(|it| it.optional = true);
            declaration
        };
        let mut world = World::with(4, network, &Options::default(), declare).expect("scan and activation");
        world.settle();
        world.evaluate_latched(false);
        open_at_scan.into_iter().for_each(|cable| world.heal(cable));
        world.run_cycles(60);
        let mark = world.mark();
        let all = rescan(&mut world);
        assert_eq!((all.counts.main, all.counts.redundant), (4, 1), "{open_at_scan:?}");
        assert!(all.moved().count() == 0 && !world.saw(mark, |event| matches!(event, Event::Moved { .. })));
        // Order of the closed ring: 0, 1, the leaving SubDevice, 2, and the branch that processes the redundant copy.
        let located = |world: &mut World, between: CableId, at| {
            let mark = world.mark();
            world.cut(between);
            world.run_cycles(100);
            assert_eq!(place(world), Some(at), "{open_at_scan:?}");
            let reports = |event: &Event| matches!(event, Event::BreakLocated { .. });
            assert_eq!(world.events(mark).iter().filter(|timed| reports(&timed.event)).count(), 1);
            world.heal(between);
            world.until(LIMIT, "closed", |world| world.application().ring_status().state == RingState::Closed);
            world.run_cycles(100);
        };
        located(&mut world, CableId(2), (Some(1), Some(3)));
        world.power_off(LEAVING);
        world.until(LIMIT, "gone", |world| world.application().states().contains(&SubDeviceState::Absent));
        world.run_cycles(50);
        let gone = rescan(&mut world);
        assert_eq!((gone.subdevices.len(), gone.missing.len(), gone.moved().count()), (4, 1, 0));
        located(&mut world, CableId(2), (Some(1), Some(2)));
        world.power_on(LEAVING);
        world.until(LIMIT, "back", |world| world.application().all_settled() && world.all_in_op());
        world.run_cycles(50);
        rescan(&mut world);
        located(&mut world, CableId(2), (Some(1), Some(3)));
    }
}

/// An unassigned SubDevice identical to a declared one is part of the cabling; when the declared one leaves, it keeps
/// its place, and gets no outputs of the other.
// covers: CR-09, CR-17, rescan
#[test]
fn an_unassigned_subdevice_keeps_its_rescan_place_beside_a_lost_twin() {
    use ringcat_sim::frame::Port::{A, C, D};
    use scenarios::segments::{MAIN, at, wired};
    const FIRST: DeviceIndex = DeviceIndex(1);
    const SPARE: DeviceIndex = DeviceIndex(2);
    let mut network = wired(
        &["junction", "digital-output-16", "digital-output-16"],
        &[(MAIN, at(0, A)), (at(0, D), at(1, A)), (at(0, C), at(2, A))],
    );
    network.power_off(SPARE);
    let declare = |scan: &ringcat::Scan| {
        let mut declaration = automatic(&scan.subdevices, CYCLE);
        declaration.subdevices[1].optional = true;
        declaration
    };
    let mut world = World::with(5, network, &Options::default(), declare).expect("scan and activation");
    world.settle();
    world.evaluate_latched(false);
    world.power_on(SPARE);
    world.until(LIMIT, "reported", |world| {
        world.saw(world.beginning(), |event| matches!(event, Event::Unexpected { .. }))
    });
    assert_eq!(declared(&rescan(&mut world)), [Some(0), Some(1), None]);
    world.power_off(FIRST);
    world.run_cycles(1_600);
    assert_ne!(world.network().device(SPARE).al_status().al_state(), Some(AlState::Op));
    assert_eq!(world.application().states()[1], SubDeviceState::Absent);
    world.power_on(FIRST);
    // It is optional, so all are settled while it is absent, too.
    world.until(LIMIT, "back", |world| {
        world.network().device(FIRST).al_status().al_state() == Some(AlState::Op) && world.application().all_settled()
    });
    assert_ne!(world.network().device(SPARE).al_status().al_state(), Some(AlState::Op));
    let mark = world.mark();
    assert_eq!(declared(&rescan(&mut world)), [Some(0), Some(1), None]);
    assert!(!world.saw(mark, |event| matches!(event, Event::Moved { .. })));
}

/// A rescan has the segment for itself while it reads. One that is given up at any time gives that back.
// covers: rescan
#[test]
fn a_rescan_that_is_given_up_blocks_neither_the_next_one_nor_supervision() {
    let mut world =
        World::with(1, workshop(), &Options::default(), |scan| automatic(&scan.subdevices, CYCLE)).expect("a world");
    world.settle();
    for cycles in 0..6 {
        let given_up = world.application_mut().engine_mut().start_rescan(LIMIT);
        let waiting = world.application_mut().engine_mut().start_rescan(LIMIT);
        world.run_cycles(cycles);
        drop((waiting, given_up));
        assert!(rescan(&mut world).is_complete(), "{cycles} cycles");
    }
    // A SubDevice that comes needs an address, which waits for the end of rescans.
    let given_up = world.application_mut().engine_mut().start_rescan(LIMIT);
    world.power_on(NEW);
    world.run_cycles(1);
    drop(given_up);
    world.run_cycles(2_000);
    let found = rescan(&mut world);
    assert!(found.subdevices.iter().any(|found| matches!(found.identified, Identified::Undeclared(_))), "{found:?}");
}
