//! Forks without a clock: delays behind them are measured branch by branch at the set-up; if this is not possible, none
//! is written and this is reported (protocol 7.1).

use std::time::Duration;

use ringcat::{ClockConfig, Event, MainDevice, Options, SyncSignals};
use ringcat_sim::cable::{CableId, DeviceIndex, Endpoint};
use ringcat_sim::frame::Port::{A, B, C, D};
use ringcat_wire::address::Position;
use scenarios::clocks::{clocked, config, delay, lock, spread, wired, with_clocks};
use scenarios::delays::{Shape, run};
use scenarios::seeds;
use scenarios::segments::{MAIN, at};
use scenarios::tap::Tap;
use scenarios::world::World;

/// A world on these cables; the devices `without` have no clock.
fn world(cables: &[(Endpoint, Endpoint)], without: &[usize], config: ClockConfig) -> World {
    let mut descriptions = clocked(cables.len(), 50);
    without.iter().for_each(|device| descriptions[*device].dc = None);
    let network = wired(descriptions, cables);
    World::with(3, network, &Options::default(), |scan| with_clocks(scan, config)).expect("it comes up")
}

/// Delays of the cables of [`wired`], with a pass of 300 ns after each.
fn hop(cable: i64) -> i64 {
    300 + 50 + 70 * (cable * 5 % 11)
}

fn delays_reported(world: &World) -> Vec<(Position, Option<Position>)> {
    let reports = |timed: &ringcat::TimedEvent| match timed.event {
        Event::DelayUnknown { position, fork, .. } => Some((position, fork)),
        _ => None,
    };
    world.events(world.beginning()).iter().filter_map(reports).collect()
}

/// A clock, a splitter without a clock, two clocks on its port 3, one on its port 1, and on port 2 another splitter
/// with two.
const SPLITTERS: [(Endpoint, Endpoint); 8] = [
    (MAIN, at(0, A)),
    (at(0, B), at(1, A)),
    (at(1, D), at(2, A)),
    (at(2, B), at(3, A)),
    (at(1, B), at(4, A)),
    (at(1, C), at(5, A)),
    (at(5, D), at(6, A)),
    (at(5, B), at(7, A)),
];

// covers: 7.1, dc-delays
#[test]
fn delays_behind_splitters_without_a_clock_are_those_of_the_cables() {
    let mut world = world(&SPLITTERS, &[1, 5], config());
    world.until(Duration::from_secs(8), "everything in OP", World::all_in_op);
    lock(&mut world, Duration::from_secs(8));
    assert_eq!(delays_reported(&world), []);
    let there_and_back = |cables: &[i64]| 2 * cables.iter().map(|cable| hop(*cable)).sum::<i64>();
    let first = hop(1) + hop(2);
    let second = hop(1) + there_and_back(&[2, 3]) + hop(4);
    let third = hop(1) + there_and_back(&[2, 3, 4]) + hop(5) + hop(6);
    let expected = [(2, first), (3, first + hop(3)), (4, second), (6, third), (7, third + hop(6) + hop(7))];
    for (device, expected) in expected {
        let error = i64::from(delay(world.network(), device)) - expected;
        assert!(error.abs() <= 20, "device {device}: {error} ns from {expected} ns");
    }
    world.run_cycles(500);
    let apart = spread(world.network(), &[0, 2, 3, 4, 6, 7]);
    assert!(apart <= 100, "{apart} ns");
    // A branch that is unplugged and plugged in again is known from before, so no delay is hidden.
    world.cut(CableId(2));
    world.run_cycles(200);
    world.heal(CableId(2));
    world.run_cycles(1_500);
    assert_eq!(delays_reported(&world), []);
    let error = i64::from(delay(world.network(), 4)) - second;
    assert!(error.abs() <= 20, "{error} ns from {second} ns");
}

/// The time between branches of a splitter without a clock upstream of it cannot be measured.
// covers: dc-delays
#[test]
fn an_unknown_delay_behind_a_splitter_at_the_head_is_reported() {
    let cables =
        [(MAIN, at(0, A)), (at(0, D), at(1, A)), (at(1, B), at(2, A)), (at(0, B), at(3, A)), (at(3, B), at(4, A))];
    for estimated_delays in [false, true] {
        let mut world = world(&cables, &[0], config().with_estimated_delays(estimated_delays));
        world.until(Duration::from_secs(8), "everything in OP", World::all_in_op);
        lock(&mut world, Duration::from_secs(8));
        let hidden: Vec<_> = [3, 4].map(|position| (Position(position), Some(Position(0)))).to_vec();
        assert_eq!(delays_reported(&world), hidden);
        let error = i64::from(delay(world.network(), 2)) - hop(2);
        assert!(error.abs() <= 20, "{error} ns");
        assert_eq!([3, 4].map(|device| delay(world.network(), device)), [0; 2]);
        let clocks = world.application().engine().clocks();
        let is_hidden: Vec<bool> = clocks.iter().map(|clock| clock.hidden.is_some()).collect();
        assert_eq!(is_hidden, [false, false, true, true]);
        // After a long time it is not reported again.
        world.run_cycles(2_000);
        assert_eq!(delays_reported(&world).len(), 2);
    }
}

