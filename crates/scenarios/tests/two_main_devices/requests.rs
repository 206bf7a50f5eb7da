//! Requests for a role by an operator, a policy and a schedule at the same time: that of the operator takes effect.

use std::time::Duration;

use ringcat::MainDeviceRole;
use ringcat::standby::{Requester, RoleRequest, StandbyEvent};
use ringcat_sim::cable::Host;
use scenarios::pair::{CYCLE, Pair, Phase, TIME_OUT_CYCLES};
use scenarios::two::Two;

use super::{declare, ring_of_two, standby};

// covers: standby, MR-02, MR-15
#[test]
fn an_operators_permanent_standby_is_not_replaced_by_a_takeover() {
    // The cycle in which the policy takes over is one of these, and those right before and after it.
    for cycles in 0..TIME_OUT_CYCLES + 4 {
        let mut pair = Pair::of_members(21, ring_of_two(3, Host::First));
        pair.hosts().guard(Host::First, CYCLE);
        pair.kill(Host::First);
        pair.run_cycles(cycles);
        pair.request_hold(Host::Second);
        pair.run_cycles(40);
        let seen = pair.seen(Host::Second);
        assert_eq!(seen.phase, Phase::Inactive, "asked after {cycles} cycles\n{}", pair.log());
    }
}

/// At how many moments of a hand-over the one that gives its role takes it back, if its offer is withdrawn with this
/// request.
fn taken_back(withdrawal: RoleRequest) -> usize {
    let takes_it_back = |quarters: &u32| {
        let mut two = Two::in_op(ring_of_two(3, Host::First), declare, standby());
        two.run(50 * CYCLE);
        two.mark();
        let control = two.controllers[0].control().clone();
        assert!(control.request_as(RoleRequest::HandOver, Requester::Schedule));
        two.run(CYCLE / 4 * *quarters);
        assert!(control.request_as(withdrawal, Requester::Schedule));
        two.run(Duration::from_millis(100));
        let here = format!("{withdrawal:?} after {quarters} quarters of a cycle\n{}", two.log());
        // Otherwise two may be ACTIVE, and each one sends its own outputs.
        if withdrawal == RoleRequest::Withdraw {
            assert!(two.active().is_some() && two.went_back.is_empty(), "{here}");
        }
        let roles = two.standby_events(0).into_iter().filter_map(|event| match event {
            StandbyEvent::RoleChanged { role, .. } => Some(role),
            _ => None,
        });
        roles.skip_while(|role| *role != MainDeviceRole::Inactive).any(|role| role == MainDeviceRole::Active)
    };
    (0..40).filter(takes_it_back).count()
}

// covers: standby, MR-02, MR-07
#[test]
fn a_withdrawn_offer_never_takes_the_role_back() {
    assert_eq!(taken_back(RoleRequest::Withdraw), 0);
    assert!(taken_back(RoleRequest::Active) > 0, "a request to be ACTIVE takes it back once it was given");
}
