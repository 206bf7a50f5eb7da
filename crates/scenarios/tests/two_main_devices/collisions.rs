//! Two ACTIVE MainDevices in one network, and two networks that are joined (protocol MR-10, MR-24).

use std::time::Duration;

use ringcat::Event;
use ringcat::standby::RoleRequest;
use ringcat::standby::StandbyEvent;
use ringcat::{Instant, MainDeviceRole};
use ringcat_sim::cable::{CableId, Host};
use ringcat_sim::fault::Fault;
use scenarios::two::{CYCLE, Two};

use super::{declare, ring_of_two, standby};

const COUNT: usize = 4;

/// When a controller reported a collision first since the last mark.
fn collided_at(two: &Two, controller: usize) -> Option<Instant> {
    let is_collision = |event: &Event| matches!(event, Event::Standby(StandbyEvent::Collision { .. }));
    two.controllers[controller].events.iter().find(|timed| is_collision(&timed.event)).map(|timed| timed.at)
}

// covers: MR-09, MR-10, REQ016, REQ017, 9.9, standby
#[test]
fn a_second_active_is_reported_by_both_within_a_cycle() {
    for phase in [0, 130, 480, 910] {
        let mut two = Two::in_op(ring_of_two(COUNT, Host::First), declare, standby());
        two.run(Duration::from_micros(100_000 + phase));
        two.mark();
        two.controllers[1].request(RoleRequest::Active);
        two.until(2 * CYCLE, "it is ACTIVE", |two| two.controllers[1].engine.role() == MainDeviceRole::Active);
        let changed_at = two.controllers[1].changed_at.expect("it has changed");
        two.run(3 * CYCLE);
        for controller in [0, 1] {
            let at = collided_at(&two, controller);
            let within = at.map(|at| at.since(changed_at));
            assert!(
                within.is_some_and(|within| within <= CYCLE + CYCLE / 2),
                "{controller}: {within:?}\n{}",
                two.log()
            );
        }
        // The application yields at once.
        two.controllers[1].request(RoleRequest::Inactive);
        two.run(Duration::from_millis(100));
        assert_eq!(two.active(), Some(0));
        assert!(two.all_in_op() && two.left_op.is_empty(), "{}", two.log());
        assert!(two.controllers[0].partner().is_ready(), "{:?}", two.controllers[0].partner());
    }
}

// covers: MR-24, MR-10, REQ048, standby
#[test]
fn two_networks_that_are_joined_collide_on_both_sides_within_a_cycle() {
    let mut two = Two::in_op(ring_of_two(COUNT, Host::First), declare, standby());
    two.run(Duration::from_millis(100));
    // A double break: between SubDevices, and between the MainDevices.
    let (inner, between) = (CableId(2), CableId(COUNT + 1));
    two.fault(Fault::Cut(inner));
    two.run(Duration::from_millis(20));
    two.fault(Fault::Cut(between));
    two.run(3 * CYCLE);
    two.controllers[1].request(RoleRequest::Active);
    two.run(Duration::from_millis(300));
    let both = two.controllers.iter().all(|it| it.engine.role() == MainDeviceRole::Active);
    assert!(both && two.all_in_op(), "each has its half: {}", two.log());
    for cable in [between, inner] {
        two.mark();
        let healed_at = two.now();
        two.fault(Fault::Heal(cable));
        two.run(5 * CYCLE);
        for controller in [0, 1] {
            let within = collided_at(&two, controller).map(|at| at.since(healed_at));
            assert!(within.is_some_and(|within| within <= 2 * CYCLE), "{controller}: {within:?}\n{}", two.log());
        }
        if cable == between {
            two.fault(Fault::Cut(between));
            two.run(Duration::from_millis(200));
        }
    }
}

// covers: MR-27, MR-06, REQ035, standby
#[test]
fn the_manuals_switchover_costs_a_time_out_and_no_subdevice_leaves_op() {
    let mut two = Two::in_op(ring_of_two(COUNT, Host::First), declare, standby());
    two.run(Duration::from_millis(100));
    two.mark();
    two.controllers[0].request(RoleRequest::Inactive);
    two.run(2 * CYCLE);
    let sent = |two: &Two| two.network.statistics().link(ringcat_sim::cable::HostLink::Main).frames_sent;
    let before = sent(&two);
    two.run(5 * CYCLE);
    assert_eq!(sent(&two), before, "no ACTIVE: no traffic");
    two.controllers[1].request(RoleRequest::Active);
    two.run(Duration::from_millis(200));
    assert_eq!(two.active(), Some(1));
    assert!(two.left_op.is_empty() && two.all_in_op() && two.went_back.is_empty(), "{}", two.log());
    assert!(two.longest_gap <= 10 * CYCLE, "{:?}", two.longest_gap);
    assert!(two.controllers[1].partner().is_ready());
}
