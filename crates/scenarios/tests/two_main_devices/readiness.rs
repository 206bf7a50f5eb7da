//! `ready`, or why not, on both sides: as a value, and as an event when it has changed.

use std::time::Duration;

use ringcat::standby::{NotReady, StandbyEvent};
use ringcat_sim::cable::{Host, HostLink};
use scenarios::two::{CYCLE, Two};

use super::{declare, ring_of_two, standby};

/// What both know now.
fn known(two: &Two) -> [NotReady; 2] {
    [0, 1].map(|number| two.controllers[number].control().readiness())
}

/// What a controller has reported since the last call.
fn reported(two: &mut Two, number: usize) -> Vec<NotReady> {
    let readiness = |event| match event {
        StandbyEvent::Readiness(reasons) => Some(reasons),
        _ => None,
    };
    let events = two.standby_events(number).into_iter().filter_map(readiness).collect();
    two.controllers[number].events.clear();
    events
}

fn settle(two: &mut Two) {
    two.run(20 * CYCLE);
}

// covers: standby, MR-15, FR-11, REQ010, REQ012
#[test]
fn both_report_that_they_are_ready_and_each_reason_why_not() {
    let mut two = Two::new(ring_of_two(4, Host::First), declare, standby());
    assert_eq!(known(&two), [NotReady::NO_APPLICATION; 2]);
    two.controllers[0].begin_active();
    two.until(Duration::from_secs(5), "the other one is ready", |two| {
        two.all_in_op() && two.controllers[0].partner().is_ready()
    });
    settle(&mut two);
    assert_eq!(known(&two), [NotReady::NOTHING; 2], "{}", two.log());
    let first = reported(&mut two, 0);
    assert!(first.len() >= 2 && first.first() != Some(&NotReady::NOTHING), "not ready before: {first:?}");
    assert_eq!((first.last(), reported(&mut two, 1)), (Some(&NotReady::NOTHING), vec![NotReady::NOTHING]));

    let reasons = [
        (NotReady::HELD, "held INACTIVE"),
        (NotReady::GUARD, "no guard"),
        (NotReady::APPLICATION, "the application is not ready"),
    ];
    for (reason, words) in reasons {
        two.controllers[1].control().set_not_ready(reason.0, true);
        settle(&mut two);
        assert_eq!(known(&two), [reason; 2], "the other side knows it, too");
        assert_eq!(known(&two)[0].to_string(), words);
        two.controllers[1].control().set_not_ready(reason.0, false);
        settle(&mut two);
        for number in [0, 1] {
            assert_eq!(reported(&mut two, number), [reason, NotReady::NOTHING], "{number}");
        }
    }

    // Its own guard is a reason at the ACTIVE only; its permanent standby is no reason.
    two.controllers[0].control().set_not_ready(NotReady::GUARD.0 | NotReady::HELD.0, true);
    settle(&mut two);
    assert_eq!(known(&two), [NotReady::GUARD, NotReady::NOTHING]);
    two.controllers[0].control().set_not_ready(NotReady::GUARD.0 | NotReady::HELD.0, false);

    two.network.disconnect(HostLink::SECOND[0], true);
    two.until(Duration::from_secs(1), "both know of the link", |two| known(two) == [NotReady::LINK; 2]);
    two.network.disconnect(HostLink::SECOND[0], false);
    two.until(Duration::from_secs(1), "both are ready again", |two| known(two) == [NotReady::NOTHING; 2]);

    two.kill(1);
    settle(&mut two);
    let alone = NotReady::ABSENT.with(NotReady::LINK, true);
    assert_eq!((known(&two)[0], reported(&mut two, 0).last()), (alone, Some(&alone)), "{}", two.log());
}

// covers: standby, MR-15, FR-11
#[test]
fn readiness_expires_when_no_cycle_runs() {
    let mut two = Two::in_op(ring_of_two(4, Host::First), declare, standby());
    settle(&mut two);
    assert_eq!(known(&two), [NotReady::NOTHING; 2], "{}", two.log());
    for number in [1, 0] {
        two.controllers[number].holds_cycles = true;
        two.run(Duration::from_millis(80));
        let readiness = |two: &Two| two.controllers[number].control().readiness();
        assert_ne!(readiness(&two), NotReady::STOPPED, "it may be late: {number}\n{}", two.log());
        two.run(Duration::from_millis(80));
        assert_eq!(readiness(&two), NotReady::STOPPED, "{number}\n{}", two.log());
        assert_eq!(NotReady::STOPPED.to_string(), "no cycles run");
        two.controllers[number].holds_cycles = false;
        two.until(Duration::from_secs(2), "both are ready again", |two| known(two) == [NotReady::NOTHING; 2]);
    }
}
