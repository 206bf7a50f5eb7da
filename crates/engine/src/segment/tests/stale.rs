//! Findings that were requested before a change of the model arrive after it: each is refused, per fact.

use alloc::string::String;

use ringcat_wire::sii::Identity;

use crate::info::{PdoSource, SiiExtent};
use crate::ring::FrameLimit;
use crate::segment::unassigned::UnassignedView;
use crate::segment::view::View;

use super::*;

/// A temporary address.
const TEMPORARY: StationAddress = StationAddress(0xC000);

/// Changes of a member, after which the findings of its earlier attempt are stale.
const CHANGES: [fn(&mut Ring); 3] = [lose, replace, reset];

fn lose(ring: &mut Ring) {
    ring.observe(of_member((0, 0), MemberFinding::Unreachable));
}

/// Another SubDevice answers at its address.
fn replace(ring: &mut Ring) {
    lose(ring);
    let attempt = ring.member(0).attempt;
    ring.scan(&[PASS; 3]);
    ring.observe(of_member((0, attempt + 1), MemberFinding::NotReturned));
}

/// Its registers no longer hold what was written.
fn reset(ring: &mut Ring) {
    ring.observe(of_member((0, 0), MemberFinding::Undone("FMMUs".into())));
}

fn info(serial: u32, station: StationAddress) -> SubDeviceInfo {
    let identity = Identity { vendor_id: 2, product_code: 7, revision: 1, serial };
    SubDeviceInfo { station, identity, ..SubDeviceInfo::default() }
}

fn first_unassigned(ring: &Ring) -> UnassignedView<'_> {
    ring.segment.subdevices.unassigned().next().unwrap()
}

/// The addresses of three members, with those of `others` behind them.
fn view(others: &[StationAddress]) -> View {
    let stations: Vec<StationAddress> = (0..3).map(station).chain(others.iter().copied()).collect();
    View { counts: (Wkc(stations.len() as u16), Wkc(0)), ring: RingWord::default(), stations }
}

/// A fourth SubDevice, without a declaration, is found at the end and gets a temporary address.
fn give(ring: &mut Ring) -> u32 {
    let versions = ring.segment.versions();
    ring.observe(Observation::Given { versions, view: &view(&[TEMPORARY]), given: &[given(TEMPORARY)] });
    ring.segment.versions().addresses
}

fn isolate(ring: &mut Ring, number: u32) {
    ring.observe(Observation::Wanted(Wanted { disturbance: Disturbance::IsolateRings, number }));
}

#[test]
fn process_data_steps_of_an_ended_attempt_do_not_reach_the_exchange() {
    for (number, change) in CHANGES.into_iter().enumerate() {
        let mut ring = Ring::closed(3);
        let joined = |attempt| of_member((0, attempt), MemberFinding::ProcessData(ProcessDataStep::Joined));
        ring.observe(joined(0));
        assert!(ring.segment.board.takes_part(0));
        change(&mut ring);
        ring.segment.board.set_taking_part(0, false);
        assert_eq!(ring.observe(joined(0)), [], "change {number}");
        assert!(!ring.segment.board.takes_part(0), "change {number}: no working counter expects it");
        let attempt = ring.member(0).attempt;
        ring.observe(joined(attempt));
        assert!(ring.segment.board.takes_part(0), "change {number}");
    }
}

#[test]
fn an_ended_attempt_does_not_mark_a_member_as_configured() {
    for (number, change) in CHANGES.into_iter().enumerate() {
        let mut ring = Ring::closed(3);
        change(&mut ring);
        ring.observe(of_member((0, 0), MemberFinding::Configured(true)));
        assert!(!ring.member(0).configured, "change {number}");
        let attempt = ring.member(0).attempt;
        ring.observe(of_member((0, attempt), MemberFinding::Configured(true)));
        assert!(ring.member(0).configured, "change {number}");
    }
}

#[test]
fn an_sii_that_was_read_before_a_change_is_not_taken_over() {
    for (number, change) in CHANGES.into_iter().enumerate() {
        let mut ring = Ring::closed(3);
        change(&mut ring);
        let serial = |ring: &Ring| ring.member(0).info.map(|info| info.identity.serial);
        ring.observe(of_member((0, 0), MemberFinding::ReadAgain(&info(5, station(0)))));
        assert_eq!(serial(&ring), Some(0), "change {number}");
        let attempt = ring.member(0).attempt;
        ring.observe(of_member((0, attempt), MemberFinding::ReadAgain(&info(5, station(0)))));
        assert_eq!(serial(&ring), Some(5), "change {number}");
    }
}

