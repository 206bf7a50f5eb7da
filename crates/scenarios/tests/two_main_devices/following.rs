//! What an INACTIVE shows, refuses and says while it follows (protocol 9.8, 9.11).

use std::time::Duration;

use ringcat::standby::StandbyEvent;
use ringcat::standby::{Partner, RoleRequest};
use ringcat::{ActivateError, Denial};
use ringcat::{Function, Limits, MainDeviceRole, SubDeviceId, SubDeviceState};
use ringcat_sim::cable::{CableId, Host};
use ringcat_sim::fault::Fault;
use ringcat_wire::al::AlState;
use scenarios::two::{CYCLE, Settings, Two};

use super::{declare, ring_of_two, standby};

fn followed() -> Two {
    let mut two = Two::in_op(ring_of_two(8, Host::First), declare, standby());
    two.run(Duration::from_millis(100));
    two
}

// covers: MR-20, MR-12, 9.11, standby
#[test]
fn an_inactive_that_follows_refuses_what_needs_the_bus_and_answers_the_rest() {
    let mut two = followed();
    let inactive = &mut two.controllers[1].engine;
    for function in Function::ALL {
        let is_refused = inactive.permission(*function) == ringcat::Permission::Refused;
        let has_other_reason = matches!(function, Function::Follow);
        assert_eq!(is_refused, function.needs_the_bus() || has_other_reason, "{function:?}");
    }
    let scan = inactive.start_scan();
    assert!(matches!(scan, Err(ActivateError::NotPermitted(denied)) if denied.denial == Denial::NeedsTheBus));
    let state = inactive.start_state_request(SubDeviceId(1), AlState::PreOp);
    assert!(inactive.mailbox(SubDeviceId(3)).is_some_and(|mailbox| !mailbox.is_open()));
    two.run(Duration::from_millis(10));
    let mut state = state;
    let refused = state.take().expect("it is refused at once").unwrap_err();
    assert!(refused.to_string().contains("INACTIVE"), "{refused}");
    assert_eq!(two.controllers[1].sent_inactive, 0);
    assert!(two.left_op.is_empty());
}

// covers: FR-08, FR-06, MR-13, REQ030, standby
#[test]
fn the_images_of_the_inactive_are_those_of_whole_cycles_of_the_active() {
    let mut two = followed();
    let (mut seen, mut equal) = (std::collections::VecDeque::new(), 0);
    for _ in 0..200 {
        two.run(CYCLE);
        seen.push_back(two.controllers[0].image());
        if seen.len() > 6 {
            seen.pop_front();
        }
        // Outputs and inputs may be of neighbouring cycles of the ACTIVE; outputs alone are of one.
        let now = two.controllers[1].image();
        equal += usize::from(seen.iter().any(|image| image[..2] == now[..2]));
    }
    assert!(equal >= 199, "{equal} of 200");
}

// covers: MR-12, MR-13, REQ031, REQ032, standby
#[test]
fn states_and_counts_of_the_inactive_are_those_of_the_active() {
    let mut two = followed();
    two.controllers[0].engine.start_state_request(SubDeviceId(4), AlState::SafeOp);
    two.run(Duration::from_millis(200));
    let [first, second] = &two.controllers;
    assert_eq!(first.engine.states(), second.engine.states(), "{}", two.log());
    assert!(first.engine.states().contains(&ringcat::SubDeviceState::Settled(AlState::SafeOp)));
    let [ours, theirs] = [first.engine.ring_status(), second.engine.ring_status()];
    assert_eq!(ours.state, theirs.state);
    assert_eq!(ours.links.map(|link| link.answering), theirs.links.map(|link| link.answering));
}

// covers: REQ032, MR-25, standby
#[test]
fn states_of_an_inactive_are_unknown_as_long_as_no_active_reports_them() {
    let mut two = followed();
    two.run(Duration::from_millis(100));
    let known = two.controllers[0].engine.states();
    let live = two.controllers[1].engine.live_status();
    let online = || (0..8).filter(|subdevice| live.subdevice(SubDeviceId(*subdevice)).is_some_and(|it| it.online));
    assert_eq!((two.controllers[1].engine.states(), online().count()), (known.clone(), 8));
    two.kill(0);
    two.run(3 * CYCLE);
    assert_eq!(two.controllers[1].engine.states(), known, "single cycles may be lost");
    two.run(3 * CYCLE);
    let inactive = &two.controllers[1].engine;
    assert_eq!((inactive.states(), online().count()), (vec![SubDeviceState::Unknown; 8], 0), "{}", two.log());
    assert_eq!((inactive.unsettled().len(), inactive.all_settled()), (8, false));
    assert_eq!(live.segment().responding, 0);
    // For a takeover the INACTIVE still has the last reported states.
    two.controllers[1].request(RoleRequest::Active);
    two.run(20 * CYCLE);
    assert!(two.controllers[1].engine.all_settled() && two.left_op.is_empty(), "{}", two.log());
    assert_eq!((two.controllers[1].engine.states(), online().count()), (known, 8));
}

