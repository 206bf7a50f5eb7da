//! Without an application: from the answers to broadcasts to events, scans and reads.

use crate::ring_status::LinkCounts;
use crate::segment::effect::Watch;
use crate::segment::idle::{Change, Comparison};

use super::*;

const PREOP: u8 = 2;
/// Interval of the broadcasts.
const PERIOD: Duration = Duration::from_millis(20);

fn found(stations: &[u16]) -> Scan {
    super::found(&stations.iter().map(|station| (*station, 0)).collect::<Vec<_>>())
}

/// A ring without an application.
struct Idle {
    segment: Segment,
    now: Instant,
    words: Posted,
}

impl Idle {
    fn unscanned() -> Idle {
        let mut segment = Segment::new(Choices { idle_operation: true, ..choices() });
        let ring = RingWord { state: RingState::Closed, ..RingWord::default() };
        let (carriers, links) = ([Some(true); 2], LinkSet::Ring);
        segment.observe(Observation::Undeclared(UndeclaredObservation::KeepingBegun), Instant(0));
        segment.observe(Observation::Idle(IdleObservation::Watched(carriers, ring.state)), Instant(0));
        let words = Posted { links, carriers, ring, supervision: None, cycles: 0 };
        Idle { segment, now: Instant(0), words }
    }

    /// Three SubDevices are known and in PREOP.
    fn kept() -> Idle {
        let mut idle = Idle::unscanned();
        assert_eq!(idle.broadcast(3, 1), [Effect::Start(Task::ScanSegment { number: idle.segment.scan_number() })]);
        idle.observe(Observation::ScanEnded(Ok(found(&[1, 2, 3]))));
        idle.seen(IdleObservation::Scanned);
        idle.broadcast(3, 1);
        idle.seen(IdleObservation::StatesRead(&[]));
        for effect in idle.observe(Observation::Undeclared(UndeclaredObservation::AttemptsDue)) {
            if let Effect::Start(Task::BringUndeclared { key, attempt }) = effect {
                let ended = UndeclaredObservation::AttemptEnded { key, attempt, failure: None };
                idle.observe(Observation::Undeclared(ended));
            }
        }
        assert_eq!(idle.broadcast(3, PREOP), [], "nothing has changed");
        idle
    }

    fn observe(&mut self, seen: Observation<'_>) -> Vec<Effect> {
        self.segment.observe(seen, self.now).0
    }

    fn seen(&mut self, seen: IdleObservation<'_>) -> Vec<Effect> {
        self.observe(Observation::Idle(seen))
    }

    /// The next broadcast, processed by this number of SubDevices on the main link.
    fn broadcast(&mut self, count: u16, al_status: u8) -> Vec<Effect> {
        self.now += PERIOD;
        let supervision = Supervision { main: Wkc(count), al_status: [al_status, 0], ..Supervision::default() };
        self.observe(Observation::Words(self.words.words().with_result(0, supervision)))
    }

    fn unanswered(&mut self) -> Vec<Effect> {
        self.now += PERIOD;
        self.seen(IdleObservation::Unanswered(self.words.words()))
    }

    fn followed(&mut self, stations: &[u16], wanted: Option<u64>) -> Vec<Effect> {
        let (versions, found) = (self.segment.versions(), Rc::new(Found::from(found(stations))));
        self.seen(IdleObservation::Followed { versions, found, wanted })
    }
}

fn follow(main: u16) -> Effect {
    let counts = LinkCounts { main, redundant: 0 };
    Effect::Start(Task::FollowChange(Change { counts, ports_changed: false, is_unplugged: false, wanted: None }))
}

#[test]
fn idle_operation_starts_its_watches_once_and_an_application_its_own() {
    let mut idle = Idle::unscanned();
    let watches = [Watch::Undeclared, Watch::UndeclaredMail, Watch::Idle];
    assert_eq!(idle.seen(IdleObservation::Begun), watches.map(|watch| Effect::Start(Task::Watch(watch))));
    let mut ring = super::Ring::closed(2);
    let started = ring.observe(Observation::Attached);
    let watches = started.iter().filter(|effect| matches!(effect, Effect::Start(Task::Watch(_)))).count();
    assert_eq!(watches, 7, "supervision, registers, errors, SIIs, mail, requests, statistics: {started:?}");
}

#[test]
fn subdevices_go_to_preop_when_the_first_scan_has_ended_without_a_broadcast() {
    for has_begun_again in [false, true] {
        let mut idle = Idle::unscanned();
        idle.broadcast(3, 1);
        idle.observe(Observation::ScanEnded(Ok(found(&[1, 2, 3]))));
        if has_begun_again {
            // The application has requested another scan meanwhile.
            idle.observe(Observation::ScanBegun);
        }
        idle.seen(IdleObservation::Scanned);
        let begun = idle.observe(Observation::Undeclared(UndeclaredObservation::AttemptsDue));
        let attempts = begun.iter().filter(|it| matches!(it, Effect::Start(Task::BringUndeclared { .. }))).count();
        assert_eq!(attempts, if has_begun_again { 0 } else { 3 }, "{begun:?}");
    }
}

