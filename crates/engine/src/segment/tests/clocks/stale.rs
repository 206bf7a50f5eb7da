//! Findings of clocks that were asked for before a change of the clocks arrive after it: each is refused, per fact.

use alloc::string::String;

use crate::clocks::{Cables, Latched};
use crate::segment::clocks::LatchedTimes;

use super::*;

/// The time of the host in these tests.
const HOST: u64 = 1_000_000_000;

fn isolate(ring: &mut Ring) {
    ring.observe(Observation::Wanted(Wanted { disturbance: Disturbance::IsolateRings, number: 0 }));
    ring.observe(Observation::Undisturbed(0));
}

fn good(count: usize) -> Vec<Option<Answer>> {
    vec![answer(Link::Main, 0); count]
}

fn latched(ring: &Ring, unit: u64) -> LatchedTimes {
    ring.segment.clocks().keys().into_iter().map(|key| (key, Latched { unit, ..Latched::default() })).collect()
}

/// The application's time is given: readings of the reference show that all offsets have to jump.
fn jump(ring: &mut Ring) {
    for _ in 0..16 {
        ring.segment.board.clocks.times.post_wanted(5_000_000_000_000, 0);
        let key = ring.segment.clocks().reference_node().unwrap().key();
        ring.finds(ClockFinding::ReferenceTime { key, low: HOST as u32, sent_at: HOST });
    }
    assert!(ring.segment.clocks().are_offsets_due());
}

// covers: dc-remeasure
#[test]
fn a_set_up_during_which_subdevices_were_out_of_reach_is_repeated() {
    for is_stale in [false, true] {
        let mut ring = declared(2);
        ring.clocks(ClockObservation::SetUpBegun);
        let versions = ring.segment.clock_versions();
        if is_stale {
            isolate(&mut ring);
        }
        ring.finds_of(versions, ClockFinding::Measured(&measured(2, 100)));
        let effects = ring.finds_of(versions, ClockFinding::SetUp);
        assert_eq!(ring.segment.clocks().are_set_up(), !is_stale);
        assert_eq!(ring.node(1).unit.is_some(), !is_stale);
        let shown = if is_stale { Vec::new() } else { vec![Event::ReferenceClock { position: Some(Position(0)) }] };
        assert_eq!(reports(&effects), shown);
    }
}

// covers: dc-remeasure
#[test]
fn the_end_of_a_set_up_does_not_end_the_next_one() {
    let mut ring = declared(2);
    ring.clocks(ClockObservation::SetUpBegun);
    let first = ring.segment.clock_versions();
    ring.clocks(ClockObservation::SetUpBegun);
    for ended in [ClockFinding::SetUp, ClockFinding::SetUpFailed("a reason".into())] {
        assert_eq!(ring.finds_of(first, ended), []);
    }
    assert!(!ring.segment.clocks().are_set_up());
    ring.finds(ClockFinding::Measured(&measured(2, 100)));
    ring.finds(ClockFinding::SetUp);
    assert!(ring.segment.clocks().are_set_up());
}

// covers: dc-remeasure
#[test]
fn findings_of_an_ended_application_change_no_clock_of_the_next() {
    let mut ring = set_up(2);
    let (versions, written) = (ring.segment.clock_versions(), [(ring.key(1), [7, 7])]);
    let scanned = ring.segment.found().unwrap().subdevices.clone();
    ring.observe(Observation::Deactivated);
    let clocks = Clocks::new(Some(ClockConfig::default()), &scanned, &Topology::default(), |_| None);
    ring.observe(Observation::Activated(Box::new(Declared { clocks, ..Declared::default() })));
    ring.finds_of(versions, ClockFinding::FiltersWritten(&written));
    ring.finds_of(versions, ClockFinding::SetUp);
    assert!(!ring.segment.clocks().are_set_up());
    assert!(ring.segment.clocks().nodes.iter().all(|node| node.filter_depths.is_none()));
}

// covers: dc-remeasure
#[test]
fn a_measurement_during_which_subdevices_were_out_of_reach_leaves_the_doubt() {
    for is_stale in [false, true] {
        let mut ring = set_up(3);
        ring.clocks(ClockObservation::SegmentChanged);
        let versions = ring.segment.clock_versions();
        if is_stale {
            isolate(&mut ring);
        }
        ring.finds_of(versions, ClockFinding::Cables(Cables::default()));
        ring.finds_of(versions, ClockFinding::MeasuredAgain(&measured(3, 300)));
        assert_eq!(ring.node(2).delay_ns, if is_stale { 200 } else { 600 });
        if !is_stale {
            ring.finds(ClockFinding::DelaysWritten(Link::Main));
        }
        let ended = ring.finds_of(versions, ClockFinding::MeasurementEnded { failed: None });
        assert_eq!(reports(&ended).len(), usize::from(!is_stale), "{ended:?}");
        assert_eq!(ring.segment.clocks().doubtful_since().is_some(), is_stale);
    }
}