#[test]
fn a_member_that_came_back_by_itself_is_not_replaced_by_an_admitted_subdevice() {
    let mut ring = Ring::closed(3);
    lose(&mut ring);
    let attempt = ring.member(0).attempt;
    let since = give(&mut ring);
    let admitted = || {
        let info = Box::new(info(5, station(0)));
        Observation::Admitted { key: SubDeviceKey { station: TEMPORARY, since }, index: 0, attempt, info }
    };
    // It answers at its address: it is being configured again.
    ring.scan(&[PASS; 3]);
    let back = ring.member(0).attempt;
    assert_ne!(back, attempt);
    assert_eq!(reports(&ring.observe(admitted())), []);
    assert_eq!((ring.member(0).attempt, ring.segment.subdevices.unassigned().count()), (back, 1));
    assert_eq!(ring.member(0).info.map(|info| info.identity.serial), Some(0));
}

#[test]
fn a_member_that_came_back_by_itself_is_reported_neither_as_held_nor_as_unfit() {
    for is_held in [false, true] {
        let mut ring = Ring::closed(3);
        lose(&mut ring);
        let attempt = ring.member(0).attempt;
        let key = SubDeviceKey { station: TEMPORARY, since: give(&mut ring) };
        let seen = |attempt| match is_held {
            true => Observation::Held { key, index: 0, attempt },
            false => Observation::Misfit { key, index: 0, attempt, reason: "a reason".into() },
        };
        // Held SubDevices are reported after a second.
        let observe = |ring: &mut Ring, attempt| {
            let first = ring.observe(seen(attempt));
            ring.now += Duration::from_secs(2);
            reports(&[first, ring.observe(seen(attempt))].concat())
        };
        // It answers at its address.
        ring.scan(&[PASS; 3]);
        assert_eq!(observe(&mut ring, attempt), [], "held: {is_held}");
        assert!(!first_unassigned(&ring).reported && first_unassigned(&ring).held_since.is_none());
        let now = ring.member(0).attempt;
        let failed = observe(&mut ring, now);
        assert!(matches!(failed[..], [Event::ConfigurationFailed { subdevice: SubDeviceId(0), .. }]), "{failed:?}");
    }
}

#[test]
fn names_that_were_read_of_a_subdevice_are_not_stored_for_the_next_at_its_address() {
    let whole = |serial: u32| SubDeviceInfo { name: "a name".into(), ..info(serial, station(0)) };
    let mut ring = Ring::closed(3);
    for known in &mut Rc::make_mut(&mut ring.segment.stage.scanned_mut().unwrap().found).subdevices {
        Rc::make_mut(known).extent = SiiExtent::Operation;
    }
    let key = ring.segment.subdevices.at(station(0)).unwrap().key;
    let cases = [
        (SubDeviceKey { since: key.since.wrapping_sub(1), ..key }, 0, false),
        (SubDeviceKey { station: TEMPORARY, ..key }, 0, false),
        (key, 5, false),
        (key, 0, true),
    ];
    for (key, serial, is_stored) in cases {
        ring.observe(Observation::MoreRead { key, more: More::Sii(&whole(serial)) });
        let named = ring.segment.found().unwrap().subdevices[0].name == "a name";
        assert_eq!(named, is_stored, "{key:?}, serial {serial}");
    }
}

#[test]
fn an_unassigned_subdevice_that_has_left_is_not_admitted() {
    let mut ring = Ring::closed(3);
    lose(&mut ring);
    let attempt = ring.member(0).attempt;
    let since = give(&mut ring);
    ring.observe(Observation::Readdressing(&[TEMPORARY]));
    let info = Box::new(info(5, station(0)));
    let key = SubDeviceKey { station: TEMPORARY, since };
    let effects = ring.observe(Observation::Admitted { key, index: 0, attempt, info });
    assert_eq!((effects, ring.member(0).phase), (Vec::new(), Phase::Absent));
}

