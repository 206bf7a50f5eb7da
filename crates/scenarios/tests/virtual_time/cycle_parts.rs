//! Cycles that the application runs in parts, at any rate, with and without domains.

use std::time::Duration;

use ringcat::{DomainId, DomainState, Event, Options, RingState, Scan, TimedEvent, automatic};
use ringcat_sim::cable::CableId;
use scenarios::check::ring_events;
use scenarios::segments::ring_of_16;
use scenarios::world::{CYCLE, World};

const FAST: Duration = Duration::from_micros(10);

/// Receives and sends for some cycles; domains are not queued.
fn send_only(world: &mut World, cycles: u32, period: Duration) -> Vec<TimedEvent> {
    let mut events = Vec::new();
    for _ in 0..cycles {
        let application = world.application_mut();
        application.receive();
        application.send();
        world.network_mut().advance_by(period);
        events.extend(std::iter::from_fn(|| world.application_mut().pop_event()));
    }
    events
}

// covers: cycles, ring-events
#[test]
fn a_cut_is_reported_though_no_domain_is_queued() {
    for (seed, period) in [(1, CYCLE), (2, CYCLE / 8), (3, 3 * CYCLE)] {
        let mut world = World::new(seed, ring_of_16(FAST));
        let events = send_only(&mut world, 400, period);
        assert_eq!(world.application().ring(), RingState::Closed, "seed {seed}");
        assert!(!events.iter().any(|timed| matches!(timed.event, Event::RingOpened { .. })), "seed {seed}");
        world.cut(CableId(3));
        let cut = send_only(&mut world, 400, period);
        assert_eq!(world.application().ring(), RingState::Open, "seed {seed}");
        world.heal(CableId(3));
        let healed = send_only(&mut world, 400, period);
        let events: Vec<TimedEvent> = cut.into_iter().chain(healed).collect();
        assert_eq!(ring_events(&events).len(), 3, "seed {seed}: {events:?}");
        let counters = world.application().cyclic_counters();
        assert!(counters.sent >= 600, "a frame in most sends: {counters:?}");
    }
}

// covers: cycles
#[test]
fn a_domain_that_is_queued_now_and_then_is_complete_beside_supervision() {
    let slow = |scan: &Scan| automatic(&scan.subdevices, 4 * CYCLE);
    let mut world = World::with(4, ring_of_16(FAST), &Options::default(), slow).expect("activation");
    world.settle();
    world.network_mut().advance_by(CYCLE);
    let lost = world.application().cyclic_counters().lost;
    for round in 0..200 {
        let application = world.application_mut();
        application.receive();
        if round % 4 == 0 {
            let status = application.process(DomainId(0));
            assert_eq!((status.state, status.skipped), (DomainState::Complete, 0), "round {round}");
            assert!(application.queue(DomainId(0)));
        }
        application.send();
        world.network_mut().advance_by(CYCLE);
    }
    assert_eq!(world.application().cyclic_counters().lost, lost);
}
