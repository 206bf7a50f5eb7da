//! Events and status of a ring: each edge once with counts and place (CR-12), links and counts at any time (CR-13),
//! redundancy separate from bus faults, flapping cables.

use std::time::Duration;

use ringcat::{Event, Link, Redundancy, RedundancyLoss, RingState, SubDeviceId, TimedEvent};
use ringcat_sim::cable::{CableId, DeviceIndex, Direction};
use ringcat_sim::fault::Fault;
use ringcat_sim::network::NetworkOptions;
use ringcat_wire::al::AlState;
use scenarios::check::{ring_events, troubles};
use scenarios::dice::Dice;
use scenarios::segments::{SIXTEEN, cable_of_ring, descriptions, ring, ring_of_16};
use scenarios::world::{CYCLE, World};

const COUNT: u16 = SIXTEEN.len() as u16;
const FAST: Duration = Duration::from_micros(10);
/// From the first frame that shows a break to the event: within this part of a cycle.
const PROMPT: Duration = CYCLE;
/// From there to the place of the break.
const PLACED: Duration = Duration::from_millis(5);

/// A ring of four.
fn small(seed: u64) -> World {
    let kinds = ["coupler", "digital-output-8", "digital-input-8", "servo"];
    World::in_op(seed, ring(descriptions(&kinds), NetworkOptions::default().with_detection_delay(FAST)))
}

/// Events about redundancy and carriers.
fn others(events: &[TimedEvent]) -> Vec<Event> {
    let wanted = |event: &&Event| {
        matches!(
            event,
            Event::RedundancyLost { .. }
                | Event::RedundancyRegained
                | Event::LinkDown { .. }
                | Event::LinkUp { .. }
                | Event::RingUnsteady { .. }
        )
    };
    events.iter().map(|timed| &timed.event).filter(wanted).cloned().collect()
}

// covers: CR-11, CR-12, ring-events
#[test]
fn each_edge_is_reported_in_its_cycle_and_located_within_five() {
    let mut world = World::in_op(1, ring_of_16(FAST));
    let (mut slowest, mut slowest_place) = (Duration::ZERO, Duration::ZERO);
    for cable in 0..=usize::from(COUNT) {
        for phase in [0, 40, 300, 800] {
            world.run_cycles(500);
            world.fault_in(CYCLE * phase / 1000, Fault::Cut(CableId(cable)));
            let mark = world.mark();
            let mut shown = None;
            for _ in 0..30 {
                world.cycle();
                if shown.is_none() && world.application().ring() == RingState::Open {
                    // The frames of the cycle before showed it.
                    shown = Some(world.application().now());
                }
            }
            let (main, redundant) = (cable as u16, COUNT - cable as u16);
            let expected =
                [Event::RingOpened { main, redundant }, Event::BreakLocated { cable: cable_of_ring(cable, 16) }];
            assert_eq!(ring_events(world.events(mark)), expected.iter().collect::<Vec<_>>(), "cable {cable}, {phase}");
            let shown = shown.expect("the ring is open");
            let at = |wanted: &Event| {
                let event = world.events(mark).iter().find(|timed| timed.event == *wanted).expect("it was reported");
                event.at.since(shown)
            };
            slowest = slowest.max(at(&expected[0]));
            slowest_place = slowest_place.max(at(&expected[1]));
            world.heal(CableId(cable));
            world.run_cycles(30);
        }
    }
    println!(
        "from the cycle in which the frames showed the break: event after {} us, place after {} us at the most",
        slowest.as_micros(),
        slowest_place.as_micros()
    );
    assert!(slowest <= PROMPT && slowest_place <= PLACED, "{slowest:?}, {slowest_place:?}");
}