/// Two branches of a splitter appear at once in operation: the sum of their times is measured, but not the time of
/// each. This is reported with the minimum and maximum; the middle is written only on request.
// covers: dc-delays
#[test]
fn a_delay_with_known_limits_is_estimated_on_request() {
    for estimated_delays in [false, true] {
        let mut descriptions = clocked(SPLITTERS.len(), 50);
        [1, 5].into_iter().for_each(|device| descriptions[device].dc = None);
        let mut main_device = MainDevice::request(Tap::new(wired(descriptions, &SPLITTERS)), &Options::default());
        let scan = main_device.scan().expect("all are there");
        let late = [CableId(2), CableId(4)];
        late.into_iter().for_each(|cable| main_device.links_mut().network_mut().cut(cable));
        let declaration = with_clocks(&scan, config().with_estimated_delays(estimated_delays));
        let mut application = main_device.activate(declaration).map_err(|it| it.error).expect("it fits");
        (0..8_000).for_each(|_| application.cycle(|_| ()));
        late.into_iter().for_each(|cable| application.links_mut().network_mut().heal(cable));
        (0..6_000).for_each(|_| application.cycle(|_| ()));
        let events: Vec<Event> = core::iter::from_fn(|| application.pop_event()).map(|timed| timed.event).collect();
        let mut reports = Vec::new();
        for event in &events {
            let Event::DelayUnknown { position, range: Some(range), is_estimated, .. } = event else { continue };
            reports.push((usize::from(position.0), (range.least_ns, range.most_ns), *is_estimated));
        }
        assert!(!reports.is_empty(), "{events:?}");
        for (device, (least, most), is_estimated) in reports {
            let what = format!("device {device}, {least} to {most} ns");
            assert_eq!(is_estimated, estimated_delays, "{what}");
            let there_and_back = |cables: &[i64]| 2 * cables.iter().map(|cable| hop(*cable)).sum::<i64>();
            let truth = match device {
                2 => hop(1) + hop(2),
                3 => hop(1) + hop(2) + hop(3),
                4 => hop(1) + there_and_back(&[2, 3]) + hop(4),
                other => panic!("device {other} is known: {events:?}"),
            };
            assert!((least - 20..=most + 20).contains(&truth), "{what}: it takes {truth} ns");
            let written = i64::from(delay(application.links().network(), device));
            let expected = if estimated_delays { (least + most) / 2 } else { 0 };
            assert!((written - expected).abs() <= 20, "{what}: {written} ns are written");
        }
    }
}

// covers: dc-delays
#[test]
fn a_subdevice_with_sync0_and_unknown_delay_stays_in_safeop() {
    let cables = [(MAIN, at(0, A)), (at(0, D), at(1, A)), (at(0, B), at(2, A))];
    let mut descriptions = clocked(3, 50);
    descriptions[0].dc = None;
    let network = wired(descriptions, &cables);
    let config = config().with_lock_limit(Duration::from_millis(500));
    let mut world = World::with(4, network, &Options::default(), |scan| {
        let mut declaration = with_clocks(scan, config);
        [1, 2].into_iter().for_each(|index| {
            declaration.subdevices[index].sync = Some(SyncSignals::sync0(1_000_000, 0));
        });
        declaration
    })
    .expect("it comes up");
    let reason = "its propagation delay is not known, since the fork at position 0 has no clock";
    world.run_cycles(6_000);
    let reports = world
        .events(world.beginning())
        .iter()
        .map(|timed| ringcat::text::describe(timed, &ringcat::text::Names::default()));
    let reports: Vec<String> = reports.collect();
    assert!(reports.iter().any(|line| line.contains(reason)), "{reports:#?}");
    let state = |device: usize| {
        world.network().device(DeviceIndex(device)).controller.register(ringcat_wire::register::map::AL_STATUS, 1)[0]
    };
    assert_eq!([0, 1, 2].map(state), [8, 8, 4]);
}

/// Random trees, with a third of the SubDevices without a clock: written delays are right, hidden ones are reported.
// covers: dc-delays
#[test]
fn delays_in_random_trees_with_gaps_are_right_or_not_written() {
    for seed in seeds::from_environment().unwrap_or(0..6) {
        let outcome = run(Shape::Gaps, seed, 6);
        assert!(outcome.wrong.is_empty(), "{:#?}", outcome.wrong);
        assert!(outcome.right > 0, "seed {seed}: {:?}", outcome.not_written);
    }
}
