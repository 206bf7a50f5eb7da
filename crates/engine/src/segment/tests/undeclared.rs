//! SubDevices without a declaration: requested states, attempts, mailboxes, and findings that are refused.

mod pdos;

use alloc::string::String;

use crate::segment::view::View;

use super::*;

const PREOP: AlState = AlState::PreOp;

/// A segment without an application.
struct Idle {
    segment: Segment,
    now: Instant,
}

impl Idle {
    fn scanned(stations: &[(u16, u32)], retries: Retries) -> Idle {
        let mut segment = Segment::new(Choices { retries, idle_operation: true, ..choices() });
        segment.observe(Observation::ScanBegun, Instant(0));
        segment.observe(Observation::ScanEnded(Ok(found(stations))), Instant(0));
        Idle { segment, now: Instant(0) }
    }

    /// All SubDevices are kept in PREOP and have reached it.
    fn kept(stations: &[(u16, u32)]) -> Idle {
        let mut idle = Idle::scanned(stations, Retries::Always);
        idle.seen(UndeclaredObservation::KeepingBegun);
        idle.seen(UndeclaredObservation::TakenOver);
        for begun in attempts(&idle.seen(UndeclaredObservation::AttemptsDue)) {
            idle.end(begun, None);
        }
        assert!(idle.segment.are_undeclared_settled());
        idle
    }

    fn observe(&mut self, seen: Observation<'_>) -> Vec<Effect> {
        self.segment.observe(seen, self.now).0
    }

    fn seen(&mut self, seen: UndeclaredObservation<'_>) -> Vec<Effect> {
        self.observe(Observation::Undeclared(seen))
    }

    fn key(&self, position: u16) -> SubDeviceKey {
        let mut all = self.segment.subdevices().unassigned();
        all.find(|it| it.position == Position(position)).unwrap().key
    }

    fn request(&mut self, position: u16, state: AlState) -> Vec<Effect> {
        let subdevice = Addressed::Undeclared(self.key(position));
        self.observe(Observation::Requested { subdevice, state })
    }

    fn end(&mut self, (key, attempt): (SubDeviceKey, u32), failure: Option<AttemptFailure>) -> Vec<Effect> {
        self.seen(UndeclaredObservation::AttemptEnded { key, attempt, failure })
    }

    fn find_again(&mut self, stations: &[(u16, u32)]) -> Vec<Effect> {
        let versions = self.segment.versions();
        self.observe(Observation::FoundAgain { versions, found: Rc::new(Found::from(found(stations))) })
    }

    /// The state and progress of the SubDevice at a position.
    fn progress(&self, position: u16) -> (AlState, UpkeepProgress) {
        let upkeep = self.segment.upkeep(self.key(position)).unwrap();
        (upkeep.target, upkeep.progress)
    }

    /// An application declares the SubDevice at position 0; the others have no declaration.
    fn activate(&mut self) -> Vec<Effect> {
        let scan = self.segment.found().unwrap().clone();
        let first = scan.subdevices[0].clone();
        let config = SubDeviceConfig::at_position(0);
        let member = SubDevice::declared(config, Some(first.clone()), first.station, Err(None));
        let owners = Owners::new((0..scan.subdevices.len()).map(|at| (at == 0).then_some(0)).collect(), |_| false);
        let others = scan.subdevices[1..].iter().map(|info| SubDevice::undeclared(info.clone(), &owners, 3));
        let subdevices = SubDevices::new(vec![member], others);
        let board = Arc::new(Board::new(1));
        let cabling = Cabling { stations: scan.stations(), ..Cabling::default() };
        self.observe(Observation::Activated(Box::new(Declared { subdevices, cabling, board, ..Declared::default() })))
    }
}

fn attempts(effects: &[Effect]) -> Vec<(SubDeviceKey, u32)> {
    let begun = |effect: &Effect| match effect {
        Effect::Start(Task::BringUndeclared { key, attempt }) => Some((*key, *attempt)),
        _ => None,
    };
    effects.iter().filter_map(begun).collect()
}

/// Station addresses and positions of those with mailboxes, if these have changed.
fn mailboxes(effects: &[Effect]) -> Option<Vec<(u16, u16)>> {
    effects.iter().find_map(|effect| match effect {
        Effect::Mailboxes(all) => Some(all.iter().map(|(key, position)| (key.station.0, position.0)).collect()),
        _ => None,
    })
}

fn refusal() -> Option<AttemptFailure> {
    Some(AttemptFailure { is_of_bus: false, reason: String::from("refused") })
}