// covers: dc-remeasure
#[test]
fn a_clock_that_loses_its_registers_during_a_measurement_is_measured_again() {
    let mut ring = set_up(3);
    ring.clocks(ClockObservation::SegmentChanged);
    let versions = ring.segment.clock_versions();
    ring.loses_registers(2);
    ring.now = Instant(9_000_000);
    ring.finds_of(versions, ClockFinding::MeasuredAgain(&measured(3, 100)));
    ring.finds_of(versions, ClockFinding::MeasurementEnded { failed: None });
    assert_eq!(ring.segment.clocks().doubtful_since(), Some(ring.now));
    assert_eq!(ring.references().main, Some(station(0)), "time is distributed meanwhile");
    let versions = ring.segment.clock_versions();
    ring.finds_of(versions, ClockFinding::MeasurementEnded { failed: None });
    assert_eq!(ring.segment.clocks().doubtful_since(), None);
}

// covers: dc-remeasure
#[test]
fn a_segment_that_cannot_be_measured_is_left_so_whatever_has_changed_meanwhile() {
    let mut ring = set_up(3);
    ring.clocks(ClockObservation::SegmentChanged);
    let versions = ring.segment.clock_versions();
    ring.loses_registers(2);
    isolate(&mut ring);
    let ended = ring.finds_of(versions, ClockFinding::MeasurementEnded { failed: Some("a reason".into()) });
    assert_eq!(reports(&ended), [Event::ClocksFailed { reason: "a reason".into() }]);
    assert_eq!(ring.segment.clocks().doubtful_since(), None);
}

// covers: dc-remeasure
#[test]
fn delays_that_have_changed_while_they_were_written_are_still_to_be_written() {
    let mut ring = set_up(3);
    ring.clocks(ClockObservation::SegmentChanged);
    ring.finds(ClockFinding::MeasuredAgain(&measured(3, 300)));
    let versions = ring.segment.clock_versions();
    // The application chooses another reference.
    let chosen = crate::config::ReferenceClock::FirstConfigured;
    ring.segment.clocks.nodes[1].is_configured = true;
    ring.clocks(ClockObservation::ReferenceChosen(chosen));
    ring.finds_of(versions, ClockFinding::DelaysWritten(Link::Main));
    let failed = ring.finds_of(versions, ClockFinding::DelaysNotWritten("a reason".into()));
    assert_eq!(failed, [], "they are not those that are wanted");
    assert_eq!(ring.segment.clocks().unwritten(), [Link::Main]);
    ring.finds_of(versions, ClockFinding::Followed);
    assert_eq!(ring.references(), References::default(), "delays have different origins");
    ring.finds(ClockFinding::MeasurementEnded { failed: None });
    assert_eq!((ring.segment.clocks().due(), ring.references()), (Due::Delays, References::default()));
    assert_eq!(ring.node(0).delay_ns, -300);
    ring.finds(ClockFinding::DelaysWritten(Link::Main));
    ring.finds(ClockFinding::Followed);
    assert_eq!(ring.references().main, Some(station(1)));
}

// covers: dc-remeasure
#[test]
fn filters_of_registers_that_were_lost_since_are_written_again() {
    for is_stale in [false, true] {
        let mut ring = set_up(2);
        let (versions, written) = (ring.segment.clock_versions(), [(ring.key(1), [0, 12])]);
        if is_stale {
            ring.loses_registers(1);
        }
        ring.finds_of(versions, ClockFinding::FiltersWritten(&written));
        assert_eq!(ring.node(1).filter_depths, (!is_stale).then_some([0, 12]));
    }
}

// covers: dc-remeasure
#[test]
fn filters_that_became_due_while_others_were_written_stay_due() {
    let mut ring = set_up(3);
    let versions = ring.segment.clock_versions();
    ring.answers(&[answer(Link::Main, 0), answer(Link::Main, 0), answer(Link::Redundant, 0)]);
    ring.answers(&[answer(Link::Main, 0), answer(Link::Main, 0), answer(Link::Redundant, 0)]);
    ring.finds(ClockFinding::DelaysWritten(Link::Redundant));
    ring.finds(ClockFinding::Followed);
    ring.finds_of(versions, ClockFinding::FiltersWritten(&[]));
    assert_eq!(ring.segment.clocks().due(), Due::Filters);
    ring.finds(ClockFinding::FiltersWritten(&[]));
    assert_eq!(ring.segment.clocks().due(), Due::Nothing);
}

