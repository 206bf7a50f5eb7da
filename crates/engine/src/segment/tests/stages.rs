//! The stages of the segment: scans, activation and deactivation.

use ringcat_wire::register::{DlControl, LoopControl};

use crate::layout::Layout;

use super::*;

fn scan(count: usize) -> Scan {
    let info = |index: usize| SubDeviceInfo { station: station(index), ..SubDeviceInfo::default() };
    let topology = Topology::build(&vec![node(PASS); count], count);
    Scan { subdevices: (0..count).map(info).collect(), topology, main_count: count, redundant_count: 0 }
}

fn scanned(count: usize) -> Segment {
    let mut segment = Segment::new(choices());
    segment.observe(Observation::ScanBegun, Instant(0));
    segment.observe(Observation::ScanEnded(Ok(scan(count))), Instant(0));
    segment
}

/// Declares the first of the SubDevices that were found.
fn declare(segment: &Segment) -> Box<Declared> {
    let info = segment.found().map(|found| found.subdevices[0].clone());
    // It can be configured.
    let plan = Setup::new(0, &SubDeviceConfig::at_position(0), info.as_ref().unwrap(), &Layout::default()).unwrap();
    let member = SubDevice::declared(SubDeviceConfig::at_position(0), info, station(0), Ok(Rc::new(plan)));
    let cabling = Cabling { stations: segment.found().unwrap().stations(), ..Cabling::default() };
    Box::new(Declared {
        subdevices: SubDevices::new(vec![member], []),
        cabling,
        board: Arc::new(Board::new(1)),
        ..Declared::default()
    })
}

fn bring_up(effects: &Effects) -> Option<Start> {
    effects.0.iter().find_map(|effect| match effect {
        Effect::Start(Task::BringUp { from, .. }) => Some(*from),
        _ => None,
    })
}

#[test]
fn a_scan_is_known_to_the_model_without_an_application() {
    let segment = scanned(3);
    let found = segment.found().unwrap();
    assert_eq!((found.subdevices.len(), segment.is_active(), segment.subdevices().member_count()), (3, false, 0));
    assert_eq!(segment.stations_by_position(), [station(0), station(1), station(2)]);
    assert_eq!((found.scan().main_count, found.scan().redundant_count), (3, 0));
}

#[test]
fn while_a_scan_is_under_way_nothing_is_known_and_a_failed_one_is_reported() {
    let mut segment = scanned(3);
    segment.observe(Observation::ScanBegun, Instant(0));
    assert!(segment.is_scanning() && segment.found().is_none());
    let failed = segment.observe(Observation::ScanEnded(Err("a reason".into())), Instant(0));
    assert_eq!(reports(&failed.0), [Event::ScanFailed { reason: "a reason".into() }]);
    assert!(!segment.is_scanning() && segment.found().is_none());
}

#[test]
fn the_result_of_a_scan_that_was_given_up_is_refused() {
    let mut segment = scanned(3);
    segment.observe(Observation::ScanBegun, Instant(0));
    segment.observe(Observation::Deactivated, Instant(0));
    assert_eq!(segment.observe(Observation::ScanEnded(Ok(scan(2))), Instant(0)), Effects::default());
    assert!(segment.found().is_none());
}

#[test]
fn a_declaration_without_a_scan_or_beside_another_one_is_refused() {
    let mut segment = Segment::new(choices());
    let declared = declare(&scanned(3));
    assert_eq!(segment.observe(Observation::Activated(declared), Instant(0)), Effects::default());
    assert!(!segment.is_active());
    let mut segment = scanned(3);
    for _ in 0..2 {
        let declared = declare(&segment);
        segment.observe(Observation::Activated(declared), Instant(0));
        segment.observe(Observation::Started, Instant(0));
        assert_eq!(segment.member(0).unwrap().phase, Phase::Configuring);
    }
}

#[test]
fn members_share_the_data_of_the_scan() {
    let mut segment = scanned(3);
    let declared = declare(&segment);
    segment.observe(Observation::Activated(declared), Instant(0));
    let found = &segment.found().unwrap().subdevices[0];
    assert!(segment.member(0).unwrap().info.is_some_and(|info| Rc::ptr_eq(info, found)));
}