// covers: CR-13, ring-status
#[test]
fn counts_states_carriers_and_break_place_can_be_polled() {
    let mut world = World::in_op(2, ring_of_16(FAST));
    world.run_cycles(10);
    let op = 1 << 3;
    let check = |world: &World, main: u16, redundant: u16| {
        let status = world.application().ring_status();
        for (link, count) in [(Link::Main, main), (Link::Redundant, redundant)] {
            let seen = status.link(link);
            assert_eq!((seen.answering, seen.al_states), (count, if count > 0 { op } else { 0 }), "{status:?}");
        }
        status
    };
    let status = check(&world, COUNT, 0);
    assert_eq!((status.state, status.redundancy, status.place), (RingState::Closed, Redundancy::Ready, None));
    assert!(!status.redundancy_active() && status.links.iter().all(|link| link.carrier == Some(true)));
    for cable in 0..=usize::from(COUNT) {
        world.run_cycles(500);
        world.cut(CableId(cable));
        world.run_cycles(20);
        let status = check(&world, cable as u16, COUNT - cable as u16);
        assert_eq!((status.state, status.place), (RingState::Open, Some(cable_of_ring(cable, 16))));
        assert!(matches!(status.redundancy, Redundancy::Lost { cause: RedundancyLoss::Open, .. }));
        assert_eq!(status.redundancy_active(), cable < 16, "with cable 16 cut, all are on MAIN");
        assert_eq!(status.link(Link::Main).carrier, Some(cable != 0));
        assert_eq!(status.link(Link::Redundant).carrier, Some(cable != 16));
        world.heal(CableId(cable));
        world.run_cycles(20);
        let status = check(&world, COUNT, 0);
        assert_eq!((status.redundancy, status.place), (Redundancy::Ready, None));
    }
    // A SubDevice that loses OP is reported on its side.
    world.cut(CableId(5));
    world.run_cycles(20);
    world.network_mut().device_mut(DeviceIndex(12)).refuse_transition(
        AlState::Op,
        ringcat_wire::al::AlStatusCode(0x8001),
        1,
    );
    world.hang(DeviceIndex(12), true);
    world.run_cycles(105);
    world.hang(DeviceIndex(12), false);
    world.until(Duration::from_secs(2), "it falls", |world| {
        let status = world.application().ring_status();
        status.link(Link::Redundant).has(AlState::SafeOp) || world.left_op(world.beginning()).is_empty()
    });
    assert_eq!(world.application().ring_status().link(Link::Main).al_states, op);
}

// covers: CR-12, ring-events
#[test]
fn redundancy_bus_faults_and_carriers_are_reported_separately() {
    let mut world = small(3);
    let mark = world.mark();
    world.cut(CableId(2));
    world.run_cycles(50);
    let lost = Event::RedundancyLost { cause: RedundancyLoss::Open };
    assert_eq!(others(world.events(mark)), std::slice::from_ref(&lost));
    assert_eq!(troubles(world.events(mark)), Vec::<&Event>::new(), "there is no bus fault");
    let since = world.application().ring_status().redundancy;
    world.run_cycles(500);
    assert_eq!(world.application().ring_status().redundancy, since, "it keeps the time at which it was lost");
    world.heal(CableId(2));
    world.run_cycles(50);
    assert_eq!(others(world.events(mark)), [lost.clone(), Event::RedundancyRegained]);
    for (cable, link) in [(0, Link::Main), (4, Link::Redundant)] {
        let mark = world.mark();
        world.cut(CableId(cable));
        world.run_cycles(50);
        world.heal(CableId(cable));
        world.run_cycles(50);
        let reports = others(world.events(mark));
        for event in [Event::LinkDown { link }, lost.clone(), Event::RedundancyRegained, Event::LinkUp { link }] {
            assert_eq!(reports.iter().filter(|reports| **reports == event).count(), 1, "{event:?} in {reports:?}");
        }
        assert_eq!(reports.len(), 4);
    }
}

// covers: CR-06, 9.2.1, ring-events
#[test]
fn a_ring_with_one_dead_direction_has_lost_only_its_redundancy() {
    let mut world = small(4);
    let mark = world.mark();
    // Frames of RED are lost on their way to MAIN; the copies of MAIN are complete.
    let fault = |blocked| Fault::OneWay { cable: CableId(2), direction: Direction::BToA, blocked };
    world.fault(fault(true));
    world.run_cycles(200);
    let cause = RedundancyLoss::OneWay(Link::Redundant);
    assert_eq!(others(world.events(mark)), [Event::RedundancyLost { cause }]);
    assert_eq!(ring_events(world.events(mark)), Vec::<&Event>::new(), "it is not open");
    assert_eq!((world.incomplete(mark), world.left_op(mark)), (0, vec![]), "one copy is enough (CR-06)");
    assert!(matches!(world.application().ring_status().redundancy, Redundancy::Lost { .. }));
    world.fault(fault(false));
    world.run_cycles(50);
    assert_eq!(others(world.events(mark)).last(), Some(&Event::RedundancyRegained));
}