fn lost() -> Option<AttemptFailure> {
    Some(AttemptFailure { is_of_bus: true, reason: String::from("lost") })
}

fn answer(state: AlState) -> ShownState {
    ShownState::Shown((AlStatus::new(state), AlStatusCode(0)))
}

const THREE: [(u16, u32); 3] = [(0x1001, 1), (0x1002, 2), (0x1003, 3)];

#[test]
fn each_subdevice_that_is_taken_over_gets_one_attempt_and_a_mailbox() {
    let mut idle = Idle::scanned(&THREE, Retries::Always);
    assert!(idle.segment.has_untouched() && idle.segment.next_attempt() == Instant::NEVER);
    let effects = idle.seen(UndeclaredObservation::TakenOver);
    assert_eq!(mailboxes(&effects), Some(vec![(0x1001, 0), (0x1002, 1), (0x1003, 2)]));
    assert_eq!(idle.seen(UndeclaredObservation::TakenOver), [], "once");
    let begun = attempts(&idle.seen(UndeclaredObservation::AttemptsDue));
    assert_eq!(begun, [0, 1, 2].map(|at| (idle.key(at), 1)));
    assert_eq!(idle.seen(UndeclaredObservation::AttemptsDue), [], "all are under way");
    for (settled, attempt) in begun.into_iter().enumerate() {
        assert_eq!(idle.segment.unsettled().len(), 3 - settled);
        assert_eq!(idle.end(attempt, None), []);
    }
    assert_eq!((idle.segment.expected_states(), idle.segment.settled().len()), (Some(PREOP.code()), 3));
}

#[test]
fn the_same_request_joins_the_attempt_under_way_and_another_one_replaces_it() {
    let mut idle = Idle::kept(&THREE);
    let first = attempts(&idle.request(1, AlState::Op))[0];
    assert_eq!(idle.request(1, AlState::Op), []);
    let second = attempts(&idle.request(1, AlState::SafeOp))[0];
    assert_eq!((first.0, first.1 + 1), second);
    for failure in [None, refusal()] {
        assert_eq!(idle.end(first, failure), [], "it is no longer the current one");
        assert_eq!(idle.progress(1), (AlState::SafeOp, UpkeepProgress::UnderWay));
    }
    idle.end(second, None);
    assert_eq!(idle.progress(1), (AlState::SafeOp, UpkeepProgress::Reached));
    assert_eq!(idle.end(second, refusal()), [], "it has ended");
    let begun = attempts(&idle.request(1, AlState::Op))[0];
    let task = Task::KeepOutputs { key: begun.0, attempt: begun.1 };
    assert_eq!(idle.end(begun, None), [Effect::Start(task)]);
}

#[test]
fn a_refused_state_is_followed_by_the_state_before_after_pauses_that_double() {
    let mut idle = Idle::kept(&THREE);
    let mut attempt = attempts(&idle.request(2, AlState::SafeOp))[0];
    idle.end(attempt, None);
    attempt = attempts(&idle.request(2, AlState::Op))[0];
    let mut targets = Vec::new();
    for pause in [100, 200, 400, 800, 1600, 3200, 5000, 5000] {
        let reported = reports(&idle.end(attempt, refusal()));
        assert_eq!(reported, [Event::UndeclaredFailed { position: Position(2), reason: "refused".into() }]);
        let due = idle.now + Duration::from_millis(pause);
        assert_eq!(idle.segment.next_attempt(), due);
        targets.push(idle.progress(2).0);
        idle.now = Instant(due.0 - 1);
        assert_eq!(idle.seen(UndeclaredObservation::AttemptsDue), [], "not due yet");
        idle.now = due;
        attempt = attempts(&idle.seen(UndeclaredObservation::AttemptsDue))[0];
    }
    assert_eq!(targets[..2], [AlState::SafeOp, PREOP]);
    assert!(targets[2..].iter().all(|target| *target == PREOP));
}

#[test]
fn lost_frames_keep_the_requested_state_and_are_reported_once() {
    let mut idle = Idle::kept(&THREE);
    let mut attempt = attempts(&idle.request(0, AlState::Op))[0];
    for reported in [1, 0, 0] {
        assert_eq!(reports(&idle.end(attempt, lost())).len(), reported);
        assert_eq!(idle.progress(0).0, AlState::Op);
        idle.now = idle.segment.next_attempt();
        attempt = attempts(&idle.seen(UndeclaredObservation::AttemptsDue))[0];
    }
}

