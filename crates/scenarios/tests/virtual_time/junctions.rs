//! Rings behind junctions on one link (protocol 9.4): every cable cut and repaired, in every mode.

mod application_begins;
mod closed_ports;
mod declared;
mod explorer;
mod groups;
mod interrupted;
mod learning;
mod plans;
mod second_breaks;
mod sizes;

use std::time::Duration;

use ringcat::Position;
use ringcat::{Event, JunctionConnection, JunctionMode, Limits, Options, SdoAddress, SubDeviceId, automatic};
use ringcat_engine::PortOf;
use ringcat_engine::mail::coe;
use ringcat_sim::cable::{CableId, DeviceIndex, Endpoint};
use ringcat_sim::frame::Port::{A, B, C, D};
use ringcat_sim::network::Network;
use scenarios::check::{Delivery, troubles};
use scenarios::dice::Dice;
use scenarios::segments::{MAIN, REDUNDANT, RING_BEHIND_JUNCTION, RING_OF_THREE as RING, at, wired};
use scenarios::world::{CYCLE, Mark, World};

/// A mode and its connections.
type Setting<'a> = (JunctionMode, &'a [JunctionConnection]);

/// Devices of [`RING_BEHIND_JUNCTION`]: an output, the junction. Only some of them have clocks.
const ONE: [&str; 7] =
    ["digital-output-8", "junction", "servo", "digital-input-8", "block", "coupler", "analog-input-4"];
const STRICT: JunctionConnection = JunctionConnection::new(SubDeviceId(1), 1, SubDeviceId(4), 1);

fn one_ring() -> Network {
    wired(&ONE, &RING_BEHIND_JUNCTION)
}

/// Both ends of a cable of [`one_ring`]'s ring, as events name them.
fn ends(cable: usize) -> (PortOf, PortOf) {
    let port = |node, port| PortOf::new(Position(node as u16), port);
    match cable {
        2 => (port(1, 3), port(2, 0)),
        5 => (port(4, 1), port(1, 1)),
        cable => (port(cable - 1, 1), port(cable, 0)),
    }
}

fn world(seed: u64, network: Network, (mode, connections): Setting<'_>) -> World {
    let options = Options::default().with_junctions(mode);
    let declare = |scan: &ringcat::Scan| automatic(&scan.subdevices, CYCLE);
    World::with_junctions(seed, network, &options, declare, connections).unwrap_or_else(|error| panic!("{error}"))
}

fn in_op(seed: u64, network: Network, setting: Setting<'_>) -> World {
    let mut world = world(seed, network, setting);
    world.settle();
    world.run_cycles(20);
    assert!(world.all_in_op());
    world
}

/// Events about local rings since a point.
fn reports(world: &World, mark: Mark) -> Vec<Event> {
    let events = world.events(mark).iter().map(|timed| timed.event.clone());
    let of_junctions = |event: &Event| matches!(event, Event::JunctionChanged { .. } | Event::JunctionsBlocked { .. });
    events.filter(of_junctions).map(without_names).collect()
}

/// A change of a cable between these ends, without the SubDevices there.
fn change(near: Option<PortOf>, far: PortOf, broken: bool, breaks: usize) -> Event {
    Event::JunctionChanged { near, far, station: None, declared: [None; 2], broken, breaks }
}

fn without_names(event: Event) -> Event {
    match event {
        Event::JunctionChanged { near, far, broken, breaks, .. } => change(near, far, broken, breaks),
        other => other,
    }
}

fn crossed(world: &World, mark: Mark) -> usize {
    world.events(mark).iter().filter(|timed| matches!(timed.event, Event::LineCrossed { .. })).count()
}

fn changed(cable: usize, broken: bool) -> Event {
    let (near, far) = ends(cable);
    change(Some(near), far, broken, usize::from(broken))
}

/// One edge in OP: no SubDevice leaves OP, at most one cycle is incomplete, process data is complete again.
fn edge(world: &mut World, what: &str, act: impl FnOnce(&mut World)) -> Mark {
    let mark = world.mark();
    act(world);
    world.run_cycles(120);
    assert_eq!(world.left_op(mark), [], "{what}");
    assert_eq!(troubles(world.events(mark)), Vec::<&Event>::new(), "{what}");
    assert!(world.incomplete(mark) <= 1, "{what}: {} cycles", world.incomplete(mark));
    assert_eq!(world.evaluated(mark).last().map(|evaluated| evaluated.delivery), Some(Delivery::Complete), "{what}");
    mark
}

