//! Delays in port reports without an application: of rings, of rings behind junctions and in one another's branches,
//! compared with the true delays of the simulator (protocol 7.1).

use std::time::Duration;

use ringcat::{Event, JunctionMode, MainDevice, Options, Services, Subject};
use ringcat_sim::cable::CableId;
use ringcat_sim::fault::Fault;
use ringcat_sim::frame::Port::{A, B};
use ringcat_wire::register::map;
use scenarios::clocks::{clocked, wired};
use scenarios::delays::Shape;
use scenarios::delays::idle::{Reported, report};
use scenarios::segments::{MAIN, REDUNDANT, RING_BEHIND_JUNCTION, RING_OF_THREE, at};
use scenarios::tap::Tap;

/// The cable to the redundant link, and the one upstream of it, in [`both_rings`].
const REDUNDANT_CABLE: CableId = CableId(8);
const IN_FRONT: CableId = CableId(7);
const COUNT: usize = 7;
const SECOND: Duration = Duration::from_secs(1);

/// A ring of two links with a ring behind a junction, and SubDevices before and behind it.
fn both_rings() -> MainDevice<Tap> {
    let cables: Vec<_> = RING_BEHIND_JUNCTION.into_iter().chain([(at(6, B), REDUNDANT)]).collect();
    MainDevice::request(Tap::new(wired(clocked(COUNT, 50), &cables)), &options())
}

fn options() -> Options {
    Options::default().with_idle_operation(true).with_junctions(JunctionMode::Automatic)
}

/// Shapes of a seed.
fn shapes(seed: u64) -> [(Shape, JunctionMode); 5] {
    let size = 1 + (seed % 20) as usize;
    [
        (Shape::Ring(1 + size), JunctionMode::Automatic),
        (Shape::LocalRing(size), JunctionMode::Automatic),
        (Shape::Tree, JunctionMode::Automatic),
        (Shape::Gaps, JunctionMode::Automatic),
        (Shape::Tree, JunctionMode::Disabled),
    ]
}

fn all(seeds: impl Iterator<Item = u64>, cuts: usize) -> Reported {
    seeds.fold(Reported::default(), |mut sum, seed| {
        shapes(seed).into_iter().for_each(|(shape, mode)| sum.add(report(shape, mode, seed, cuts)));
        sum
    })
}

// covers: registers, dc-delays
#[test]
fn delays_without_an_application_are_right_in_rings_behind_junctions_too() {
    let reported = all(0..8, 1);
    assert_eq!(reported.wrong, Vec::<String>::new());
    assert_eq!(reported.missing_when_whole, Vec::<String>::new());
    assert!(reported.right > 600, "{reported:?}");
}

#[test]
fn seeds_from_the_environment() {
    let runs = |seeds: std::ops::Range<u64>| {
        let reported = all(seeds, 2);
        assert_eq!(reported.wrong, Vec::<String>::new());
        assert_eq!(reported.missing_when_whole, Vec::<String>::new());
        println!("{} delays right, {} of the same link not known", reported.right, reported.missing);
    };
    crate::explorer::from_environment(|seed| runs(seed..seed + 1), runs);
}

/// The report itself reads the ports, and thereby clears the events that show a change to idle operation.
// covers: registers, ring-goes-on
#[test]
fn a_change_that_only_a_port_report_sees_is_followed() {
    // The redundant cable, and two of the ring behind the junction: the number of SubDevices stays.
    for cable in [REDUNDANT_CABLE, CableId(RING_OF_THREE[1]), CableId(RING_OF_THREE[2])] {
        for after in 0..25 {
            let mut main_device = both_rings();
            main_device.attend(SECOND);
            main_device.links_mut().network_mut().apply(Fault::Cut(cable));
            main_device.attend(SECOND);
            main_device.links_mut().network_mut().apply(Fault::Heal(cable));
            main_device.attend(Duration::from_millis(after));
            main_device.port_report().expect("it can be asked");
            main_device.attend(SECOND);
            let report = main_device.port_report().expect("it can be asked");
            let known = report.iter().filter(|it| it.delay_ns.is_some()).count();
            assert_eq!((known, report.len()), (COUNT, COUNT), "{cable:?}, {after} ms after it was repaired");
        }
    }
}