#[test]
fn with_retries_on_request_a_refusal_waits_and_a_lost_frame_does_not() {
    let mut idle = Idle::scanned(&THREE, Retries::OnRequest);
    idle.seen(UndeclaredObservation::TakenOver);
    let begun = attempts(&idle.seen(UndeclaredObservation::AttemptsDue));
    assert_eq!(idle.end(begun[0], lost()), [], "nothing is kept, so nothing is reported");
    idle.end(begun[1], refusal());
    idle.end(begun[2], refusal());
    let pause = idle.now + Duration::from_millis(5);
    assert_eq!(
        [0, 1, 2].map(|at| idle.progress(at).1),
        [pause, Instant::NEVER, Instant::NEVER].map(UpkeepProgress::Due)
    );
    let one = Addressed::Undeclared(idle.key(1));
    idle.observe(Observation::Retried(Some(one)));
    assert_eq!(attempts(&idle.seen(UndeclaredObservation::AttemptsDue)), [(idle.key(1), 2)]);
    idle.observe(Observation::Retried(None));
    let all = attempts(&idle.seen(UndeclaredObservation::AttemptsDue));
    assert_eq!(all, [(idle.key(0), 2), (idle.key(2), 2)], "the other one is under way");
}

#[test]
fn a_retry_of_a_member_counts_for_it_alone() {
    let mut ring = Ring::closed(3);
    let retries = |ring: &Ring| [0, 1, 2].map(|index| ring.member(index).retries);
    ring.observe(Observation::Retried(Some(Addressed::Member(1))));
    assert_eq!(retries(&ring), [0, 1, 0]);
    ring.observe(Observation::Retried(None));
    assert_eq!(retries(&ring), [1, 2, 1]);
}

#[test]
fn a_state_that_was_left_is_reported_once_and_brought_back() {
    let mut idle = Idle::kept(&THREE);
    let (key, attempt) = idle.segment.settled()[1];
    let read = |shown| [StateRead { key, attempt: Some(attempt), shown }];
    assert_eq!(idle.seen(UndeclaredObservation::StatesRead(&read(answer(PREOP)))), []);
    assert_eq!(
        idle.seen(UndeclaredObservation::StatesRead(&read(ShownState::Elsewhere))),
        [],
        "no information about its state"
    );
    let effects = idle.seen(UndeclaredObservation::StatesRead(&read(answer(AlState::Init))));
    assert!(matches!(reports(&effects)[..], [Event::UndeclaredState { position: Position(1), .. }]));
    assert_eq!(idle.seen(UndeclaredObservation::StatesRead(&read(answer(AlState::Init)))), [], "once");
    assert_eq!(attempts(&idle.seen(UndeclaredObservation::AttemptsDue)), [(key, attempt + 1)]);
}

#[test]
fn a_state_that_was_read_before_a_request_is_not_taken_for_a_lost_one() {
    let mut idle = Idle::kept(&THREE);
    let (key, attempt) = idle.segment.settled()[0];
    let begun = attempts(&idle.request(0, AlState::Op))[0];
    assert_eq!(idle.segment.kept()[0], (key, None), "a read that is requested now shows no state that was left");
    idle.end(begun, None);
    assert_eq!(idle.segment.kept()[0], (key, Some(begun.1)));
    // The read was requested in PREOP, and its answer is evaluated in OP.
    let early = [StateRead { key, attempt: Some(attempt), shown: answer(PREOP) }];
    assert_eq!(idle.seen(UndeclaredObservation::StatesRead(&early)), []);
    assert_eq!(idle.progress(0), (AlState::Op, UpkeepProgress::Reached));
    let late = [StateRead { key, attempt: Some(begun.1), shown: answer(PREOP) }];
    assert_eq!(reports(&idle.seen(UndeclaredObservation::StatesRead(&late))).len(), 1);
}

#[test]
fn a_forced_state_ends_the_attempt_and_stays_until_the_next_request() {
    let mut idle = Idle::kept(&THREE);
    let (key, _) = idle.segment.settled()[0];
    let begun = attempts(&idle.request(0, AlState::Op))[0];
    idle.seen(UndeclaredObservation::Forced(key));
    assert_eq!(idle.end(begun, refusal()), []);
    assert_eq!((idle.progress(0).1, idle.segment.expected_states()), (UpkeepProgress::Left, None));
    let settled = idle.segment.settled();
    let read = [StateRead { key, attempt: Some(settled[0].1), shown: answer(AlState::SafeOp) }];
    assert_eq!(idle.seen(UndeclaredObservation::StatesRead(&read)), []);
    idle.observe(Observation::Retried(None));
    assert_eq!(idle.seen(UndeclaredObservation::AttemptsDue), []);
    assert_eq!(attempts(&idle.request(0, PREOP)).len(), 1);
}

