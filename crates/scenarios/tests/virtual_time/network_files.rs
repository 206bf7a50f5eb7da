//! Network files from scans: the network runs unchanged on the same bus, and the difference on another one is named.

use std::time::{Duration, Instant};

use ringcat::config::network::model::SubDevice;
use ringcat::config::{DifferenceKind, FoundNetwork};
use ringcat::eni::EniImage;
use ringcat::network::{LoadedNetwork, NetworkFile, ScanOptions};
use ringcat::simulated::SimulatedSegment;
use ringcat::{MainDevice, Options, Scan};
use ringcat_wire::al::{AlState, AlStatus};

const LIMIT: Duration = Duration::from_secs(30);
const PERIOD: Duration = Duration::from_millis(1);

/// A ring of a coupler, terminals and drives.
fn segment(inputs: usize, drives: usize) -> String {
    let devices = [("coupler", 1), ("digital-output-8", 3), ("digital-input-8", inputs), ("servo", drives)];
    let device = |(kind, count): (&str, usize)| format!("[[device]]\ntype = \"{kind}\"\ncount = {count}\n");
    format!("[segment]\nring = true\n{}", devices.map(device).concat())
}

fn scanned(text: &str) -> (MainDevice<SimulatedSegment>, Scan) {
    let links = SimulatedSegment::from_toml(text).expect("the segment is valid");
    let mut main_device = MainDevice::request(links, &Options::default());
    let scan = main_device.scan().expect("the scan succeeds");
    (main_device, scan)
}

/// The text of the network file of a scan.
fn text_of(scan: &Scan) -> String {
    let mut options = ScanOptions::new("machine", PERIOD);
    options.ring = true;
    NetworkFile::from_scan(&scan.subdevices, &scan.topology, &options).to_text()
}

// covers: network-file
#[test]
fn a_network_from_a_scan_reaches_op_on_the_same_bus_with_its_variables() {
    let (main_device, scan) = scanned(&segment(2, 2));
    let network = LoadedNetwork::from_bytes("machine.toml", text_of(&scan).as_bytes()).expect("the file is valid");
    assert_eq!(network.configuration.compare(&scan.subdevices), []);
    assert_eq!(network.configuration.compare_cables(&scan.subdevices, &scan.topology), []);
    let mut application = main_device.activate(network.declaration()).expect("the network is the one of the file");
    let mut image = EniImage::new(&network.configuration, application.directory()).expect("the image fits");
    assert!(image.unplaced().is_empty());
    let lamp = image.variable("digital-output-8 2.Channel 3.Output").expect("a lamp").clone();
    let target = image.variable("servo 2.Command.Target velocity").expect("a drive").clone();
    let mode = image.variable("servo 2.Feedback.Mode display").expect("a drive").clone();
    application.wait_until_op(LIMIT).expect("all SubDevices reach OP");
    for _ in 0..100 {
        application.cycle(|data| {
            image.take_inputs(data);
            image.write(&lamp, 1);
            image.write(&target, 5);
            image.give_outputs(data);
        });
    }
    let device = |at| application.links().network().device(ringcat::sim::cable::DeviceIndex(at));
    assert_eq!(device(2).outputs(), [0b100]);
    assert_eq!(device(7).outputs()[6..10], [5, 0, 0, 0]);
    assert_eq!(image.read(&mode), 0);
}

// covers: network-file
#[test]
fn differences_between_the_file_and_another_bus_are_named() {
    let (_, scan) = scanned(&segment(3, 2));
    let network = LoadedNetwork::from_bytes("machine.toml", text_of(&scan).as_bytes()).expect("the file is valid");
    let on = |text: &str| {
        let (_, scan) = scanned(text);
        let found = FoundNetwork::new(&scan.subdevices, &scan.topology).with_redundant(true);
        let differences = network.configuration.differences(found, &network.stated());
        differences.into_iter().map(|it| (it.kind, it.subdevice.map(|at| at.0))).collect::<Vec<_>>()
    };
    assert_eq!(on(&segment(3, 2)), []);
    // The drive behind the missing or additional terminal is plugged into another one.
    assert_eq!(on(&segment(2, 2)), [(DifferenceKind::Missing, Some(6))]);
    assert_eq!(on(&segment(4, 2)), [(DifferenceKind::Additional, None)]);
    assert_eq!(on(&segment(3, 1)), [(DifferenceKind::Missing, Some(8))]);
}