#[test]
fn another_count_is_reported_once_and_followed_until_that_succeeds() {
    let mut idle = Idle::kept();
    let counted = Effect::Report(Event::Counted { main: 2, redundant: 0 });
    assert_eq!(idle.broadcast(2, PREOP), [counted, follow(2)]);
    assert_eq!(idle.broadcast(2, PREOP), [], "one procedure at a time");
    idle.seen(IdleObservation::NotFollowed(None));
    assert_eq!(idle.broadcast(2, PREOP), [follow(2)]);
    let changed = Event::SegmentChanged { subdevices: 2, added: 0, removed: 1 };
    assert_eq!(reports(&idle.followed(&[1, 2], None)), [changed]);
    assert_eq!(idle.broadcast(2, PREOP), []);
    assert_eq!(idle.segment.found().unwrap().subdevices.len(), 2);
}

#[test]
fn a_scan_that_cannot_follow_is_reported_once_after_20_failures() {
    let mut idle = Idle::kept();
    idle.broadcast(2, PREOP);
    let mut reported = Vec::new();
    for _ in 0..60 {
        // Now and then the segment changes meanwhile.
        reported.extend(reports(&idle.seen(IdleObservation::NotFollowed(None))));
        idle.broadcast(2, PREOP);
        reported.extend(reports(&idle.seen(IdleObservation::NotFollowed(Some("a reason".into())))));
        idle.broadcast(2, PREOP);
    }
    assert_eq!(reported, [Event::ScanFailed { reason: "a reason".into() }]);
}

#[test]
fn a_scan_that_began_before_another_scan_is_refused() {
    let mut idle = Idle::kept();
    idle.broadcast(2, PREOP);
    let versions = idle.segment.versions();
    idle.observe(Observation::ScanBegun);
    idle.observe(Observation::ScanEnded(Ok(found(&[1, 2, 3, 4]))));
    let found = Rc::new(Found::from(found(&[1, 2])));
    assert_eq!(idle.seen(IdleObservation::Followed { versions, found, wanted: None }), []);
    assert_eq!(idle.segment.found().unwrap().subdevices.len(), 4);
    assert_eq!(idle.segment.idle.compared, Comparison::Open);
    assert_eq!(reports(&idle.broadcast(4, 1)), [], "the new scan shows the segment");
}

#[test]
fn a_lost_broadcast_is_no_evidence_and_three_are() {
    let mut idle = Idle::kept();
    assert_eq!([idle.unanswered(), idle.unanswered()], [vec![], vec![]]);
    idle.broadcast(3, PREOP);
    assert_eq!([idle.unanswered(), idle.unanswered()], [vec![], vec![]]);
    assert_eq!(idle.unanswered(), [Effect::Report(Event::Counted { main: 0, redundant: 0 }), follow(0)]);
}

#[test]
fn links_without_a_carrier_show_an_empty_segment_at_once() {
    let mut idle = Idle::kept();
    idle.words.carriers = [Some(false); 2];
    let down = [Link::Main, Link::Redundant].map(|link| Event::LinkDown { link });
    let shown = reports(&idle.unanswered());
    assert_eq!(shown, [&down[..], &[Event::Counted { main: 0, redundant: 0 }]].concat());
}

#[test]
fn a_rescan_on_request_has_the_result_of_a_scan_that_began_after_it() {
    let mut idle = Idle::kept();
    idle.broadcast(2, PREOP);
    idle.seen(IdleObservation::RescanAsked);
    let number = idle.segment.last_rescan_asked();
    idle.followed(&[1, 2], None);
    assert_eq!(idle.segment.rescanned(number), None, "that scan began before");
    let effects = idle.broadcast(2, PREOP);
    assert!(matches!(effects[..], [Effect::Start(Task::FollowChange(Change { wanted: Some(1), .. }))]), "{effects:?}");
    idle.followed(&[2, 1, 4], Some(number));
    let differences = idle.segment.rescanned(number).unwrap();
    assert_eq!((&differences.added[..], &differences.removed[..]), (&[StationAddress(4)][..], &[][..]));
    assert_eq!(differences.moved.len(), 1);
}