#[test]
fn after_deactivation_the_scan_stays_and_nothing_of_the_declaration() {
    let mut segment = scanned(3);
    let mut registers = Vec::new();
    for _ in 0..3 {
        let declared = declare(&segment);
        let effects = segment.observe(Observation::Activated(declared), Instant(0));
        assert!(matches!(effects.0[..], [Effect::Occupants(ref all)] if all.len() == 3));
        registers.push(bring_up(&segment.observe(Observation::Started, Instant(0))));
        let versions = segment.versions();
        segment.observe(Observation::Deactivated, Instant(0));
        assert_eq!((segment.subdevices().member_count(), segment.found().unwrap().subdevices.len()), (0, 3));
        let now = segment.versions();
        assert!(now.cabling != versions.cabling && now.isolations != versions.isolations);
        assert!(!segment.are_places_valid(versions));
    }
    // A scan clears registers, and the application before leaves its own.
    assert_eq!(registers, [Some(Start::Cleared), Some(Start::Doubtful), Some(Start::Doubtful)]);
}

#[test]
fn a_subdevice_that_was_visited_is_not_taken_for_a_cleared_one() {
    let mut segment = scanned(3);
    let subdevice = segment.find(Position(0)).unwrap();
    segment.observe(Observation::Requested { subdevice, state: AlState::PreOp }, Instant(0));
    let declared = declare(&segment);
    segment.observe(Observation::Activated(declared), Instant(0));
    assert_eq!(bring_up(&segment.observe(Observation::Started, Instant(0))), Some(Start::Doubtful));
}

#[test]
fn findings_of_an_earlier_application_are_refused() {
    let mut segment = scanned(3);
    let mut attempts = Vec::new();
    for _ in 0..3 {
        let declared = declare(&segment);
        segment.observe(Observation::Activated(declared), Instant(0));
        segment.observe(Observation::Started, Instant(0));
        let attempt = segment.member(0).unwrap().attempt;
        for earlier in attempts.iter().copied() {
            let late = of_member((0, earlier), MemberFinding::Reached(AlState::Op));
            assert_eq!(segment.observe(late, Instant(0)), Effects::default(), "attempt {earlier} after {attempt}");
        }
        segment.observe(Observation::Deactivated, Instant(0));
        attempts.push(attempt);
    }
}

#[test]
fn the_list_holds_what_was_found_before_during_and_after_an_application() {
    let mut segment = scanned(3);
    let stations = |segment: &Segment| -> Vec<StationAddress> {
        segment.subdevices().all().iter().map(|it| it.key.station).collect()
    };
    assert_eq!(stations(&segment), [station(0), station(1), station(2)]);
    assert_eq!(segment.subdevices().unassigned().count(), 3);
    let declared = declare(&segment);
    segment.observe(Observation::Activated(declared), Instant(0));
    assert_eq!((segment.subdevices().member_count(), stations(&segment)), (1, vec![station(0)]));
    segment.observe(Observation::Deactivated, Instant(0));
    assert_eq!((segment.subdevices().member_count(), stations(&segment).len()), (0, 3));
    segment.observe(Observation::ScanBegun, Instant(0));
    assert_eq!(stations(&segment), []);
}

#[test]
fn ports_closed_by_order_are_known_after_the_application_until_a_scan_opens_them() {
    let mut segment = scanned(3);
    let declared = declare(&segment);
    segment.observe(Observation::Activated(declared), Instant(0));
    let ports = [BlockedPort { station: station(1), port: 1 }];
    segment.observe(Observation::Blocked(&ports), Instant(0));
    let closed = DlControl { loops: [LoopControl::Closed; 4], ..DlControl::default() };
    segment.observe(Observation::PortsOrdered { station: station(2), control: closed }, Instant(0));
    for is_next in [false, true] {
        segment.observe(Observation::Deactivated, Instant(0));
        if is_next {
            let declared = declare(&segment);
            segment.observe(Observation::Activated(declared), Instant(0));
        }
        assert_eq!((segment.blocked(), segment.control_of(station(2))), (&ports[..], closed));
        // The procedure that was sending the order has ended.
        assert_eq!(segment.port_control(station(2)).map(|it| it.under_way), Some(0));
    }
    segment.observe(Observation::Deactivated, Instant(0));
    segment.observe(Observation::ScanBegun, Instant(0));
    assert_eq!((segment.blocked(), segment.port_control(station(2)).is_some()), (&[][..], false));
}