// covers: JR-01, JR-07, junctions
#[test]
fn each_cable_of_a_ring_behind_a_junction_is_cut_and_repaired_in_op() {
    for setting in [(JunctionMode::Automatic, &[][..]), (JunctionMode::Strict, &[STRICT])] {
        let mut world = in_op(1, one_ring(), setting);
        assert_eq!(reports(&world, world.beginning()), [], "it is whole");
        for cable in RING {
            for phase in [0, 40, 500] {
                let what = format!("{setting:?}, cable {cable}, phase {phase}");
                let cut = |world: &mut World| {
                    world.fault_in(CYCLE * phase / 1000, ringcat_sim::fault::Fault::Cut(CableId(cable)))
                };
                let mark = edge(&mut world, &what, cut);
                assert_eq!(reports(&world, mark), [changed(cable, true)], "{what}");
                let heal = |world: &mut World| {
                    world.fault_in(CYCLE * phase / 1000, ringcat_sim::fault::Fault::Heal(CableId(cable)))
                };
                let mark = edge(&mut world, &what, heal);
                assert_eq!(reports(&world, mark), [changed(cable, false)], "{what}");
            }
        }
        assert_eq!(crossed(&world, world.beginning()), 0, "LC-06");
        assert!(world.compared() > 10_000);
    }
}

// covers: JR-03, junctions
#[test]
fn a_ring_behind_a_junction_broken_from_the_start_is_reported() {
    for setting in [(JunctionMode::Automatic, &[][..]), (JunctionMode::Strict, &[STRICT])] {
        for cable in RING {
            let mut network = one_ring();
            network.cut(CableId(cable));
            let mut world = in_op(2, network, setting);
            world.run_cycles(100);
            let what = format!("{setting:?}, cable {cable}");
            let reported_then = reports(&world, world.beginning());
            assert_eq!(troubles(world.events(world.beginning())), Vec::<&Event>::new(), "{what}");
            assert_eq!(crossed(&world, world.beginning()), 0, "{what}");
            if cable == 5 && setting.0 == JunctionMode::Automatic {
                assert_eq!(reported_then, [], "nothing shows that there could be a ring");
                continue;
            }
            let (near, far) = ends(cable);
            // The SubDevice before the break is not known yet, but the closing cable was declared.
            let near = (cable == 5).then_some(near);
            assert_eq!(reported_then, [change(near, far, true, 1)], "{what}");
            let mark = edge(&mut world, &what, |world| world.heal(CableId(cable)));
            assert_eq!(reports(&world, mark), [change(near, far, false, 0)], "{what}");
            // Afterwards the whole ring is known.
            for cable in RING {
                let mark = edge(&mut world, &what, |world| world.cut(CableId(cable)));
                assert_eq!(reports(&world, mark), [changed(cable, true)], "{what}");
                edge(&mut world, &what, |world| world.heal(CableId(cable)));
            }
        }
    }
}

/// Events about unknown rings since a point.
fn unknown(world: &World, mark: Mark) -> Vec<usize> {
    let rings = |timed: &ringcat::TimedEvent| match timed.event {
        Event::JunctionUnknown { rings } => Some(rings),
        _ => None,
    };
    world.events(mark).iter().filter_map(rings).collect()
}

// covers: JR-03, JR-09, junctions
#[test]
fn a_ring_closed_after_the_scan_is_reported_unknown_unless_declared() {
    for (setting, expected) in [
        ((JunctionMode::Automatic, &[][..]), vec![1]),
        ((JunctionMode::Strict, &[STRICT]), vec![]),
        ((JunctionMode::Disabled, &[]), vec![]),
    ] {
        let mut network = one_ring();
        network.cut(CableId(5));
        let mut world = in_op(10, network, setting);
        world.run_cycles(60);
        let what = format!("{setting:?}");
        let mark = edge(&mut world, &what, |world| world.heal(CableId(5)));
        assert_eq!(unknown(&world, mark), expected, "{what}");
        // Its breaks cost as much as those of a known ring, and are reported as in JR-04, or by their place.
        let mark = edge(&mut world, &what, |world| world.cut(CableId(3)));
        let is_known = setting.0 == JunctionMode::Strict;
        assert_eq!(
            (reports(&world, mark).len(), crossed(&world, mark)),
            if is_known { (1, 0) } else { (0, 1) },
            "{what}"
        );
        let mark = edge(&mut world, &what, |world| world.heal(CableId(3)));
        assert_eq!(unknown(&world, mark), [], "{what}: it was reported");
    }
}

