//! The cables of a network compared with `PreviousPort` of a file (protocol 8.2).

use ringcat::eni::segment;
use ringcat::simulated::SimulatedSegment;
use ringcat::{MainDevice, Options, Scan};
use ringcat_sim::cable::{CableId, DeviceIndex, Endpoint};
use ringcat_sim::frame::Port;
use ringcat_sim::network::Network;

use super::{BUTTONS, DRIVE, EniFile, machine};

/// Scan result and reports with one cable cut, or none.
fn scanned(file: &EniFile, mut network: Network, cut: Option<CableId>) -> (Scan, Vec<String>) {
    if let Some(cable) = cut {
        network.cut(cable);
    }
    let mut main_device = MainDevice::request(SimulatedSegment::new(network), &Options::default());
    let scan = main_device.scan().expect("a scan");
    let reports = file.compare_cables(&scan.subdevices, &scan.topology);
    assert!(reports.iter().all(|difference| !difference.prevents_op));
    (scan, reports.iter().map(ToString::to_string).collect())
}

// covers: 8.2, eni-image
#[test]
fn cables_as_in_the_file_are_not_reported_even_in_an_open_ring() {
    let file = machine();
    assert_eq!(scanned(&file, file.simulated(false).expect("a segment"), None).1, [""; 0]);
    assert_eq!(scanned(&file, file.simulated(true).expect("a segment"), None).1, [""; 0]);
    // The ring includes coupler and drive; the terminals are connected to the coupler, and are absent without their
    // cable.
    for (cable, there) in [(0, 5), (1, 2), (2, 3), (3, 4), (4, 5), (5, 5)] {
        let (scan, reports) = scanned(&file, file.simulated(true).expect("a segment"), Some(CableId(cable)));
        assert_eq!(scan.subdevices.len(), there, "cable {cable}");
        assert_eq!(reports, [""; 0], "cable {cable}");
    }
}

// covers: 8.2, eni-image
#[test]
fn a_moved_cable_is_reported_with_both_places() {
    let file = machine();
    let mut moved = segment(&file.eni, &file.configuration, false);
    moved.cables[DRIVE].a = Endpoint::Device(DeviceIndex(BUTTONS), Port::B);
    let (scan, reports) = scanned(&file, Network::from_description(moved).expect("cables fit"), None);
    assert!(file.compare(&scan.subdevices).is_empty(), "all are there, in their order");
    let expected =
        "\"Drive (1005)\" is plugged into port B of \"Buttons (1004)\"; the file says port C of \"Coupler (1001)\"";
    assert_eq!(reports, [expected]);
}
