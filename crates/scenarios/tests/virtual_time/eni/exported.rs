//! ENIs that RingCAT has written: of a scan, of other ENIs, with LRW and without it. They reach OP on the bus for which
//! they were made, and each variable is where the file says.

use std::path::Path;
use std::time::Duration;

use ringcat::config::network::Bytes;
use ringcat::config::network::model::{Sdo, Startup, Sync};
use ringcat::config::{DifferenceKind, Export, ExportDetails, ExportOptions, FoundNetwork, LrwUse, export};
use ringcat::eni::EniFile;
use ringcat::network::{NetworkFile, ScanOptions};
use ringcat::simulated::SimulatedSegment;
use ringcat::{Application, Event, MainDevice, Options, ReferenceClock, SubDeviceId, SyncManagerRole, SyncSignals};
use ringcat_sim::network::Network;
use ringcat_sim::segment::Segment;
use ringcat_wire::al::AlState;
use scenarios::dice::Dice;

use super::{Plant, REAL, activate_on, machine, real, start};

const PERIOD: Duration = Duration::from_millis(1);
/// Terminals, an analog one with a mailbox, and two drives.
const BUS: &str = "[segment]\nring = true\n[[device]]\ntype = \"coupler\"\n\
                   [[device]]\ntype = \"digital-output-8\"\ncount = 2\n\
                   [[device]]\ntype = \"digital-input-8\"\n[[device]]\ntype = \"servo\"\ncount = 2\n";

fn network(text: &str) -> Network {
    let segment = Segment::from_toml(text, Path::new(".")).expect("the segment is valid");
    Network::from_description(segment).expect("its devices are there")
}

/// The network file of a scan, with clocks and SYNC0 in the drives.
fn scanned() -> NetworkFile {
    let links = SimulatedSegment::from_toml(BUS).expect("the segment is valid");
    let mut main_device = MainDevice::request(links, &Options::default());
    let scan = main_device.scan().expect("the scan succeeds");
    let mut options = ScanOptions::new("machine", PERIOD);
    options.clocks = true;
    let mut file = NetworkFile::from_scan(&scan.subdevices, &scan.topology, &options);
    for drive in file.subdevice.iter_mut().filter(|it| it.name.starts_with("servo")) {
        drive.sync = Some(Sync::from(SyncSignals::sync0(1_000_000, 0)));
    }
    file
}

fn read(export: &Export) -> EniFile {
    EniFile::from_bytes(export.text.as_bytes()).unwrap_or_else(|error| panic!("{error}"))
}

/// To OP, then all variables are compared with the devices. Returns how many outputs and inputs there were.
fn proven(mut plant: Plant, seed: u64) -> [usize; 2] {
    plant.settle();
    plant.compare(&mut Dice::new(seed))
}

// covers: eni-run
#[test]
fn the_eni_of_a_scan_reaches_op_on_its_bus_with_each_variable_in_its_place() {
    let file = scanned();
    for (lrw, seed) in [(LrwUse::Never, 1), (LrwUse::AsDeclared, 2)] {
        let export = file.to_eni(&ExportOptions::default().with_lrw(lrw)).unwrap_or_else(|error| panic!("{error}"));
        let plant = activate_on(network(BUS), read(&export), false).expect("the network is the one of the file");
        let [outputs, _] = proven(plant, seed);
        assert!(outputs >= 16 + 2 * 3, "{outputs} outputs");
    }
}

/// One LRW for all is for a line: a ring refuses it.
// covers: eni-run
#[test]
fn the_eni_of_a_scan_with_lrw_reaches_op_on_a_line() {
    let export = scanned().to_eni(&ExportOptions::default().with_lrw(LrwUse::Always)).expect("it has an ENI");
    let refused = start(network(BUS), read(&export), false).err().expect("a ring refuses LRW").to_string();
    assert!(refused.contains("LRW"), "{refused}");
    let plant = activate_on(network(&BUS.replace("ring = true", "")), read(&export), false).expect("a line");
    let [outputs, _] = proven(plant, 3);
    assert!(outputs >= 16 + 2 * 3, "{outputs} outputs");
}

// covers: eni-run
#[test]
fn a_segment_made_of_an_exported_eni_reaches_op() {
    let export = scanned().to_eni(&ExportOptions::default()).expect("it has an ENI");
    let network = read(&export).simulated(false).expect("a segment");
    proven(activate_on(network, read(&export), false).expect("its own segment"), 4);
}

// covers: eni-run
#[test]
fn an_exported_eni_reaches_op_on_the_segment_of_the_eni_it_was_made_of() {
    let files = REAL.iter().filter_map(|(name, _)| real(name)).chain([machine()]);
    for (seed, file) in (10..).zip(files) {
        let made = export(&file.configuration, &ExportDetails::of(&file.eni), &ExportOptions::default());
        let export = made.unwrap_or_else(|error| panic!("{error}"));
        let network = file.simulated(false).expect("a segment");
        let [outputs, inputs] = proven(activate_on(network, read(&export), false).expect("its segment"), seed);
        assert!(outputs + inputs > 8, "{outputs} outputs, {inputs} inputs");
    }
}