// covers: dc-remeasure
#[test]
fn the_latch_mode_and_signals_of_registers_that_were_lost_since_are_not_stored() {
    let mut ring = set_up(2);
    let key = ring.key(1);
    ring.loses_registers(1);
    ring.clocks(ClockObservation::LatchModes(&[(key, true)]));
    ring.clocks(ClockObservation::Signals { key, are_starting: true });
    assert_eq!((ring.node(1).latches_backwards, ring.node(1).has_signals), (false, false));
    let key = ring.key(1);
    ring.clocks(ClockObservation::LatchModes(&[(key, true)]));
    ring.clocks(ClockObservation::Signals { key, are_starting: true });
    assert_eq!((ring.node(1).latches_backwards, ring.node(1).has_signals), (true, true));
}

// covers: dc-remeasure
#[test]
fn a_set_up_of_one_clock_before_it_lost_its_registers_again_does_not_count() {
    let mut ring = set_up(2);
    ring.loses_registers(1);
    let (versions, key, times) = (ring.segment.clock_versions(), ring.key(1), latched(&ring, 77));
    ring.loses_registers(1);
    let offset_ns = ring.node(1).offset_ns;
    ring.finds_of(versions, ClockFinding::LatchedFor { key, latched: &times, host: HOST });
    ring.finds_of(versions, ClockFinding::OneSetUp(key));
    assert_eq!((ring.node(1).is_unset, ring.node(1).offset_ns), (true, offset_ns));
    let (key, times) = (ring.key(1), latched(&ring, 77));
    ring.finds(ClockFinding::LatchedFor { key, latched: &times, host: HOST });
    ring.finds(ClockFinding::OneSetUp(key));
    assert_eq!((ring.node(1).is_unset, ring.node(1).offset_ns), (false, 100));
}

// covers: dc-reference
#[test]
fn an_offset_that_changes_while_one_clock_is_set_up_is_written_to_it_again() {
    let mut ring = set_up(2);
    let (versions, key) = (ring.segment.clock_versions(), ring.key(1));
    ring.clocks(ClockObservation::SteppingBack(50));
    ring.finds_of(versions, ClockFinding::OneSetUp(key));
    assert!(ring.node(1).missed_offset);
    ring.finds(ClockFinding::OneSetUp(key));
    assert!(!ring.node(1).missed_offset);
}

// covers: dc-reference
#[test]
fn an_offset_that_was_read_during_a_step_is_not_lost() {
    for (read_ns, is_lost) in [(1_000_i64, false), (950, false), (0, true)] {
        let mut ring = set_up(2);
        ring.segment.clocks.nodes[1].offset_ns = 1_000;
        let (versions, key) = (ring.segment.clock_versions(), ring.key(1));
        ring.clocks(ClockObservation::SteppingBack(50));
        ring.finds_of(versions, ClockFinding::OffsetRead { key, written_ns: 1_000, read: read_ns as u32 });
        assert_eq!(ring.node(1).is_unset, is_lost, "{read_ns}");
        // The same finding again concerns registers that are known to be lost.
        ring.finds_of(versions, ClockFinding::OneSetUp(ring.key(1)));
        ring.finds_of(versions, ClockFinding::OffsetRead { key, written_ns: 1_000, read: 0 });
        assert_eq!(ring.node(1).losses, 1, "{read_ns}");
    }
}

// covers: dc-reference
#[test]
fn offsets_that_were_written_before_another_jump_are_written_again() {
    let mut ring = set_up(2);
    jump(&mut ring);
    let versions = ring.segment.clock_versions();
    ring.clocks(ClockObservation::SteppingBack(50));
    assert_eq!(ring.finds_of(versions, ClockFinding::OffsetsWritten { missed: &[] }), []);
    assert!(ring.segment.clocks().are_offsets_due());
    let written = ring.finds(ClockFinding::OffsetsWritten { missed: &[] });
    assert_eq!((reports(&written).len(), ring.segment.clocks().are_offsets_due()), (1, false));
}

// covers: dc-reference
#[test]
fn a_clock_that_missed_an_offset_and_lost_its_registers_is_set_up_once() {
    let mut ring = set_up(2);
    let (versions, missed) = (ring.segment.clock_versions(), [ring.key(1)]);
    ring.loses_registers(1);
    ring.finds_of(versions, ClockFinding::SteppedBack { missed: &missed });
    assert!(!ring.node(1).missed_offset, "its own set-up is under way");
    let missed = [ring.key(1)];
    ring.finds(ClockFinding::SteppedBack { missed: &missed });
    assert!(ring.node(1).missed_offset);
}