/// A member that was out of reach: another program may have written its dictionary.
#[test]
fn pdos_of_an_admitted_or_read_member_are_in_doubt_in_the_last_scan_too() {
    let in_doubt = SubDeviceInfo { pdo_source: PdoSource::Outdated, ..info(0, station(0)) };
    let sources = |ring: &Ring| {
        let found = ring.segment.found().unwrap().subdevices[0].pdo_source;
        (ring.member(0).info.unwrap().pdo_source, found)
    };
    let mut ring = Ring::closed(3);
    lose(&mut ring);
    let attempt = ring.member(0).attempt;
    let key = SubDeviceKey { station: TEMPORARY, since: give(&mut ring) };
    let info = Box::new(in_doubt.clone());
    ring.observe(Observation::Admitted { key, index: 0, attempt, info });
    assert_eq!(sources(&ring), (PdoSource::Outdated, PdoSource::Outdated), "admitted");
    let mut ring = Ring::closed(3);
    ring.observe(of_member((0, 0), MemberFinding::ReadAgain(&in_doubt)));
    assert_eq!(sources(&ring), (PdoSource::Outdated, PdoSource::Outdated), "read again");
}

#[test]
fn what_was_read_of_a_subdevice_is_not_stored_for_the_next_with_its_address() {
    let mut ring = Ring::closed(3);
    let since = give(&mut ring);
    ring.observe(Observation::Readdressing(&[TEMPORARY]));
    let now = give(&mut ring);
    let is_known = |ring: &Ring| first_unassigned(ring).knowledge.info().is_some();
    for (since, stored) in [(since, false), (now, true)] {
        let read = Ok(Rc::new(info(5, TEMPORARY)));
        ring.observe(Observation::Read { key: SubDeviceKey { station: TEMPORARY, since }, read });
        assert_eq!(is_known(&ring), stored, "read since {since}");
    }
}

#[test]
fn positions_that_were_read_before_a_change_of_addresses_are_not_stored() {
    let other = StationAddress(0xC001);
    let changes: [fn(&mut Ring); 4] = [
        |ring| drop(ring.observe(Observation::Readdressing(&[station(1)]))),
        |ring| {
            let versions = ring.segment.versions();
            ring.observe(Observation::Given { versions, view: &view(&[TEMPORARY]), given: &[] });
        },
        |ring| isolate(ring, 0),
        |ring| {
            isolate(ring, 0);
            ring.observe(Observation::Undisturbed(0));
        },
    ];
    for (number, change) in changes.into_iter().enumerate() {
        let mut ring = Ring::closed(3);
        give(&mut ring);
        let versions = ring.segment.versions();
        change(&mut ring);
        // It was at the fifth position, and is at the fourth.
        let before = view(&[other, TEMPORARY]);
        ring.observe(Observation::Places { versions, view: &before });
        assert_eq!(first_unassigned(&ring).position, Position(3), "change {number}");
        ring.observe(Observation::Given { versions, view: &before, given: &[given(other)] });
        assert_eq!(ring.segment.subdevices.unassigned().count(), 1, "change {number}: the next search finds it");
    }
    let mut ring = Ring::closed(3);
    give(&mut ring);
    let versions = ring.segment.versions();
    ring.observe(Observation::Places { versions, view: &view(&[other, TEMPORARY]) });
    assert_eq!(first_unassigned(&ring).position, Position(4));
}

#[test]
fn positions_that_are_read_while_rings_are_examined_are_not_stored() {
    let mut ring = Ring::closed(3);
    give(&mut ring);
    isolate(&mut ring, 0);
    let versions = ring.segment.versions();
    let two = View { stations: [station(0), TEMPORARY].to_vec(), ..view(&[]) };
    ring.observe(Observation::Places { versions, view: &two });
    assert_eq!(first_unassigned(&ring).position, Position(3));
}

/// The cabling is replaced: two SubDevices have changed places.
fn recable(ring: &mut Ring) {
    let versions = ring.segment.versions();
    let topology = ring.segment.cabling.topology.clone();
    let stations = [station(0), station(2), station(1)];
    let seen = Seen { topology: &topology, stations: &stations, members: &[Some(0), Some(2), Some(1)] };
    let words = ring.words.words();
    ring.observe(Observation::Rescanned { versions, seen, words });
    assert_eq!(ring.segment.cabling.stations, stations);
}

