//! What an address names, without a bus.

use super::*;
use crate::declared::Address;

/// A segment of five SubDevices. If it is active, those at positions 1 and 3 are declared, in reverse order, and there
/// is a third declared one that is absent.
fn segment(is_active: bool, idle_operation: bool) -> Segment {
    let info =
        |at: usize| SubDeviceInfo { position: Position(at as u16), station: station(at), ..SubDeviceInfo::default() };
    let topology = Topology::build(&[node(PASS); 5], 5);
    let scan = Scan { subdevices: (0..5).map(info).collect(), topology, main_count: 5, redundant_count: 0 };
    let mut segment = Segment::new(Choices { idle_operation, ..choices() });
    segment.observe(Observation::ScanBegun, Instant(0));
    segment.observe(Observation::ScanEnded(Ok(scan)), Instant(0));
    if is_active {
        let config = || SubDeviceConfig::at_position(0);
        let member = |at: usize| SubDevice::declared(config(), Some(Rc::new(info(at))), station(at), Err(None));
        let absent = SubDevice::declared(config(), None, StationAddress(0x1FFF), Err(None));
        let owners = Owners::new(vec![None, Some(1), None, Some(0), None], |_| false);
        let undeclared = [0, 2, 4].map(|at| SubDevice::undeclared(Rc::new(info(at)), &owners, 5));
        segment.observe(
            Observation::Activated(Box::new(Declared {
                subdevices: SubDevices::new(vec![member(3), member(1), absent], undeclared),
                cabling: Cabling { stations: (0..5).map(station).collect(), ..Cabling::default() },
                board: Arc::new(Board::new(3)),
                ..Declared::default()
            })),
            Instant(0),
        );
    }
    segment
}

/// The station address of the SubDevice with an address, and its index in the declaration.
fn named(segment: &Segment, address: Address) -> Option<(u16, Option<usize>)> {
    let found = segment.find(address)?;
    let index = match found {
        Addressed::Member(index) => Some(index),
        Addressed::Undeclared(_) => None,
    };
    segment.station(found).map(|station| (station.0, index))
}

// covers: states
#[test]
fn an_address_names_the_same_entry_in_each_stage_or_none() {
    let index = |number: usize| Address::from(SubDeviceId(number));
    let position = |number: u16| Address::from(Position(number));
    let none: Option<(u16, Option<usize>)> = None;
    let undeclared = |at: usize| Some((station(at).0, None));
    let declared = |at: usize, index: usize| Some((station(at).0, Some(index)));
    // Address; without an application; with one, without idle operation; with one and idle operation.
    let table = [
        (index(0), none, declared(3, 0), declared(3, 0)),
        (index(1), none, declared(1, 1), declared(1, 1)),
        (index(2), none, Some((0x1FFF, Some(2))), Some((0x1FFF, Some(2)))),
        (index(3), none, none, none),
        (index(usize::MAX), none, none, none),
        (position(0), undeclared(0), none, undeclared(0)),
        (position(1), undeclared(1), none, declared(1, 1)),
        (position(2), undeclared(2), none, undeclared(2)),
        (position(3), undeclared(3), none, declared(3, 0)),
        (position(4), undeclared(4), none, undeclared(4)),
        (position(5), none, none, none),
        (position(u16::MAX), none, none, none),
    ];
    let [scanned, active, both] = [segment(false, true), segment(true, false), segment(true, true)]
        .each_ref()
        .map(|segment| table.map(|(address, ..)| named(segment, address)));
    for (at, (address, before, without, with)) in table.into_iter().enumerate() {
        assert_eq!((scanned[at], active[at], both[at]), (before, without, with), "{address}");
    }
    // Nothing has an address before a scan.
    assert!(table.iter().all(|(address, ..)| Segment::new(choices()).find(*address).is_none()));
}