// covers: CR-18, ring-events
#[test]
fn two_breaks_are_bus_faults_and_redundancy_returns_with_the_last_repair() {
    let mut world = small(5);
    let mark = world.mark();
    world.cut(CableId(1));
    world.run_cycles(100);
    world.cut(CableId(3));
    world.run_cycles(200);
    let lost: Vec<&Event> = troubles(world.events(mark));
    assert_eq!(lost, [&Event::Lost { subdevice: SubDeviceId(1) }, &Event::Lost { subdevice: SubDeviceId(2) }]);
    assert_eq!(others(world.events(mark)).len(), 1, "redundancy was lost once");
    world.heal(CableId(1));
    world.until(Duration::from_secs(3), "all back", |world| world.all_in_op() && world.application().all_settled());
    assert!(matches!(world.application().ring_status().redundancy, Redundancy::Lost { .. }), "one break is left");
    world.heal(CableId(3));
    world.run_cycles(100);
    assert_eq!(others(world.events(mark)).last(), Some(&Event::RedundancyRegained));
    assert_eq!(world.application().ring_status().link(Link::Main).answering, 4);
}

/// Cuts and heals a cable for a while.
fn flap(world: &mut World, cable: usize, half_period: Duration, lasts: Duration) {
    let (begin, mut cut) = (world.now(), false);
    let mut at = Duration::ZERO;
    while at < lasts {
        at += half_period;
        cut = !cut;
        let fault = if cut { Fault::Cut(CableId(cable)) } else { Fault::Heal(CableId(cable)) };
        world.network_mut().schedule(begin + at, fault);
    }
    if cut {
        world.network_mut().schedule(begin + at + half_period, Fault::Heal(CableId(cable)));
    }
    while world.now() < begin + lasts + half_period {
        world.cycle();
    }
}

// covers: ring-flap
#[test]
fn a_cable_flapping_at_any_rate_changes_no_state_and_floods_no_log() {
    println!("half period us | cycles incomplete of all | events about ring and redundancy");
    for (number, micros) in [1u64, 7, 50, 333, 1_000, 3_700, 20_000, 70_000, 250_000, 1_000_000].into_iter().enumerate()
    {
        let mut world = small(10 + number as u64);
        let mark = world.mark();
        let half_period = Duration::from_micros(micros);
        let lasts = Duration::from_millis(300).max(3 * half_period);
        // Short bounces come by the hundred, not by the hundred thousand.
        let lasts = if micros < 50 { half_period * 400 } else { lasts };
        flap(&mut world, number % 5, half_period, lasts);
        world.run_cycles(1_100);
        let reports = ring_events(world.events(mark)).len() + others(world.events(mark)).len();
        let cycles = world.evaluated(mark).len();
        println!("{micros:>14} | {:>8} of {cycles:>6} | {reports}", world.incomplete(mark));
        assert_eq!(world.left_op(mark), [], "{micros} us");
        assert!(!world.saw(mark, |event| matches!(event, Event::Lost { .. })), "{micros} us");
        let changes = (lasts.as_nanos() / half_period.as_nanos()) as usize + 1;
        // Ring, place, redundancy and carrier for each of 32 changes and four more a second, or of all if they are
        // fewer.
        let most = 4 * changes.min(32 + 4 * (lasts.as_millis() as usize / 1000 + 1)) + 2;
        assert!(reports <= most, "{micros} us: {reports} of {most}");
        assert_eq!(world.application().ring_status().redundancy, Redundancy::Ready);
        let closed = ring_events(world.events(mark)).last().is_none_or(|last| matches!(last, Event::RingClosed { .. }));
        assert!(closed, "the last report is the present state");
    }
}

