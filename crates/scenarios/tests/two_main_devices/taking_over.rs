//! The ACTIVE fails, or hands its role over.

use std::time::Duration;

use ringcat::MainDeviceRole;
use ringcat::standby::RoleRequest;
use ringcat::standby::StandbyEvent;
use ringcat_sim::cable::Host;
use scenarios::two::{CYCLE, Two};

use super::{declare, ring_of_two, standby};

// covers: MR-01, MR-12, MR-13, FR-08, REQ031, REQ032, standby
#[test]
fn an_inactive_collects_what_it_needs_and_follows_without_a_frame_of_its_own() {
    for near in [Host::First, Host::Second] {
        let mut two = Two::in_op(ring_of_two(8, near), declare, standby());
        two.run(Duration::from_millis(200));
        let [first, second] = &two.controllers;
        assert_eq!(second.engine.role(), MainDeviceRole::Inactive);
        assert_eq!(second.sent_inactive, 0);
        assert!(second.engine.all_settled(), "{}", two.log());
        assert_eq!(first.image().len(), second.image().len());
        assert!(two.left_op.is_empty() && two.went_back.is_empty(), "{}", two.log());
    }
}

// covers: MR-07, MR-16, MR-18, REQ005, standby
#[test]
fn a_takeover_leaves_all_subdevices_in_op_and_no_output_goes_back() {
    for near in [Host::First, Host::Second] {
        for phase in [0, 100, 500, 900] {
            let mut two = Two::in_op(ring_of_two(8, near), declare, standby());
            two.run(Duration::from_micros(50_000 + phase));
            two.mark();
            two.kill(0);
            // Time-out of the application: three cycles.
            two.run(3 * CYCLE);
            two.controllers[1].request(RoleRequest::Active);
            two.run(Duration::from_millis(300));
            let here = format!("{near:?}, {phase}\n{}", two.log());
            assert!(two.left_op.is_empty() && two.all_in_op(), "{here}");
            assert!(two.went_back.is_empty(), "{:?} {here}", two.went_back);
            assert!(two.longest_gap <= 6 * CYCLE, "{:?} {here}", two.longest_gap);
            let events = two.standby_events(1);
            let is_hot = |event: &StandbyEvent| {
                matches!(event, StandbyEvent::TookOver { in_state: 8, is_hot: true, silence: Some(_), .. })
            };
            assert!(events.iter().any(is_hot), "{events:?} {here}");
            assert!(two.controllers[1].engine.all_settled(), "{here}");
        }
    }
}

// covers: MR-07, REQ015, standby
#[test]
fn a_role_is_handed_over_and_back_without_a_lost_cycle() {
    for near in [Host::First, Host::Second] {
        let mut two = Two::in_op(ring_of_two(8, near), declare, standby());
        for round in 0..4 {
            two.run(Duration::from_millis(50));
            two.mark();
            let (giver, taker) = (round % 2, 1 - round % 2);
            assert_eq!(two.active(), Some(giver), "{}", two.log());
            two.controllers[giver].request(RoleRequest::HandOver);
            two.run(Duration::from_millis(100));
            let here = format!("{near:?}, {round}\n{}", two.log());
            assert_eq!(two.active(), Some(taker), "{here}");
            assert!(two.left_op.is_empty() && two.went_back.is_empty(), "{here}");
            assert!(two.longest_gap <= 2 * CYCLE + CYCLE / 2, "{:?} {here}", two.longest_gap);
            assert_eq!(two.controllers[giver].sent_inactive, 0);
        }
    }
}

// covers: no-allocation, standby
#[test]
fn cycles_of_both_and_changes_of_the_role_do_not_allocate() {
    let mut two = Two::in_op(ring_of_two(8, Host::First), declare, standby());
    two.controllers.iter_mut().for_each(|it| it.allocations = 0);
    two.run(Duration::from_millis(300));
    two.controllers[0].request(RoleRequest::HandOver);
    two.run(Duration::from_millis(100));
    assert_eq!(two.active(), Some(1), "{}", two.log());
    two.kill(1);
    two.run(3 * CYCLE);
    two.controllers[0].request(RoleRequest::Active);
    two.run(Duration::from_millis(300));
    assert_eq!(two.active(), Some(0), "{}", two.log());
    assert_eq!(two.controllers.each_ref().map(|it| it.allocations), [0, 0]);
    let before = scenarios::counting_allocator::counts().allocations;
    drop(std::hint::black_box(vec![1_u8; 100]));
    assert!(scenarios::counting_allocator::counts().allocations > before, "they are counted");
}