#[test]
fn crossed_lines_found_in_the_previous_cabling_are_searched_again() {
    let crossing = Crossing { subdevice: Some((station(1), Position(1))), entry_port: Some(1) };
    let check = || Some(LineCheck { crossings: vec![crossing], ..LineCheck::default() });
    let changes: [fn(&mut Ring); 3] = [
        recable,
        |ring| drop(ring.observe(Observation::Readdressing(&[]))),
        |ring| {
            isolate(ring, 0);
            ring.observe(Observation::Undisturbed(0));
        },
    ];
    for (number, change) in changes.into_iter().enumerate() {
        for in_control in [false, true] {
            let mut ring = Ring::closed(3);
            let versions = ring.segment.versions();
            change(&mut ring);
            let effects = ring.observe(Observation::LineChecked { versions, found: check(), in_control });
            assert_eq!(reports(&effects), [], "change {number}");
            let again = ring.scan(&[PASS; 3]);
            let task = Effect::Start(Task::ExamineCabling { in_control: false });
            assert!(again.contains(&task), "change {number}: {again:?}");
            let versions = ring.segment.versions();
            let effects = ring.observe(Observation::LineChecked { versions, found: check(), in_control });
            assert_eq!(reports(&effects).len(), 1, "change {number}");
        }
    }
}

#[test]
fn a_rescan_is_not_taken_over_after_the_cabling_or_an_address_has_changed() {
    let changes: [fn(&mut Ring); 2] = [recable, |ring| drop(ring.observe(Observation::Readdressing(&[station(1)])))];
    for (number, change) in changes.into_iter().enumerate() {
        let mut ring = Ring::closed(3);
        let versions = ring.segment.versions();
        change(&mut ring);
        let (before, adoptions) = (ring.segment.cabling.stations.clone(), ring.segment.adoptions());
        let (topology, words) = (ring.segment.cabling.topology.clone(), ring.words.words());
        let stations = [station(1), station(0), station(2)];
        let seen = Seen { topology: &topology, stations: &stations, members: &[Some(1), Some(0), Some(2)] };
        ring.observe(Observation::Rescanned { versions, seen, words });
        assert_eq!((&ring.segment.cabling.stations, ring.segment.adoptions()), (&before, adoptions), "change {number}");
    }
}

#[test]
fn cable_errors_moves_and_missing_inputs_from_before_a_change_are_not_reported() {
    let moved = || vec![Move { subdevice: SubDeviceId(1), from: Position(1), to: Position(2) }];
    for is_stale in [true, false] {
        let mut ring = Ring::closed(3);
        let attempt = ring.member(0).attempt;
        ring.observe(of_member((0, attempt), MemberFinding::ProcessData(ProcessDataStep::Mapped)));
        let (versions, mapping) = (ring.segment.versions(), ring.member(0).mapping);
        let fresh = [CableErrors { invalid_frames: 3, lost_links: 0 }];
        if is_stale {
            recable(&mut ring);
            ring.observe(Observation::Readdressing(&[]));
            ring.observe(of_member((0, attempt), MemberFinding::ProcessData(ProcessDataStep::Mapped)));
        }
        let missing = Observation::NotProven { index: 0, mapping, what: "no inputs".into() };
        let shown = [
            ring.observe(Observation::CableErrors { versions, fresh: &fresh }),
            ring.observe(Observation::Moved { versions, moved: moved() }),
            ring.observe(missing),
        ];
        let reported = shown.map(|effects| reports(&effects).len());
        assert_eq!(reported, if is_stale { [0; 3] } else { [1; 3] }, "stale: {is_stale}");
    }
}

#[test]
fn what_a_scan_has_found_is_not_reported_after_it_was_given_up() {
    for is_given_up in [true, false] {
        let mut ring = Ring::closed(2);
        ring.observe(Observation::Deactivated);
        ring.observe(Observation::ScanBegun);
        if is_given_up {
            ring.observe(Observation::Deactivated);
        }
        let effects = ring.observe(Observation::ScanShows { findings: Vec::new(), subdevices: 2 });
        let shown = if is_given_up { vec![] } else { vec![Event::ScanFinished { subdevices: 2 }] };
        assert_eq!(reports(&effects), shown, "given up: {is_given_up}");
    }
}