// covers: MR-14, MR-19, REQ045, standby
#[test]
fn counters_of_the_active_are_readable_at_the_inactive() {
    let mut two = followed();
    two.run(Duration::from_millis(100));
    let before = two.controllers[1].engine.partner_diagnosis().expect("it has come");
    assert!(before.at.is_some_and(|at| two.now().since(at) <= 2 * CYCLE));
    assert_eq!((before.counters.ring, before.counters.carriers), (1, 0b1010));
    assert_eq!(before.counters.answering, [8, 0]);
    two.fault(Fault::Cut(CableId(4)));
    two.run(Duration::from_millis(100));
    let after = two.controllers[1].engine.partner_diagnosis().expect("it has come");
    assert_eq!((after.counters.ring, after.counters.answering), (2, [4, 4]), "{}", two.log());
    let own = *two.controllers[0].exchange().counters();
    // The diagnosis is of the cycle before, and the last one is still under way.
    let sent = (own.sent - after.counters.sent, after.counters.sent - before.counters.sent);
    assert!(sent.0 <= 20 && sent.1 >= 100, "{sent:?}");
    let [lost, incomplete] = [own.lost, own.incomplete];
    assert_eq!([after.counters.lost, after.counters.incomplete], [lost, incomplete]);
    assert_eq!(after.domains.len(), 1);
    assert_eq!((after.domains[0].state, after.domains[0].wkc), (2, after.domains[0].expected));
    assert!(two.controllers[0].engine.partner_diagnosis().is_none(), "it is ACTIVE, and has received none");
}

// covers: MR-13, standby
#[test]
fn descriptions_of_objects_are_no_part_of_the_knowledge_of_the_other_one() {
    let lengths = |two: &Two| {
        let known = two.controllers[0].engine.knowledge().expect("it has scanned").to_bytes().len();
        [known, two.controllers[1].engine.partner_knowledge().expect("it has arrived").to_bytes().len()]
    };
    let mut two = followed();
    two.run(Duration::from_secs(6));
    let [known, received] = lengths(&two);
    let engine = &mut two.controllers[0].engine;
    let mailbox = engine.mailbox(SubDeviceId(3)).expect("it is declared");
    let dictionary = engine.dictionaries().of(&mailbox, engine.identity(SubDeviceId(3)));
    let limits = Limits::new(Duration::from_millis(100), Duration::from_secs(1));
    let mut read = engine.start(async move {
        dictionary.list(limits).await?;
        dictionary.object(0x1018, limits).await
    });
    let read = (0..2_000).find_map(|_| {
        two.run(CYCLE);
        read.take()
    });
    assert!(matches!(read, Some(Ok(_))), "{read:?}");
    // Each 5 s all is published again.
    two.run(Duration::from_secs(6));
    let [known_now, received_now] = lengths(&two);
    assert!(known_now > known + 50, "{known} bytes, then {known_now}");
    assert_eq!(received_now, received, "bytes that the other one has");
    assert!(two.controllers[0].partner().is_ready(), "{:?}", two.controllers[0].partner());
}

// covers: REQ010, MR-15, standby
#[test]
fn an_inactive_with_another_declaration_is_not_ready_and_both_name_what_differs() {
    fn other(scan: &ringcat::Scan) -> ringcat::Declaration {
        let mut declaration = declare(scan);
        declaration.subdevices[3].watchdog_intervals = Some(500);
        declaration
    }
    let settings = [Settings { standby: standby(), declare }, Settings { standby: standby(), declare: other }];
    let mut two = Two::with(ring_of_two(8, Host::First), settings);
    two.controllers[0].begin_active();
    two.until(Duration::from_secs(5), "the partner follows", |two| {
        two.all_in_op() && two.controllers[1].has_application()
    });
    two.run(Duration::from_millis(300));
    for controller in [0, 1] {
        let events = two.standby_events(controller);
        let named = events.iter().any(|event| match event {
            StandbyEvent::ConfigurationDiffers { what, .. } => what.starts_with("SubDevice 3: target state"),
            _ => false,
        });
        assert!(named, "{controller}: {events:?}");
    }
    assert!(!two.controllers[0].partner().is_ready());
    two.controllers[0].request(RoleRequest::HandOver);
    two.run(Duration::from_millis(100));
    assert_eq!(two.active(), Some(0), "it is not handed over");
    let refused = |event: &StandbyEvent| matches!(event, StandbyEvent::HandOverRefused(Partner::Alive { .. }));
    assert!(two.standby_events(0).iter().any(refused));
}

// covers: MR-08, 9.10, standby
#[test]
fn without_an_active_an_inactive_waits_for_ever_and_its_application_decides() {
    let mut two = Two::new(ring_of_two(4, Host::First), declare, standby());
    two.run(Duration::from_secs(2));
    assert!(two.controllers.iter().all(|it| it.engine.role() == MainDeviceRole::Inactive && it.sent_inactive == 0));
    assert!(two.controllers.iter().all(|it| it.engine.partner_status().at.is_none()));
    two.controllers[1].begin_active();
    two.until(Duration::from_secs(5), "the partner is ready", |two| {
        two.all_in_op() && two.controllers[1].partner().is_ready()
    });
    assert_eq!(two.active(), Some(1));
    let changed =
        |event: &StandbyEvent| matches!(event, StandbyEvent::RoleChanged { role: MainDeviceRole::Active, .. });
    assert!(two.standby_events(1).iter().any(changed));
}