// covers: network-file
#[test]
fn other_contents_of_a_subdevice_are_named_by_their_kind() {
    let (_, scan) = scanned(&segment(1, 1));
    let drive = 5;
    let kinds = |change: &dyn Fn(&mut SubDevice)| {
        let mut network = LoadedNetwork::from_bytes("machine.toml", text_of(&scan).as_bytes()).expect("it is valid");
        change(&mut network.file.subdevice[drive]);
        let network = LoadedNetwork::new(network.file);
        let mut firmware = vec![None; scan.subdevices.len()];
        firmware[drive] = Some("1.0".to_owned());
        let found = FoundNetwork::new(&scan.subdevices, &scan.topology).with_redundant(true).with_firmware(&firmware);
        let differences = network.configuration.differences(found, &network.stated());
        assert!(differences.iter().all(|it| it.text.contains("position 5 \"servo\"")), "{differences:?}");
        differences.into_iter().map(|it| (it.kind, it.prevents_op)).collect::<Vec<_>>()
    };
    let entries = |drive: &mut SubDevice| drive.sync_manager[0].pdo[0].entries.clone().expect("entries");
    assert_eq!(kinds(&|_| ()), []);
    assert_eq!(kinds(&|drive| drive.firmware = "1.0".to_owned()), []);
    assert_eq!(kinds(&|drive| drive.firmware = "1.1".to_owned()), [(DifferenceKind::Firmware, false)]);
    assert_eq!(
        kinds(&|drive| drive.mailbox.as_mut().expect("CoE").read.length += 2),
        [(DifferenceKind::Mailbox, false)]
    );
    assert_eq!(kinds(&|drive| drive.check_identification = Some(5)), [(DifferenceKind::Identification, true)]);
    let shorter = kinds(&|drive| {
        let mut list = entries(drive);
        list.pop();
        drive.sync_manager[0].pdo[0].entries = Some(list);
    });
    assert_eq!(shorter, [(DifferenceKind::Pdos, false)]);
    assert_eq!(kinds(&|drive| drive.sync_manager[0].pdo[0].index = 0x1617), [(DifferenceKind::Pdos, false)]);
    let beyond = kinds(&|drive| drive.sync_manager[0].number = 9);
    assert_eq!(beyond, [(DifferenceKind::ProcessData, true)]);
}

// covers: network-file
#[test]
fn a_network_file_of_100_subdevices_takes_less_than_2_s_beyond_the_scan() {
    let (main_device, scan) = scanned(&segment(40, 56));
    assert_eq!(scan.subdevices.len(), 100);
    let begin = Instant::now();
    let text = text_of(&scan);
    let network = LoadedNetwork::from_bytes("machine.toml", text.as_bytes()).expect("the file is valid");
    let took = begin.elapsed();
    println!("network file of 100 SubDevices, {} bytes: written and read in {took:?}", text.len());
    assert!(took < Duration::from_secs(2), "{took:?}");
    assert_eq!(network.file.to_text(), text);
    // It runs.
    let mut application = main_device.activate(network.declaration()).expect("the network is the one of the file");
    application.wait_until_op(LIMIT).expect("all SubDevices reach OP");
    let devices = application.links().network().devices();
    assert!(devices.into_iter().all(|device| device.al_status() == AlStatus::new(AlState::Op)));
}

/// Evaluated by the outputs of the simulated terminals.
// covers: network-file, sim-files
#[test]
fn a_simulated_segment_of_a_network_file_reaches_op_with_the_file() {
    let (_, scan) = scanned(&segment(2, 2));
    let mut options = ScanOptions::new("machine", PERIOD);
    (options.ring, options.clocks) = (true, true);
    let mut file = NetworkFile::from_scan(&scan.subdevices, &scan.topology, &options);
    let alone = |subdevice: &mut SubDevice| {
        (subdevice.position, subdevice.alias, subdevice.offset) = (None, Some(77), Some(0));
    };
    alone(&mut file.subdevice[3]);
    file.subdevice[6].check_revision = ringcat::config::network::model::CheckRevision::EqualOrGreater;
    file.subdevice[6].optional = true;
    let network = LoadedNetwork::from_bytes("machine.toml", file.to_text().as_bytes()).expect("the file is valid");
    for ring in [true, false] {
        let simulated = network.simulated(ring).expect("the file has all that a device is made of");
        assert_eq!(simulated.devices().len(), file.subdevice.len());
        let mut main_device = MainDevice::request(SimulatedSegment::new(simulated), &Options::default());
        let scan = main_device.scan().expect("the scan succeeds");
        assert_eq!(scan.subdevices[3].alias, 77);
        assert_eq!(network.configuration.compare(&scan.subdevices), []);
        let mut application = main_device.activate(network.declaration()).expect("the network is the one of the file");
        let mut image = EniImage::new(&network.configuration, application.directory()).expect("the image fits");
        let lamp = image.variable("digital-output-8 3.Channel 3.Output").expect("a lamp").clone();
        application.wait_until_op(LIMIT).expect("all SubDevices reach OP");
        for _ in 0..20 {
            application.cycle(|data| {
                image.take_inputs(data);
                image.write(&lamp, 1);
                image.give_outputs(data);
            });
        }
        let device = |at| application.links().network().device(ringcat::sim::cable::DeviceIndex(at));
        assert_eq!(device(3).outputs(), [0b100]);
    }
}

// covers: network-file
#[test]
fn what_a_simulated_segment_is_not_made_of_is_named() {
    let (_, scan) = scanned(&segment(1, 1));
    let mut file = NetworkFile::from_scan(&scan.subdevices, &scan.topology, &ScanOptions::new("machine", PERIOD));
    file.subdevice[1].sync_manager[0].start = None;
    let network = LoadedNetwork::from_bytes("machine.toml", file.to_text().as_bytes()).expect("the file is valid");
    let error = network.simulated(false).expect_err("the address is missing").to_string();
    assert!(error.contains("digital-output-8") && error.contains("start"), "{error}");
}
