//! Delays in port reports without an application: of rings, of rings behind junctions and in one another's branches,
//! compared with the true delays of the simulator (protocol 7.1).

use std::time::Duration;

use ringcat::{JunctionMode, MainDevice, Options, Services};
use ringcat_sim::cable::{CableId, Endpoint};
use ringcat_sim::fault::Fault;
use ringcat_sim::frame::Port::{A, B, C, D};
use ringcat_wire::register::map;
use scenarios::clocks::{clocked, wired};
use scenarios::delays::Shape;
use scenarios::delays::idle::{Reported, report};
use scenarios::segments::{MAIN, REDUNDANT, at};
use scenarios::tap::Tap;

/// A ring of two links with a ring behind a junction, and a SubDevice behind it.
const BOTH_RINGS: [(Endpoint, Endpoint); 8] = [
    (MAIN, at(0, A)),
    (at(0, B), at(1, A)),
    (at(1, D), at(2, A)),
    (at(2, B), at(3, A)),
    (at(3, B), at(1, B)),
    (at(1, C), at(4, A)),
    (at(4, B), at(5, A)),
    (at(5, B), REDUNDANT),
];
const SECOND: Duration = Duration::from_secs(1);

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
    for cable in [7, 3, 4].map(CableId) {
        for after in 0..25 {
            let mut main_device = MainDevice::request(Tap::new(wired(clocked(6, 50), &BOTH_RINGS)), &options());
            main_device.attend(SECOND);
            main_device.links_mut().network_mut().apply(Fault::Cut(cable));
            main_device.attend(SECOND);
            main_device.links_mut().network_mut().apply(Fault::Heal(cable));
            main_device.attend(Duration::from_millis(after));
            main_device.port_report().expect("it can be asked");
            main_device.attend(SECOND);
            let report = main_device.port_report().expect("it can be asked");
            let known = report.iter().filter(|it| it.delay_ns.is_some()).count();
            assert_eq!((known, report.len()), (6, 6), "{cable:?}, {after} ms after it was repaired");
        }
    }
}

/// The frames take another path than the last scan has found: the report has no delay rather than a wrong one.
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

/// A ring that breaks while it is open for a report is noticed as soon as at any time.
// covers: registers, ring-goes-on
#[test]
fn a_cut_while_rings_are_open_for_a_report_is_noticed_within_100_ms() {
    let mut were_open = 0;
    for after in 0..60 {
        let mut main_device = MainDevice::request(Tap::new(wired(clocked(6, 50), &BOTH_RINGS)), &options());
        main_device.attend(SECOND);
        while main_device.pop_event().is_some() {}
        let report = main_device.engine_mut().start_port_report();
        main_device.attend(Duration::from_micros(200 * after));
        let network = main_device.links_mut().network_mut();
        let loops = |device: &ringcat_sim::device::Device| device.controller.register(map::DL_CONTROL, 2)[1];
        let is_open = network.devices().any(|device| loops(device) != 0);
        network.apply(Fault::Cut(CableId(6)));
        main_device.attend(Duration::from_millis(100));
        drop(report);
        let seen: Vec<String> = std::iter::from_fn(|| main_device.pop_event()).map(|it| format!("{it:?}")).collect();
        let is_noticed = seen.iter().any(|event| event.contains("RingOpen") || event.contains("RingChanged"));
        // Ports that could not be restored through the cut expire after a second.
        were_open += usize::from(is_open);
        assert!(is_noticed || is_open, "{after}: {seen:?}");
    }
    assert!(were_open > 0, "no ring was open");
}