// covers: JR-03, JR-05, junctions
#[test]
fn a_declared_connection_enables_junction_redundancy_disabled_by_default() {
    assert_eq!(Options::default().junctions, JunctionMode::Disabled);
    let mut world = in_op(11, one_ring(), (JunctionMode::Disabled, &[STRICT]));
    let mark = edge(&mut world, "cut", |world| world.cut(CableId(3)));
    assert_eq!((reports(&world, mark), crossed(&world, mark)), (vec![changed(3, true)], 0));
    let mark = edge(&mut world, "heal", |world| world.heal(CableId(3)));
    assert_eq!((reports(&world, mark), crossed(&world, mark)), (vec![changed(3, false)], 0));
}

// covers: junctions
#[test]
fn a_ring_behind_a_junction_that_breaks_during_start_up_comes_to_op() {
    for at_us in (0..60_000).step_by(4_000) {
        for cable in [2, 4, 5] {
            let mut network = one_ring();
            network.schedule(
                ringcat_sim::time::SimTime::from_micros(at_us),
                ringcat_sim::fault::Fault::Cut(CableId(cable)),
            );
            let mut world = in_op(at_us, network, (JunctionMode::Strict, &[STRICT]));
            world.run_cycles(50);
            let reports = reports(&world, world.beginning());
            assert_eq!(reports.len(), 1, "cut at {at_us} us: {reports:?}");
            let lost = world.saw(world.beginning(), |event| matches!(event, Event::Lost { .. }));
            assert!(!lost, "cut at {at_us} us, cable {cable}");
        }
    }
}

#[test]
fn a_cut_of_the_line_loses_subdevices_without_a_ring_event() {
    let mut world = in_op(6, one_ring(), (JunctionMode::Automatic, &[]));
    let mark = world.mark();
    world.cut(CableId(6));
    world.run_cycles(200);
    assert_eq!(reports(&world, mark), []);
    for subdevice in 0..7 {
        assert_eq!(
            world.saw(mark, |event| *event == Event::Lost { subdevice: SubDeviceId(subdevice) }),
            subdevice >= 5
        );
    }
    world.heal(CableId(6));
    world.until(Duration::from_secs(3), "all in OP", |world| world.all_in_op() && world.application().all_settled());
    assert!(world.left_op(mark).iter().all(|device| device.0 >= 5));
}

// covers: JR-04, crossed-lines
#[test]
fn without_junction_redundancy_a_broken_local_ring_is_a_crossed_line() {
    for cable in [2, 3, 4] {
        let mut world = in_op(7, one_ring(), (JunctionMode::Disabled, &[]));
        assert_eq!(crossed(&world, world.beginning()), 0);
        let mark = edge(&mut world, "cut", |world| world.cut(CableId(cable)));
        assert_eq!(reports(&world, mark), []);
        let reversed = |event: &Event| {
            matches!(event, Event::LineCrossed { position: Some(at), entry_port: Some(1) }
            if usize::from(at.0) == cable)
        };
        assert!(world.saw(mark, reversed), "cable {cable}: the SubDevice behind the break is entered at port 1");
        let mark = edge(&mut world, "heal", |world| world.heal(CableId(cable)));
        assert_eq!(crossed(&world, mark), 0);
        // It is reported again when it occurs again.
        let mark = edge(&mut world, "cut again", |world| world.cut(CableId(cable)));
        assert!(world.saw(mark, reversed));
    }
}

/// A random segment with a local ring: a line of terminals and junctions, one of them with the ring, with branches and
/// members. Returns the segment, the numbers of the ring's cables, and whether it ends at the redundant link.
fn random_segment(dice: &mut Dice) -> (Network, Vec<usize>, bool) {
    let pick =
        |dice: &mut Dice| *dice.pick(&["digital-output-8", "digital-input-8", "servo", "analog-input-4", "block"]);
    let (mut kinds, mut cables) = (Vec::new(), Vec::new());
    let mut end = MAIN;
    let hang = |kinds: &mut Vec<&str>, cables: &mut Vec<(Endpoint, Endpoint)>, kind, from| {
        cables.push((from, at(kinds.len(), A)));
        kinds.push(kind);
        kinds.len() - 1
    };
    for _ in 0..dice.below(3) {
        let kind = pick(dice);
        end = at(hang(&mut kinds, &mut cables, kind, end), B);
    }
    let junction = hang(&mut kinds, &mut cables, "junction", end);
    let (start, back) = *dice.pick(&[(D, B), (D, C), (B, C)]);
    let mut ring = vec![cables.len()];
    let mut last = at(junction, start);
    for _ in 0..1 + dice.below(4) {
        ring.push(cables.len());
        if dice.one_in(3) {
            // A member with a branch on port 3.
            let member = hang(&mut kinds, &mut cables, "junction", last);
            let kind = pick(dice);
            hang(&mut kinds, &mut cables, kind, at(member, D));
            last = at(member, B);
        } else {
            let kind = pick(dice);
            last = at(hang(&mut kinds, &mut cables, kind, last), B);
        }
    }
    ring.push(cables.len());
    ring.dedup();
    cables.push((last, at(junction, back)));
    let mut end = at(junction, C);
    let goes_on = back == B;
    for _ in 0..if goes_on { 1 + dice.below(3) } else { 0 } {
        let kind = pick(dice);
        end = at(hang(&mut kinds, &mut cables, kind, end), B);
    }
    let two_links = goes_on && dice.one_in(2);
    if two_links {
        cables.push((end, REDUNDANT));
    }
    (wired(&kinds, &cables), ring, two_links)
}