/// A network file of a scan names the reference clock, the first clock of the bus, and the ENI has the same.
// covers: eni-run, dc-reference
#[test]
fn the_eni_of_a_scan_has_the_first_clock_as_reference() {
    let file = scanned();
    let named = file.clocks.as_ref().and_then(|clocks| clocks.reference.clone());
    assert_eq!(named, Some(file.subdevice[0].name.clone()));
    let export = file.to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    assert!(export.left_out.iter().all(|it| it.what != "clocks"), "{:?}", export.left_out);
    let clocks = read(&export).configuration.declaration.clocks.expect("it has clocks");
    assert_eq!(clocks.reference, ReferenceClock::Declared(SubDeviceId(0)));
}

/// The differences that `ringcat compare --eni` names, and whether they prevent OP.
fn differences(file: &EniFile, bus: &str) -> Vec<(DifferenceKind, bool)> {
    let links = SimulatedSegment::from_toml(bus).expect("the segment is valid");
    let scan = MainDevice::request(links, &Options::default()).scan().expect("the scan succeeds");
    let found = FoundNetwork::new(&scan.subdevices, &scan.topology);
    let all = file.configuration.differences(found, &file.stated());
    all.into_iter().map(|it| (it.kind, it.prevents_op)).collect()
}

/// Written by hand, or with the tables of the mailboxes removed: with the ENI the drives refused PREOP (0x0016).
// covers: eni-run
#[test]
fn an_eni_without_mailboxes_reaches_op_with_those_of_the_eeproms() {
    let mut file = scanned();
    let drives = file.subdevice.iter_mut().filter_map(|it| it.mailbox.take()).count();
    assert_eq!(drives, 2);
    let second = 5;
    let sdo = Sdo { index: 0x6060, data: Bytes(vec![9]), ..Sdo::default() };
    file.subdevice[second].startup.push(Startup { sdo: Some(sdo), ..Startup::default() });
    let export = file.to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    let left: Vec<_> = export.left_out.iter().filter(|it| it.what == "mailbox").map(|it| it.subdevice).collect();
    assert_eq!(left, [Some(second)], "{:?}", export.left_out);
    let eni = read(&export);
    assert_eq!(differences(&eni, BUS), [(DifferenceKind::Mailbox, false); 2]);
    let mut plant = activate_on(network(BUS), eni, false).expect("the network is the one of the file");
    plant.settle();
    plant.compare(&mut Dice::new(7));
    let named =
        |event: &&Event| matches!(event, Event::DeclarationWarning { what, .. } if what.contains("no mailboxes"));
    assert_eq!(plant.events.iter().filter(named).count(), 2, "{:?}", plant.events);
    // Without process data, too.
    for subdevice in &mut file.subdevice {
        subdevice.sync_manager.clear();
    }
    let export = file.to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    let mut application = start(network(BUS), read(&export), false).expect("it is activated").application;
    let until = application.now() + Duration::from_secs(10);
    let states = |application: &Application<SimulatedSegment>| {
        let devices = application.links().network().devices();
        devices.filter(|device| device.al_status().state != AlState::Init.code()).count()
    };
    while states(&application) < 6 && application.now() < until {
        application.cycle(|_| ());
    }
    assert_eq!(states(&application), 6, "all of them accept PREOP");
}

/// The device needs the addresses of the SII, or accepts others: those of the file are used, and one event reports the
/// difference.
// covers: eni-run
#[test]
fn each_address_of_an_eni_that_differs_from_the_sii_is_reported_once() {
    let export = scanned().to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    let named = |file: EniFile, wanted: &str| {
        let mut application = start(network(BUS), file, false).expect("it is activated").application;
        let mut found = Vec::new();
        // The SubDevice is configured several times.
        for _ in 0..3_000 {
            application.cycle(|_| ());
            while let Some(event) = application.pop_event() {
                match event.event {
                    Event::DeclarationWarning { what, .. } if what.contains(wanted) => found.push(what),
                    _ => {}
                }
            }
        }
        found
    };
    assert_eq!(named(read(&export), "the file has"), Vec::<String>::new());
    let mut file = read(&export);
    let drive = file
        .configuration
        .declaration
        .subdevices
        .iter_mut()
        .find(|it| it.declared.iter().flatten().any(|sm| sm.role == SyncManagerRole::MailboxIn));
    let declared = drive.expect("a drive").declared.as_mut().expect("it declares SyncManagers");
    for sm in declared {
        match sm.role {
            SyncManagerRole::MailboxIn => sm.register.length -= 2,
            SyncManagerRole::Inputs => sm.register.start += 0x40,
            _ => {}
        }
    }
    let found = named(file, "the file has");
    assert_eq!(found.len(), 2, "{found:?}");
    assert!(found[0].contains("has a mailbox of") && found[1].contains("has process data at"), "{found:?}");
}