/// The frames take another path than in the last scan: the report has no delay rather than a wrong one.
// covers: registers
#[test]
fn a_report_while_a_change_is_followed_has_no_delays() {
    let mut described = clocked(4, 50);
    described[3].sii_busy = Duration::from_millis(20);
    let cables = [(MAIN, at(0, A)), (at(0, B), at(1, A)), (at(1, B), at(2, A)), (at(2, B), at(3, A))];
    let mut network = wired(described, &cables);
    network.cut(CableId(3));
    network.advance_by(Duration::from_millis(1));
    let mut main_device = MainDevice::request(Tap::new(network), &options());
    main_device.attend(SECOND);
    assert_eq!(main_device.port_report().expect("it can be asked").len(), 3);
    main_device.links_mut().network_mut().apply(Fault::Heal(CableId(3)));
    main_device.attend(Duration::from_millis(200));
    let report = main_device.port_report().expect("it can be asked");
    assert_eq!(report.len(), 3, "the EEPROM is still being read");
    assert!(report.iter().all(|it| it.delay_ns.is_none()), "{report:?}");
    main_device.attend(Duration::from_secs(20));
    let report = main_device.port_report().expect("it can be asked");
    assert_eq!(report.iter().filter(|it| it.delay_ns.is_some()).count(), 4);
}

/// A ring that breaks while it is open for a report is noticed after the report. A port that the cut has made
/// unreachable opens by itself after a second: until then idle operation waits, and no SubDevice counts as removed.
// covers: registers, ring-goes-on
#[test]
fn a_cut_while_rings_are_open_for_a_report_is_noticed_and_removes_no_subdevice() {
    let (mut were_open, cables) = (0, [IN_FRONT, CableId(RING_OF_THREE[1]), CableId(RING_OF_THREE[2])]);
    for (cable, after) in cables.into_iter().flat_map(|cable| (0..60).step_by(2).map(move |after| (cable, after))) {
        let mut main_device = both_rings();
        main_device.attend(SECOND);
        while main_device.pop_event().is_some() {}
        let stations = |main_device: &MainDevice<Tap>| -> Vec<u16> {
            main_device.subdevices().iter().map(|info| info.station.0).collect()
        };
        let before = stations(&main_device);
        let report = main_device.engine_mut().start_port_report();
        main_device.attend(Duration::from_micros(200 * after));
        let network = main_device.links_mut().network_mut();
        let loops = |device: &ringcat_sim::device::Device| device.controller.register(map::DL_CONTROL, 2)[1];
        let is_open = network.devices().any(|device| loops(device) != 0);
        network.apply(Fault::Cut(cable));
        main_device.attend(Duration::from_millis(if is_open { 1_500 } else { 100 }));
        drop(report);
        let seen: Vec<Event> = std::iter::from_fn(|| main_device.pop_event()).map(|it| it.event).collect();
        let is_of_ring = |event: &Event| event.subject() == Subject::Ring;
        assert!(cable != IN_FRONT || seen.iter().any(is_of_ring), "{cable:?}, {after}, {is_open}: {seen:?}");
        let is_change = |event: &Event| match event {
            Event::Counted { main, redundant } => usize::from(main + redundant) < COUNT,
            event => matches!(event, Event::SegmentChanged { .. }),
        };
        assert!(!seen.iter().any(is_change), "{cable:?}, {after}, {is_open}: {seen:?}");
        assert_eq!(stations(&main_device), before, "{cable:?}, {after}, {is_open}");
        let network = main_device.links_mut().network_mut();
        assert!(network.devices().all(|device| loops(device) == 0), "{cable:?}, {after}, {is_open}");
        network.apply(Fault::Heal(cable));
        main_device.attend(SECOND);
        let report = main_device.port_report().expect("it can be asked");
        assert!(report.iter().all(|it| it.delay_ns.is_some()), "{cable:?}, {after}, {is_open}: {report:?}");
        were_open += usize::from(is_open);
    }
    assert!(were_open > 0, "no ring was open");
}