#[test]
fn a_lost_or_doubled_address_is_followed_unless_its_subdevice_has_left() {
    for shown in [ShownState::Elsewhere, ShownState::Unknown] {
        for has_left in [false, true] {
            let mut idle = Idle::kept();
            let (key, attempt) = idle.segment.kept()[0];
            let key = if has_left { SubDeviceKey { since: key.since + 9, ..key } } else { key };
            idle.seen(IdleObservation::SomeRead(&[StateRead { key, attempt, shown }]));
            let is_followed = shown != ShownState::Unknown && !has_left;
            assert_eq!(idle.broadcast(3, PREOP) == [follow(3)], is_followed, "{shown:?}, has left: {has_left}");
        }
    }
}

#[test]
fn an_unexpected_or_of_states_is_read_once_until_it_is_another_one() {
    let mut idle = Idle::kept();
    for (al_status, is_read) in
        [(PREOP | 1, true), (PREOP | 1, false), (PREOP | 4, true), (PREOP, false), (PREOP | 4, true)]
    {
        let started = idle.broadcast(3, al_status);
        assert_eq!(started == [Effect::Start(Task::ReadStates)], is_read, "{al_status}: {started:?}");
        idle.seen(IdleObservation::StatesRead(&[]));
    }
    let all: Vec<SubDeviceKey> = idle.segment.kept().into_iter().map(|(key, _)| key).collect();
    assert_eq!(idle.segment.kept_from(2).map(|(key, _)| key).collect::<Vec<_>>(), all[2..]);
    assert_eq!(idle.segment.kept_from(3).count(), 0);
}

/// While EEPROMs are read a change is reported and ends the reading; while a scan changes ports or addresses broadcasts
/// show what it does itself.
#[test]
fn a_change_is_noticed_while_a_scan_reads_and_not_while_it_changes_the_segment() {
    let mut idle = Idle::kept();
    let counted = |main| Effect::Report(Event::Counted { main, redundant: 0 });
    assert_eq!(idle.broadcast(2, PREOP), [counted(2), follow(2)]);
    let begun = idle.segment.idle_changes();
    assert_eq!(idle.broadcast(1, PREOP), [], "a port is closed to learn a ring");
    let (key, attempt) = idle.segment.kept()[0];
    let lost = [StateRead { key, attempt, shown: ShownState::Elsewhere }];
    idle.seen(IdleObservation::SomeRead(&lost));
    assert_eq!(idle.segment.idle_changes(), begun);
    idle.seen(IdleObservation::ReadingBegun(&[key.station]));
    idle.seen(IdleObservation::SomeRead(&lost));
    assert_eq!(idle.broadcast(2, PREOP), []);
    assert_eq!(idle.segment.idle_changes(), begun, "the scan has given it another address");
    assert_eq!(idle.broadcast(3, PREOP), [counted(3)]);
    assert_eq!(idle.segment.idle_changes(), begun + 1);
    idle.seen(IdleObservation::ReadingBegun(&[]));
    idle.seen(IdleObservation::SomeRead(&lost));
    assert_eq!(idle.segment.idle_changes(), begun + 2);
    idle.seen(IdleObservation::ReadingEnded);
    idle.seen(IdleObservation::NotFollowed(None));
    assert_eq!(idle.broadcast(3, PREOP), [follow(3)]);
}

/// An application ends: broadcasts are evaluated again when it has ended.
#[test]
fn broadcasts_during_a_deactivation_start_nothing() {
    let mut idle = Idle::kept();
    idle.seen(IdleObservation::Deactivating);
    idle.seen(IdleObservation::Watched([Some(true); 2], RingState::Closed));
    assert_eq!([idle.broadcast(2, 8), idle.broadcast(1, 1)], [vec![], vec![]]);
    idle.seen(IdleObservation::Deactivated);
    let counted = Effect::Report(Event::Counted { main: 1, redundant: 0 });
    assert_eq!(idle.broadcast(1, PREOP), [counted, follow(1)]);
}

// covers: ring-flap
#[test]
fn rings_and_links_that_flap_in_idle_are_reported_a_bounded_number_of_times() {
    let mut idle = Idle::kept();
    let mut reported = Vec::new();
    for number in 0..3_000 {
        let is_open = number % 2 == 0;
        idle.words.ring.state = if is_open { RingState::Open } else { RingState::Closed };
        idle.words.carriers = [Some(true), Some(!is_open)];
        reported.extend(reports(&idle.broadcast(3, PREOP)));
        idle.seen(IdleObservation::StatesRead(&[]));
    }
    let of = |is_it: fn(&Event) -> bool| reported.iter().filter(|event| is_it(event)).count();
    let edges = of(|event| matches!(event, Event::RingOpened { .. } | Event::RingClosed { .. }));
    let links = of(|event| matches!(event, Event::LinkUp { .. } | Event::LinkDown { .. }));
    assert!((32..60).contains(&edges) && (32..60).contains(&links), "{edges} of the ring, {links} of the link");
    assert_eq!(of(|event| matches!(event, Event::RingUnsteady { .. })), 1);
}
