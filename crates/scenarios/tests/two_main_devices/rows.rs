//! Each cut of the ring with either MainDevice ACTIVE, and roles that change while a cable is cut (protocol
//! 9.7.5).

use std::time::Duration;

use ringcat::MainDeviceRole;
use ringcat::standby::{RoleCause, RoleRequest, StandbyEvent};
use ringcat_sim::cable::{CableId, Host};
use ringcat_sim::fault::Fault;
use scenarios::two::{CYCLE, Two};

use super::{declare, ring_of_two, standby};

const COUNT: usize = 4;

/// With this MainDevice ACTIVE.
fn with_active(active: usize) -> Two {
    let mut two = Two::in_op(ring_of_two(COUNT, Host::First), declare, standby());
    two.run(Duration::from_millis(100));
    if active == 1 {
        two.controllers[0].request(RoleRequest::HandOver);
        two.until(Duration::from_millis(200), "handed over", |two| two.active() == Some(1));
        two.until(Duration::from_millis(200), "ready", |two| two.controllers[1].partner().is_ready());
    }
    two.run(Duration::from_millis(100));
    two
}

// covers: 9.7.5, 9.8, MR-05, FR-11, standby
#[test]
fn with_any_cable_cut_either_active_has_its_ring_and_its_partner_follows() {
    for active in [0, 1] {
        let mut two = with_active(active);
        for cable in 0..COUNT + 2 {
            two.run(Duration::from_millis(100));
            two.mark();
            two.fault(Fault::Cut(CableId(cable)));
            two.run(Duration::from_millis(100));
            let here = format!("ACTIVE {active}, cable {cable}\n{}", two.log());
            assert!(two.controllers[active].partner().is_ready(), "{:?} {here}", two.controllers[active].partner());
            assert!(two.left_op.is_empty() && two.all_in_op() && two.went_back.is_empty(), "{here}");
            let [first, second] = &two.controllers;
            let sizes = [first.image().len(), second.image().len()];
            assert!(sizes[0] == sizes[1] && sizes[0] > 0, "{here}");
            two.fault(Fault::Heal(CableId(cable)));
            two.run(Duration::from_millis(100));
            assert!(two.controllers[active].partner().is_ready() && two.left_op.is_empty(), "healed: {}", two.log());
        }
    }
}

// covers: 9.7.5, MR-07, standby
#[test]
fn a_role_is_handed_over_with_any_cable_cut() {
    for active in [0, 1] {
        for cable in 0..COUNT + 2 {
            let mut two = with_active(active);
            two.fault(Fault::Cut(CableId(cable)));
            two.run(Duration::from_millis(200));
            two.mark();
            two.controllers[active].request(RoleRequest::HandOver);
            two.run(Duration::from_millis(200));
            let here = format!("ACTIVE {active}, cable {cable}\n{}", two.log());
            assert_eq!(two.active(), Some(1 - active), "{here}");
            assert!(two.left_op.is_empty() && two.all_in_op() && two.went_back.is_empty(), "{here}");
            assert!(two.longest_gap <= 3 * CYCLE, "{:?} {here}", two.longest_gap);
        }
    }
}

// covers: 9.7.5, MR-24, standby
#[test]
fn a_failed_active_and_a_cut_cable_leave_the_subdevices_in_reach() {
    // The line begins at the first MainDevice. Without the one that fails the other one reaches a line from its own
    // end.
    for active in [0, 1] {
        for cable in 0..COUNT + 2 {
            let mut two = with_active(active);
            two.fault(Fault::Cut(CableId(cable)));
            two.run(Duration::from_millis(200));
            two.mark();
            two.kill(active);
            two.run(3 * CYCLE);
            two.controllers[1 - active].request(RoleRequest::Active);
            two.run(Duration::from_millis(300));
            // Cable n leads to SubDevice n; the one behind the last to the second MainDevice.
            let in_reach: Vec<usize> = match (active, cable) {
                (0, cable) if cable <= COUNT => (cable..COUNT).collect(),
                (1, cable) if cable <= COUNT => (0..cable).collect(),
                _ => (0..COUNT).collect(),
            };
            let here = format!("ACTIVE {active}, cable {cable}, in reach {in_reach:?}\n{}", two.log());
            if in_reach.is_empty() {
                // Both of its links are down.
                let lost = StandbyEvent::RoleChanged { role: MainDeviceRole::Inactive, cause: RoleCause::LinksLost };
                assert!(two.standby_events(1 - active).contains(&lost), "{here}");
                assert_eq!(two.active(), None, "{here}");
                continue;
            }
            let left: Vec<usize> = two.left_op.iter().map(|(_, device)| *device).collect();
            assert!(left.iter().all(|device| !in_reach.contains(device)), "{left:?} {here}");
            assert!(two.went_back.is_empty(), "{here}");
            let settled: Vec<usize> = {
                let states = two.controllers[1 - active].engine.states();
                let is_settled = |state: &ringcat::SubDeviceState| matches!(state, ringcat::SubDeviceState::Settled(_));
                (0..COUNT).filter(|at| is_settled(&states[*at])).collect()
            };
            assert_eq!(settled, in_reach, "{here}");
        }
    }
}