#[test]
fn temporary_addresses_are_used_in_turn_and_without_those_in_use() {
    let mut ring = Ring::closed(3);
    let next = |ring: &mut Ring| {
        let address = ring.segment.free_address(&[StationAddress(0xC001)]);
        ring.observe(Observation::Offered(address));
        address.0
    };
    assert_eq!([next(&mut ring), next(&mut ring), next(&mut ring)], [0xC000, 0xC002, 0xC003]);
    ring.observe(Observation::Offered(StationAddress(0xFFFE)));
    assert_eq!(next(&mut ring), 0xC000, "0xFFFF is no station address");
}

fn searched(ring: &mut Ring, result: Result<(), String>) -> Vec<Effect> {
    let versions = ring.segment.versions();
    ring.observe(Observation::Searched { versions, result })
}

#[test]
fn a_search_that_failed_on_another_segment_does_not_count() {
    let changes: [fn(&mut Ring); 2] = [
        |ring| drop(ring.observe(Observation::Readdressing(&[station(1)]))),
        |ring| {
            isolate(ring, 0);
            ring.observe(Observation::Undisturbed(0));
        },
    ];
    for (number, change) in changes.into_iter().enumerate() {
        let mut ring = Ring::closed(3);
        let failed = |ring: &mut Ring, versions| {
            for _ in 0..3 {
                ring.observe(Observation::Searched { versions, result: Err(String::new()) });
            }
            ring.segment.are_frames_doubtful()
        };
        let versions = ring.segment.versions();
        change(&mut ring);
        assert!(!failed(&mut ring, versions), "change {number}");
        let versions = ring.segment.versions();
        assert!(failed(&mut ring, versions), "change {number}");
        // That all are known counts in any case.
        change(&mut ring);
        ring.observe(Observation::Searched { versions, result: Ok(()) });
        assert!(!ring.segment.are_frames_doubtful(), "change {number}");
    }
}

#[test]
fn the_limit_of_frames_of_another_segment_is_not_reported_and_the_test_is_repeated() {
    let limit = FrameLimit { datagrams: 15, returns: true };
    for is_stale in [false, true] {
        let mut ring = Ring::closed(3);
        let versions = ring.segment.versions();
        ring.observe(Observation::FramesTested);
        assert_eq!(ring.segment.next_frame_test(), ring.now + Duration::from_secs(10));
        if is_stale {
            recable(&mut ring);
        }
        let effects = ring.observe(Observation::FramesLimited { versions, limit });
        assert_eq!(reports(&effects), if is_stale { vec![] } else { vec![Event::FrameLimit { limit }] });
        assert_eq!(ring.segment.next_frame_test() == Instant::NEVER, !is_stale);
    }
}

#[test]
fn searches_that_fail_repeatedly_test_the_frames_and_are_reported_once() {
    let mut ring = Ring::closed(3);
    let mut failed = |count: usize| -> Vec<Event> {
        (0..count).flat_map(|_| reports(&searched(&mut ring, Err(String::from("a reason"))))).collect()
    };
    assert_eq!(failed(99), []);
    assert_eq!(failed(2), [Event::ScanFailed { reason: "a reason".into() }]);
    searched(&mut ring, Ok(()));
    let doubts: Vec<bool> = (0..4)
        .map(|_| {
            searched(&mut ring, Err(String::new()));
            ring.segment.are_frames_doubtful()
        })
        .collect();
    assert_eq!(doubts, [false, false, true, false]);
}

#[test]
fn a_configuration_is_repeated_three_times_for_the_same_lost_registers() {
    let mut ring = Ring::closed(3);
    let mut undone = |reason: &str| {
        let attempt = ring.member(0).attempt;
        let effects = ring.observe(of_member((0, attempt), MemberFinding::Undone(reason.into())));
        effects.iter().filter(|effect| matches!(effect, Effect::Start(Task::BringUp { .. }))).count()
    };
    assert_eq!(["FMMUs"; 5].map(&mut undone), [1, 1, 1, 0, 0]);
    assert_eq!(["watchdog", "FMMUs"].map(&mut undone), [1, 1], "another difference");
    assert!(ring.member(0).repair.is_under_way());
    let attempt = ring.member(0).attempt;
    ring.observe(of_member((0, attempt - 1), MemberFinding::Held));
    assert!(ring.member(0).repair.is_under_way(), "an earlier attempt");
    ring.observe(of_member((0, attempt), MemberFinding::Held));
    assert!(!ring.member(0).repair.is_under_way());
}