// covers: dc-reference
#[test]
fn the_time_of_a_former_reference_or_from_before_a_step_does_not_count() {
    let changes: [fn(&mut Ring); 2] = [
        |ring| {
            ring.loses_registers(0);
            ring.finds(ClockFinding::MeasurementEnded { failed: None });
        },
        |ring| drop(ring.clocks(ClockObservation::SteppingBack(50))),
    ];
    for (number, change) in changes.into_iter().enumerate() {
        let mut ring = set_up(2);
        let (versions, key) = (ring.segment.clock_versions(), ring.key(0));
        change(&mut ring);
        let epoch = ring.segment.clocks().epoch;
        let read = ClockFinding::ReferenceTime { key, low: HOST as u32 + 777, sent_at: HOST };
        ring.finds_of(versions, read);
        assert_eq!(ring.segment.clocks().epoch, epoch, "change {number}");
        let (low, key) = (HOST as u32 + 777, ring.segment.clocks().reference_node().unwrap().key());
        ring.finds(ClockFinding::ReferenceTime { key, low, sent_at: HOST });
        assert_ne!(ring.segment.clocks().epoch, epoch, "change {number}");
    }
}

// covers: dc-lock
#[test]
fn differences_from_before_a_step_do_not_count_for_the_lock() {
    let mut ring = set_up(2);
    let versions = ring.segment.clock_versions();
    ring.clocks(ClockObservation::SteppingBack(50));
    for _ in 0..5 {
        assert_eq!(ring.answers_of(versions, &good(2)), []);
    }
    assert!(!ring.segment.clocks().are_locked());
    (0..3).for_each(|_| drop(ring.answers(&good(2))));
    assert!(ring.segment.clocks().are_locked());
}

// covers: dc-lock
#[test]
fn answers_while_subdevices_are_out_of_reach_move_no_clock_to_another_link() {
    let mut ring = set_up(2);
    let none = [answer(Link::Main, 0), Some(Answer::default())];
    let versions = ring.segment.clock_versions();
    isolate(&mut ring);
    (0..3).for_each(|_| assert_eq!(ring.answers_of(versions, &none), []));
    assert_eq!(ring.node(1).link, Some(Link::Main));
    (0..2).for_each(|_| drop(ring.answers(&none)));
    assert_eq!(ring.node(1).link, None);
}

// covers: dc-lock
#[test]
fn the_answer_of_registers_that_were_lost_since_is_none() {
    let mut ring = set_up(2);
    let keys = ring.segment.clocks().keys();
    ring.loses_registers(1);
    let answers = &keys.into_iter().map(|key| (key, Answer { link: None, ..Answer::default() })).collect();
    (0..2).for_each(|_| drop(ring.finds(ClockFinding::Answers { answers, is_explained: true })));
    assert_eq!(ring.node(1).link, Some(Link::Main));
}

// covers: dc-lock
#[test]
fn an_ended_drift_compensation_of_another_set_up_does_not_end_this_one() {
    let mut ring = set_up(2);
    assert_eq!(ring.clocks(ClockObservation::TimeWanted), [Effect::Start(Task::CompensateDrift)]);
    let mut before = ring.segment.clock_versions();
    before.changes.set_ups = before.changes.set_ups.wrapping_sub(1);
    ring.finds_of(before, ClockFinding::Compensated);
    assert_eq!(ring.clocks(ClockObservation::TimeWanted), [], "one at a time");
}

// covers: dc-lock
#[test]
fn a_member_that_was_lost_since_did_not_go_on_unlocked() {
    let mut ring = set_up(2);
    ring.segment.clocks.config.when_unlocked = crate::config::WhenUnlocked::GoOn;
    let attempt = ring.member(1).attempt;
    let not_locked = |attempt, is_hidden| {
        let reason = String::from("a reason");
        ClockFinding::NotLocked { member: 1, attempt, reason, is_hidden }
    };
    let gone_on = Event::WentOnUnlocked { subdevice: SubDeviceId(1), reason: "a reason".into() };
    assert_eq!(reports(&ring.finds(not_locked(attempt, false))), [gone_on]);
    assert_eq!(ring.finds(not_locked(attempt, true)), [], "its time may be wrong by any amount");
    assert_eq!(ring.finds(not_locked(attempt.wrapping_sub(1), false)), []);
    ring.segment.clocks.config.when_unlocked = crate::config::WhenUnlocked::StayInSafeOp;
    assert_eq!(ring.finds(not_locked(attempt, false)), []);
}