#[test]
fn subdevices_in_place_keep_their_attempts_when_the_segment_is_found_again() {
    let mut idle = Idle::kept(&THREE);
    let begun = attempts(&idle.request(2, AlState::SafeOp))[0];
    let (second, first) = (idle.key(1), idle.key(0));
    // The first has left, another one is at the address of the second, and a new one is behind the third.
    let effects = idle.find_again(&[(0x1002, 7), (0x1003, 3), (0x1004, 4)]);
    assert_eq!(mailboxes(&effects), Some(vec![(0x1003, 1)]));
    assert!(idle.key(1) == begun.0 && idle.key(0) != second);
    assert_eq!(idle.observe(Observation::Requested { subdevice: Addressed::Undeclared(first), state: PREOP }), []);
    assert_eq!(idle.end((second, 1), None), [], "the SubDevice of this attempt has left");
    idle.end(begun, None);
    assert_eq!(idle.progress(1), (AlState::SafeOp, UpkeepProgress::Reached));
    let effects = idle.seen(UndeclaredObservation::TakenOver);
    assert_eq!(mailboxes(&effects), Some(vec![(0x1002, 0), (0x1003, 1), (0x1004, 2)]));
    assert_eq!(attempts(&idle.seen(UndeclaredObservation::AttemptsDue)), [(idle.key(0), 1), (idle.key(2), 1)]);
    // The address of the new one is used again for another one, without it having been seen to leave.
    let before = idle.key(2);
    idle.find_again(&[(0x1002, 7), (0x1003, 3), (0x1004, 5)]);
    assert_ne!(idle.key(2), before);
}

#[test]
fn an_application_ends_attempts_of_its_subdevices_and_leaves_the_others() {
    for is_kept in [true, false] {
        let mut idle = Idle::scanned(&THREE, Retries::Always);
        if is_kept {
            idle.seen(UndeclaredObservation::KeepingBegun);
        }
        idle.seen(UndeclaredObservation::TakenOver);
        let begun = attempts(&idle.seen(UndeclaredObservation::AttemptsDue));
        let effects = idle.activate();
        let left = if is_kept { vec![(0x1002, 1), (0x1003, 2)] } else { vec![] };
        assert_eq!(mailboxes(&effects), Some(left));
        assert_eq!((idle.segment.keeps_undeclared(), idle.segment.has_untouched()), (is_kept, !is_kept));
        idle.end(begun[0], refusal());
        idle.end(begun[1], None);
        idle.end(begun[2], None);
        assert_eq!(idle.segment.settled().len(), if is_kept { 2 } else { 0 });
        let effects = idle.observe(Observation::Deactivated);
        assert_eq!(mailboxes(&effects), is_kept.then(Vec::new), "their mailboxes end with the other procedures");
        assert!(!idle.segment.keeps_undeclared() && idle.segment.settled().is_empty());
        for attempt in begun {
            assert_eq!(idle.end(attempt, refusal()), [], "a finding from before the application");
        }
    }
}

#[test]
fn a_subdevice_that_is_found_beside_an_application_is_kept_as_well() {
    const TEMPORARY: StationAddress = StationAddress(0xC000);
    let mut idle = Idle::kept(&THREE);
    idle.activate();
    let stations: Vec<StationAddress> = idle.segment.stations_by_position();
    let view = View {
        counts: (Wkc(4), Wkc(0)),
        ring: RingWord::default(),
        stations: stations.into_iter().chain([TEMPORARY]).collect(),
    };
    let versions = idle.segment.versions();
    idle.observe(Observation::Given { versions, view: &view, given: &[given(TEMPORARY)] });
    let key = idle.key(3);
    let info = SubDeviceInfo { station: TEMPORARY, ..SubDeviceInfo::default() };
    assert_eq!(mailboxes(&idle.observe(Observation::Read { key, read: Ok(Rc::new(info)) })), None, "may be a member");
    let effects = idle.observe(Observation::Unexpected(key));
    assert_eq!(mailboxes(&effects), Some(vec![(0x1002, 1), (0x1003, 2), (TEMPORARY.0, 3)]));
    assert_eq!(attempts(&idle.seen(UndeclaredObservation::AttemptsDue)), [(key, 1)]);
    let effects = idle.observe(Observation::Readdressing(&[TEMPORARY]));
    assert_eq!(mailboxes(&effects), Some(vec![(0x1002, 1), (0x1003, 2)]));
    assert_eq!(idle.end((key, 1), refusal()), [], "it has left");
}