// covers: ring-flap
#[test]
fn a_cable_flapping_in_one_direction_changes_no_state_and_floods_no_log() {
    println!("direction, half period us | cycles incomplete of all | events about ring and redundancy");
    for (number, direction) in [Direction::AToB, Direction::BToA].into_iter().enumerate() {
        // Away from MAIN no SubDevice behind the cable receives outputs: for less than the watchdog of 100 ms.
        for micros in [3u64, 40, 700, 2_300, 30_000, 80_000, 1_000_000] {
            if direction == Direction::AToB && micros > 80_000 {
                continue;
            }
            let mut world = small(50 + number as u64);
            let mark = world.mark();
            let (half_period, begin) = (Duration::from_micros(micros), world.now());
            let changes = if micros < 1_000 { 400 } else { 20 };
            for change in 0..changes {
                let fault = Fault::OneWay { cable: CableId(2), direction, blocked: change % 2 == 0 };
                world.network_mut().schedule(begin + half_period * change, fault);
            }
            while world.now() < begin + half_period * changes {
                world.cycle();
            }
            world.run_cycles(1_200);
            let reports = ring_events(world.events(mark)).len() + others(world.events(mark)).len();
            let (incomplete, cycles) = (world.incomplete(mark), world.evaluated(mark).len());
            println!("{direction:?} {micros:>14} | {incomplete:>8} of {cycles:>6} | {reports}");
            assert_eq!(world.left_op(mark), [], "{direction:?}, {micros} us");
            assert!(reports <= 2 * changes as usize && reports <= 80, "{direction:?}, {micros} us: {reports}");
            assert_eq!(world.application().ring_status().redundancy, Redundancy::Ready);
            if direction == Direction::BToA {
                assert_eq!(incomplete, 0, "the copies of MAIN are enough");
            }
        }
    }
}

// covers: ring-flap
#[test]
fn an_unsteady_ring_is_reported_once_and_again_when_stable() {
    let mut world = small(30);
    let mark = world.mark();
    flap(&mut world, 2, Duration::from_millis(25), Duration::from_secs(3));
    let unsteady =
        |world: &World| others(world.events(mark)).iter().filter(|e| matches!(e, Event::RingUnsteady { .. })).count();
    assert_eq!(unsteady(&world), 1);
    assert!(world.application().ring_status().unsteady && world.application().ring_status().changes > 100);
    let reports = ring_events(world.events(mark)).len();
    assert!(reports <= 80, "{reports} events for {} changes", world.application().ring_status().changes);
    world.run_cycles(1_100);
    assert!(!world.application().ring_status().unsteady);
    assert!(matches!(ring_events(world.events(mark)).last(), Some(Event::RingClosed { main: 4, redundant: 0, .. })));
    // The next change is reported at once again.
    let mark = world.mark();
    world.cut(CableId(1));
    world.run_cycles(10);
    assert_eq!(ring_events(world.events(mark)).len(), 2);
}

// covers: cable-errors
#[test]
fn bursts_of_corrupt_frames_are_no_break_and_are_reported_by_cable() {
    let mut world = small(31);
    let mark = world.mark();
    let mut dice = Dice::new(31);
    for _ in 0..60 {
        world.corrupt(CableId(2), 1 + dice.below(5) as u32);
        world.run_cycles(30 + dice.below(40));
    }
    world.run_cycles(1_200);
    assert_eq!(ring_events(world.events(mark)), Vec::<&Event>::new());
    assert_eq!((world.left_op(mark), troubles(world.events(mark))), (vec![], vec![]));
    let rises: Vec<&Event> = world
        .events(mark)
        .iter()
        .map(|timed| &timed.event)
        .filter(|event| matches!(event, Event::CableErrors { .. }))
        .collect();
    assert!(!rises.is_empty() && rises.len() <= 2, "{rises:?}");
    for event in rises {
        let Event::CableErrors { cable, errors } = event else { unreachable!() };
        assert_eq!(*cable, cable_of_ring(2, 4));
        assert!(errors.invalid_frames >= 3 && errors.lost_links == 0);
    }
    let counted = world.application().engine().cable_errors();
    let at: Vec<u64> = counted.iter().map(|it| it.errors.invalid_frames).collect();
    assert!(at[2] > 50 && at.iter().sum::<u64>() == at[2], "only that cable: {at:?}");
    // The same on a stub after a break elsewhere.
    world.cut(CableId(1));
    world.run_cycles(50);
    let before = world.application().engine().cable_errors()[3].errors.invalid_frames;
    world.corrupt(CableId(3), 20);
    world.run_cycles(2_200);
    let after = world.application().engine().cable_errors();
    assert!(after[3].errors.invalid_frames >= before + 20, "{after:?}");
    assert_eq!(after[1].errors.lost_links, 2, "both ends of the broken cable lost their link");
}
