//! Propagation delays while frames of process data are on the wire: right, or not written (protocol 7.1).

use std::time::Duration;

use ringcat::{Event, Options, Trigger};
use ringcat_sim::cable::CableId;
use ringcat_sim::network::NetworkOptions;
use scenarios::clocks::{clocked, config, delay, lock, with_clocks, world};
use scenarios::delays::{Outcome, Shape, run};
use scenarios::dice::Dice;
use scenarios::segments::ring;
use scenarios::world::World;

/// A passage time with which the round trip exceeds a short cycle.
const PASSAGE: Duration = Duration::from_micros(10);
/// Delay of a pass and of a cable.
const HOP_NS: i64 = 10_000 + 50;

/// A share of the runs of `figures delays`: no wrong delay is written, and none is missing.
fn all_right(shapes: impl Iterator<Item = Shape>, changes: u64) {
    let mut dice = Dice::new(1_400);
    let mut sum = Outcome::default();
    shapes.for_each(|shape| sum.add(run(shape, dice.roll(), changes)));
    assert!(sum.wrong.is_empty(), "{:#?}", sum.wrong);
    assert!(sum.not_written.is_empty() && sum.right == sum.changes && sum.written > sum.changes, "{sum:?}");
}

// covers: 7.1, dc-remeasure
#[test]
fn delays_of_rings_of_any_length_that_break_are_right() {
    all_right([2, 3, 12, 16, 24, 40, 64].into_iter().map(Shape::Ring), 8);
}

// covers: 7.1, 9.4, dc-remeasure
#[test]
fn delays_of_rings_behind_junctions_that_break_are_right() {
    all_right([2, 9, 14, 20, 32].into_iter().map(Shape::LocalRing), 8);
}

// covers: 7.1, 9.4, dc-remeasure
#[test]
fn delays_of_random_trees_with_rings_are_right() {
    all_right((0..12).map(|_| Shape::Tree), 8);
}

fn largest_error(world: &World, devices: std::ops::Range<usize>) -> i64 {
    let first = devices.start;
    let error = |device: usize| i64::from(delay(world.network(), device)) - HOP_NS * (device - first) as i64;
    devices.map(|device| error(device).abs()).max().unwrap_or(0)
}

fn not_measured(event: &Event) -> bool {
    matches!(event, Event::ClocksFailed { reason }
        if reason.contains("a cyclic frame") || reason.contains("other frames"))
}

/// Frames are sent as soon as the last ones are back, or several cycles are under way all the time: the cyclic half
/// pauses on request, and if it may not, nothing is written and the reason is reported.
// covers: 7.1, dc-remeasure
#[test]
fn with_frames_on_the_wire_all_the_time_cycles_pause_or_nothing_is_written() {
    const COUNT: usize = 24;
    for (under_way, pauses) in [(1, true), (3, true), (1, false), (3, false)] {
        let text = format!("{under_way} under way, pauses {pauses}");
        let passages = NetworkOptions::default().with_processing_delay(PASSAGE).with_forwarding_delay(PASSAGE);
        let network = ring(clocked(COUNT, 0), passages);
        let config = config().with_pauses(pauses).with_drift_distributions(200);
        let mut world = World::with(21, network, &Options::default(), |scan| {
            let mut declaration = with_clocks(scan, config);
            declaration.domains[0].under_way = under_way;
            if under_way > 1 {
                declaration.domains[0].period = Duration::from_micros(200);
            }
            declaration
        })
        .expect("it can be activated");
        if under_way == 1 {
            world.application_mut().set_trigger(Trigger::FramesReturned { at_least: Duration::ZERO });
        }
        let mark = world.beginning();
        let is_set_up = |world: &World| delay(world.network(), COUNT - 1) != 0;
        if pauses {
            world.until(Duration::from_secs(1), "delays are written", is_set_up);
            let error = largest_error(&world, 0..COUNT);
            assert!(error <= 60 && !world.saw(mark, not_measured), "{text}: {error} ns");
            let paused = world.application().pace().paused;
            assert!((16..=200).contains(&paused), "{text}: {paused} cycles began later");
            world.cut(CableId(1));
            world.until(Duration::from_secs(2), "all in OP", |world| world.application().all_settled());
            let end = world.application().now() + Duration::from_millis(200);
            while world.application().now() < end {
                world.cycle();
            }
            let error = largest_error(&world, 1..COUNT);
            assert!(error <= 60 && !world.saw(mark, not_measured), "{text}, cut: {error} ns");
        } else {
            world.until(Duration::from_secs(1), "it is reported", |world| world.saw(mark, not_measured));
            assert!(!is_set_up(&world) && world.application().pace().paused == 0, "{text}");
        }
    }
}

/// Cycles of 1 ms leave enough time: no cycle pauses, and clocks lock as without process data.
// covers: 7.1, dc-remeasure
#[test]
fn cycles_of_a_millisecond_never_pause_for_a_measurement() {
    let mut world = world(22, ring(clocked(12, 50), NetworkOptions::default()), config());
    lock(&mut world, Duration::from_secs(4));
    for fault in [World::cut, World::heal] {
        fault(&mut world, CableId(1));
        world.run_cycles(300);
    }
    assert_eq!(world.application().pace().paused, 0);
}