// covers: junctions-in-ring
#[test]
fn random_segments_with_a_local_ring_work_alike_with_one_break() {
    for seed in 0..12 {
        let dice = &mut Dice::new(seed);
        let (network, ring, two_links) = random_segment(dice);
        let cables = network.cables().len();
        let mut world = in_op(seed, network, (JunctionMode::Automatic, &[]));
        assert_eq!(world.application().ring() == ringcat::RingState::Closed, two_links);
        let learned = |event: &Event| matches!(event, Event::JunctionLearned { .. });
        assert!(world.saw(world.beginning(), learned), "seed {seed}");
        let before = world.compared();
        for cable in (0..cables).filter(|cable| ring.contains(cable)) {
            let what = format!("seed {seed}, cable {cable}");
            let mark = edge(&mut world, &what, |world| world.cut(CableId(cable)));
            assert_eq!(reports(&world, mark).len(), 1, "{what}");
            edge(&mut world, &what, |world| world.heal(CableId(cable)));
        }
        assert!(world.compared() > before);
    }
}

// covers: junctions-in-ring
#[test]
fn transfers_continue_through_cuts_and_repairs_of_a_local_ring() {
    let mut world = in_op(9, one_ring(), (JunctionMode::Strict, &[STRICT]));
    let limits: Limits = Limits::new(Duration::from_millis(100), Duration::from_secs(1));
    let object = SdoAddress::new(0x8000, 3);
    // One SubDevice in the ring, one behind it.
    for (subdevice, round) in [(6, 0), (6, 1), (6, 2), (6, 3)] {
        let cable = CableId(RING[round]);
        let mark = world.mark();
        world.fault_in(CYCLE * 2 / 3, ringcat_sim::fault::Fault::Cut(cable));
        world.fault_in(CYCLE * 15, ringcat_sim::fault::Fault::Heal(cable));
        for number in 0..12u8 {
            let data = [number; 16];
            let mailbox = world.mailbox(subdevice);
            world
                .run(async move { coe::write(&mailbox, object, &data, limits).await })
                .expect("a break loses no request");
            let device = world.network().device(DeviceIndex(subdevice));
            assert_eq!(device.application.dictionary().read(0x8000, 3), Ok(data.as_slice()));
        }
        world.run_cycles(100);
        assert_eq!(world.left_op(mark), []);
        assert_eq!(reports(&world, mark).len(), 2, "{cable:?}");
    }
}

/// Ports change while other procedures than their supervision read them: the scan for crossed lines, and the clocks.
/// Their reads clear the event of the change.
// covers: JR-07, junctions
#[test]
fn a_repair_right_after_a_break_is_reported_despite_other_port_reads() {
    for with_clocks in [false, true] {
        let declare = |scan: &ringcat::Scan| {
            let mut declaration = automatic(&scan.subdevices, CYCLE);
            declaration.clocks = with_clocks.then(ringcat::ClockConfig::default);
            declaration
        };
        let options = Options::default().with_junctions(JunctionMode::Strict);
        let mut world = World::with_junctions(70, one_ring(), &options, declare, &[STRICT]).expect("it fits");
        world.settle();
        world.run_cycles(300);
        for after_us in (2_000..14_000).step_by(400) {
            let cable = RING[after_us as usize / 400 % RING.len()];
            let mark = world.mark();
            world.cut(CableId(cable));
            world.fault_in(Duration::from_micros(after_us), ringcat_sim::fault::Fault::Heal(CableId(cable)));
            world.run_cycles(120);
            let what = format!("after {after_us} us, clocks: {with_clocks}");
            assert_eq!(reports(&world, mark), [changed(cable, true), changed(cable, false)], "{what}");
        }
    }
}
