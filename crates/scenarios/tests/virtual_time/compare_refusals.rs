//! `compare` names what an activation refuses besides places, identities and PDOs: clocks, rings, domains, LRW.
//! The same network is activated on the simulated bus, and has to reach OP exactly if no difference is marked.

use std::path::Path;
use std::time::Duration;

use ringcat::config::network::Bytes;
use ringcat::config::network::model::{Clocks, Connection, Junctions, Lrw, Sdo, Startup, Sync};
use ringcat::config::{
    Configuration, Difference, DifferenceKind, ExportOptions, FoundNetwork, LrwUse, StatedProperties,
};
use ringcat::eni::EniFile;
use ringcat::esi::EsiDevices;
use ringcat::network::{LoadedNetwork, NetworkFile, ScanOptions};
use ringcat::sim::network::Network;
use ringcat::sim::segment::Segment;
use ringcat::simulated::SimulatedSegment;
use ringcat::{Application, Event, MainDevice, Options, Scan, SubDeviceId};

use DifferenceKind::{Clocks as OfClocks, Modules, ProcessData, Ring, SyncManager};

const LIMIT: Duration = Duration::from_secs(8);
const PERIOD: Duration = Duration::from_millis(1);
const FILES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../config/tests/files");
/// Outputs without a clock between a coupler and a drive with clocks.
const LINE: &str = "[[device]]\ntype = \"coupler\"\n[[device]]\ntype = \"digital-output-8\"\nclock_bits = 0\n\
                    [[device]]\ntype = \"servo\"\n";
const RING_BEHIND_JUNCTION: &str = include_str!("../../../sim/segments/junction-ring.toml");

fn links(text: &str) -> SimulatedSegment {
    let segment = Segment::from_toml_with(text, Path::new(FILES), &EsiDevices::default()).expect("it is valid");
    SimulatedSegment::new(Network::from_description(segment).expect("it is valid"))
}

fn scanned(text: &str, options: &Options) -> (MainDevice<SimulatedSegment>, Scan) {
    let mut main_device = MainDevice::request(links(text), options);
    let scan = main_device.scan().expect("the scan succeeds");
    (main_device, scan)
}

fn file_of(text: &str, change: impl FnOnce(&mut NetworkFile)) -> LoadedNetwork {
    let (_, scan) = scanned(text, &Options::default());
    let mut file = NetworkFile::from_scan(&scan.subdevices, &scan.topology, &ScanOptions::new("machine", PERIOD));
    change(&mut file);
    let text = file.to_text();
    LoadedNetwork::from_bytes("machine.toml", text.as_bytes()).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

/// As `ringcat run` activates: with the rings of the file.
fn activated(
    mut main_device: MainDevice<SimulatedSegment>,
    configuration: &Configuration,
) -> Result<Application<SimulatedSegment>, String> {
    main_device.load(configuration.declaration.clone()).map_err(|error| error.to_string())?;
    for connection in &configuration.rings.connections {
        main_device.add_junction_connection(*connection).map_err(|error| error.to_string())?;
    }
    let mut application = main_device.apply().map_err(|error| error.to_string())?;
    application.wait_until_op(LIMIT).map_err(|error| error.to_string())?;
    Ok(application)
}

/// The differences of a bus, whose marks are checked on the bus.
fn checked_of(
    configuration: &Configuration,
    stated: &[StatedProperties],
    bus: &str,
    modules: &[Vec<u32>],
) -> Vec<Difference> {
    let options = Options::default().with_junctions(configuration.rings.junctions);
    let (mut main_device, scan) = scanned(bus, &options);
    let mut not_closed = None;
    if !configuration.rings.connections.is_empty() && main_device.load(configuration.declaration.clone()).is_ok() {
        let connections = &configuration.rings.connections;
        let added = connections.iter().all(|connection| main_device.add_junction_connection(*connection).is_ok());
        not_closed = main_device.check_connections().err().filter(|_| added);
    }
    let lists: Vec<Option<Vec<u32>>> = modules.iter().cloned().map(Some).collect();
    let network = FoundNetwork::new(&scan.subdevices, &scan.topology).with_modules(&lists).with_not_closed(not_closed);
    let differences = configuration.differences(network, stated);
    let is_prevented = differences.iter().any(|it| it.prevents_op);
    let reached = activated(main_device, configuration).map(|_| ());
    assert_eq!(!is_prevented, reached.is_ok(), "{reached:?}: {differences:#?}");
    differences
}

fn checked(network: &LoadedNetwork, bus: &str) -> Vec<(DifferenceKind, bool, String)> {
    let differences = checked_of(&network.configuration, &network.stated(), bus, &[]);
    differences.into_iter().map(|it| (it.kind, it.prevents_op, it.text)).collect()
}

fn one(kind: DifferenceKind, prevents_op: bool, text: &str) -> Vec<(DifferenceKind, bool, String)> {
    vec![(kind, prevents_op, text.to_owned())]
}

fn every_cycle() -> Option<Sync> {
    Some(ringcat::SyncSignals::sync0(1_000_000, 0).with_assign_activate(0x0300).into())
}

// covers: network-file, dc-sync
#[test]
fn sync_signals_without_a_clock_are_a_difference_that_prevents_op() {
    let clocks = |file: &mut NetworkFile| file.clocks = Some(Clocks::default());
    let of = |at: usize| {
        file_of(LINE, |file| {
            clocks(file);
            file.subdevice[at].sync = every_cycle();
        })
    };
    assert_eq!(checked(&of(2), LINE), []);
    let text = "position 1 \"digital-output-8\": SYNC signals, but it has no distributed clock";
    assert_eq!(checked(&of(1), LINE), one(OfClocks, true, text));
    // With nothing required the activation goes on, and this SubDevice does not reach OP.
    let alone = file_of(LINE, |file| {
        clocks(file);
        file.subdevice[1].sync = every_cycle();
        file.required = ringcat::config::network::model::Required::Nothing;
    });
    let (_, scan) = scanned(LINE, &Options::default());
    let network = FoundNetwork::new(&scan.subdevices, &scan.topology);
    let differences = alone.configuration.differences(network, &alone.stated());
    assert_eq!(differences.iter().map(|it| (it.kind, it.prevents_op)).collect::<Vec<_>>(), [(OfClocks, true)]);
}

// covers: network-file, dc-reference
#[test]
fn a_reference_without_a_clock_is_named_and_another_one_reported() {
    let with = |name: &str| {
        file_of(LINE, |file| {
            file.clocks = Some(Clocks { reference: Some(name.to_owned()), ..Clocks::default() });
            file.subdevice[2].sync = every_cycle();
        })
    };
    assert_eq!(checked(&with("servo"), LINE), []);
    let network = with("digital-output-8");
    let text = "position 1 \"digital-output-8\": it is the reference clock of the file, but has no distributed clock: \
                the clock at position 0 is the reference";
    assert_eq!(checked(&network, LINE), one(OfClocks, false, text));
    let (main_device, _) = scanned(LINE, &Options::default());
    let mut application = activated(main_device, &network.configuration).expect("another one is the reference");
    let events: Vec<Event> = std::iter::from_fn(|| application.pop_event()).map(|timed| timed.event).collect();
    let what = "declared as the reference clock, but it has no distributed clock: the clock at position 0 is the \
                reference";
    let expected = Event::DeclarationWarning { subdevice: SubDeviceId(1), what: what.to_owned() };
    assert_eq!(events.iter().filter(|event| **event == expected).count(), 1, "{events:#?}");
    let reference: Vec<bool> = application.clocks().iter().map(|clock| clock.is_reference).collect();
    assert_eq!(reference, [true, false], "the coupler has the first clock");
}

/// The network has no clock, and no SubDevice needs one.
// covers: network-file, dc-reference
#[test]
fn declared_clocks_of_a_network_without_clocks_are_reported() {
    let device = |kind: &str| format!("[[device]]\ntype = \"{kind}\"\nclock_bits = 0\n");
    let bus = &(device("coupler") + &device("digital-output-8"));
    let clocks = |file: &mut NetworkFile| file.clocks = Some(Clocks::default());
    assert_eq!(checked(&file_of(LINE, clocks), LINE), []);
    let text = "the file declares distributed clocks (clocks), but no SubDevice has one";
    assert_eq!(checked(&file_of(bus, clocks), bus), one(OfClocks, false, text));
    assert_eq!(checked(&file_of(bus, |_| ()), bus), []);
}

/// A run refuses the LRW on two interfaces, and splits it on request.
// covers: network-file, eni-run
#[test]
fn an_lrw_over_several_subdevices_is_reported_on_two_interfaces() {
    let ring = format!("[segment]\nring = true\n{LINE}");
    let network = file_of(LINE, |_| ());
    let options = ExportOptions::default().with_lrw(LrwUse::Always);
    let export = network.file.to_eni(&options).unwrap_or_else(|error| panic!("{error}"));
    let eni = EniFile::from_bytes(export.text.as_bytes()).unwrap_or_else(|error| panic!("{error}"));
    let differences = |bus: &str, is_ring: bool| {
        let (_, scan) = scanned(bus, &Options::default());
        let found = FoundNetwork::new(&scan.subdevices, &scan.topology).with_redundant(is_ring);
        eni.configuration.differences(found, &eni.stated())
    };
    assert_eq!(differences(LINE, false), []);
    let on_ring = differences(&ring, true);
    assert_eq!(on_ring.iter().map(|it| (it.kind, it.prevents_op)).collect::<Vec<_>>(), [(Ring, false)], "{on_ring:#?}");
    assert!(on_ring[0].text.contains("--split-lrw"), "{on_ring:#?}");
    for is_split in [false, true] {
        let (main_device, _) = scanned(&ring, &Options::default());
        let reached = main_device.activate(eni.declaration(is_split)).map_err(|error| error.to_string());
        let reached = reached.and_then(|mut it| it.wait_until_op(LIMIT).map_err(|error| error.to_string()));
        assert_eq!(reached.is_ok(), is_split, "{reached:?}");
    }
}

// covers: network-file, eni-run, dc-reference
#[test]
fn the_reference_of_an_eni_without_a_clock_is_named() {
    let clocked = LINE.replace("clock_bits = 0\n", "clock_bits = 64\n");
    let file = file_of(&clocked, |file| {
        file.clocks = Some(Clocks { reference: Some("digital-output-8".to_owned()), ..Clocks::default() });
        file.subdevice[2].sync = every_cycle();
    });
    let export = file.file.to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    let eni = EniFile::from_bytes(export.text.as_bytes()).unwrap_or_else(|error| panic!("{error}"));
    let kinds = |bus: &str| -> Vec<(DifferenceKind, bool)> {
        let all = checked_of(&eni.configuration, &eni.stated(), bus, &[]);
        all.iter().map(|it| (it.kind, it.prevents_op)).collect()
    };
    assert_eq!(kinds(&clocked), []);
    assert_eq!(kinds(LINE), [(OfClocks, false)]);
}

// covers: network-file
#[test]
fn a_declared_ring_that_is_a_line_is_a_difference_that_prevents_op() {
    let network = file_of(LINE, |file| file.redundancy.ring = true);
    let (_, scan) = scanned(LINE, &Options::default());
    let line = FoundNetwork::new(&scan.subdevices, &scan.topology);
    let differences = network.configuration.differences(line, &network.stated());
    assert_eq!(differences.iter().map(|it| (it.kind, it.prevents_op)).collect::<Vec<_>>(), [(Ring, true)]);
    let ring = format!("[segment]\nring = true\n{LINE}");
    let (_, scan) = scanned(&ring, &Options::default());
    let closed = FoundNetwork::new(&scan.subdevices, &scan.topology).with_redundant(true);
    assert_eq!(network.configuration.differences(closed, &network.stated()), []);
}

/// A ring behind a junction that the bus has, and three that it does not have: another tail, a tail upstream of the
/// head, a port that does not exist.
// covers: network-file, junctions, JR-06
#[test]
fn rings_behind_junctions_that_do_not_exist_prevent_op() {
    let bus = RING_BEHIND_JUNCTION;
    let (head, tail) = (1, 4);
    let strict = |head: usize, tail: usize, tail_port: u8| {
        file_of(bus, |file| {
            let name = |at: usize| file.subdevice[at].name.clone();
            let connection = Connection { head: name(head), head_port: 1, tail: name(tail), tail_port };
            (file.redundancy.junctions, file.redundancy.connection) = (Junctions::Strict, vec![connection]);
        })
    };
    assert_eq!(checked(&strict(head, tail, 1), bus), []);
    // The scan finds it: then the last SubDevice is known to be behind the junction.
    let automatic = file_of(bus, |file| {
        file.redundancy.junctions = Junctions::Automatic;
        file.subdevice.iter_mut().for_each(|it| it.plugged_into = None);
    });
    assert_eq!(checked(&automatic, bus), []);
    let before = tail - 1;
    for (network, part) in [
        (strict(head, before, 1), "does not lead back to"),
        (strict(tail, head, 1), ""),
        (strict(head, tail, 2), "has no port 2"),
    ] {
        let differences = checked(&network, bus);
        let kinds: Vec<_> = differences.iter().map(|(kind, prevents_op, _)| (*kind, *prevents_op)).collect();
        assert_eq!(kinds, [(Ring, true)], "{differences:#?}");
        assert!(differences[0].2.contains(part), "{differences:#?}");
    }
}

// covers: network-file
#[test]
fn lrw_that_a_subdevice_lacks_and_process_data_without_a_domain_prevent_op() {
    let without = LoadedNetwork::new({
        let mut file = file_of(LINE, |_| ()).file;
        file.domain.clear();
        file
    });
    let text = "SubDevice 1 has process data and there is no domain to exchange it: declare a domain, or PREOP as the \
                target";
    assert_eq!(checked(&without, LINE), one(ProcessData, true, text));
    let always = file_of(LINE, |file| file.lrw = Lrw::Always);
    assert_eq!(checked(&always, LINE), []);
}

/// Idents of the modules of the description: the csp axis, and another one.
const MODULES: [u32; 2] = [0x1_0001, 0x1_0002];

fn with_modules(modules: &str) -> String {
    format!("[[device]]\nesi = \"acme.xml\"\ntype = \"AM01\"\nmodules = [{modules}]\n")
}

/// The modules of the bus as the SubDevice lists them.
fn listed(bus: &str) -> Vec<Vec<u32>> {
    let (mut main_device, _) = scanned(bus, &Options::default());
    let at = ringcat::Position(0);
    main_device.subdevice(at).request_state(ringcat::AlState::PreOp).expect("it has a mailbox");
    let count: u8 = main_device.subdevice(at).sdo_read(0xF050, 0).expect("it lists its modules");
    let ident = |slot| main_device.subdevice(at).sdo_read(0xF050, slot).expect("it is in the list");
    vec![(1..=count).map(ident).collect()]
}

/// Commands that write a list of modules: as entries, or with complete access.
fn commands(idents: &[u32], complete: bool) -> Vec<Startup> {
    let sdo = |sub: u8, data: Vec<u8>| {
        let sdo = Sdo { index: 0xF030, sub, data: Bytes(data), complete };
        Startup { sdo: Some(sdo), ..Startup::default() }
    };
    let bytes = |ident: &u32| ident.to_le_bytes().to_vec();
    let count = idents.len() as u8;
    if complete {
        let entries = idents.iter().flat_map(bytes);
        return vec![sdo(0, [count, 0].into_iter().chain(entries).collect())];
    }
    let entries = (1..).zip(idents).map(|(slot, ident)| sdo(slot, bytes(ident)));
    std::iter::once(sdo(0, vec![0])).chain(entries).chain([sdo(0, vec![count])]).collect()
}

// covers: network-file, ES-69, ES-70
#[test]
fn modules_in_slots_that_are_not_those_of_the_file_prevent_op() {
    let [csp, other] = MODULES;
    let bus = |text: &str| with_modules(text);
    let (one_module, two) = (bus("\"0x00010001\""), bus("\"0x00010001\", \"-\", \"0x00010002\""));
    assert_eq!(listed(&two), [[csp, 0, other]]);
    let text = |slot: usize, expected: &str, got: &str| {
        format!("position 0 \"AM01\": slot {slot}: expected {expected}, got {got}")
    };
    let (csp_text, other_text) = (format!("module {csp:#010x}"), format!("module {other:#010x}"));
    let none = "no module";
    for (declared, on_bus, expected) in [
        (vec![csp], &one_module, vec![]),
        (vec![csp, 0, other], &two, vec![]),
        (vec![csp, 0, other], &one_module, vec![text(3, &other_text, none)]),
        (vec![csp], &two, vec![text(3, none, &other_text)]),
        (vec![other], &one_module, vec![text(1, &other_text, &csp_text)]),
    ] {
        for complete in [false, true] {
            let network = file_of(on_bus, |file| file.subdevice[0].startup = commands(&declared, complete));
            let by_file = checked_of(&network.configuration, &network.stated(), on_bus, &listed(on_bus));
            let texts = |all: &[Difference]| -> Vec<String> {
                assert!(all.iter().all(|it| it.kind == Modules && it.prevents_op), "{all:#?}");
                all.iter().map(|it| it.text.clone()).collect()
            };
            assert_eq!(texts(&by_file), expected, "{declared:x?}");
            let export = network.file.to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
            let eni = EniFile::from_bytes(export.text.as_bytes()).unwrap_or_else(|error| panic!("{error}"));
            let by_eni = checked_of(&eni.configuration, &eni.stated(), on_bus, &listed(on_bus));
            let expected: Vec<String> = expected.iter().map(|it| it.replace("\"AM01\"", "\"AM01 (1001)\"")).collect();
            assert_eq!(texts(&by_eni), expected, "ENI, {declared:x?}");
        }
    }
    // A list without idents is not compared by the SubDevice: the difference does not prevent OP.
    let network = file_of(&one_module, |file| file.subdevice[0].startup = commands(&[], false));
    let differences = checked_of(&network.configuration, &network.stated(), &one_module, &listed(&one_module));
    let kinds: Vec<_> = differences.iter().map(|it| (it.kind, it.prevents_op, it.text.clone())).collect();
    assert_eq!(kinds, one(Modules, false, &text(1, none, &csp_text)));
}

/// The bits of a control byte besides mode and direction do not prevent OP; those of a mailbox do.
// covers: network-file, eni-run
#[test]
fn all_bits_of_control_bytes_of_an_eni_are_compared() {
    let export = file_of(LINE, |_| ()).file.to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    let of = |changes: &[(&str, &str)]| {
        let text = changes.iter().fold(export.text.clone(), |text, (from, to)| {
            assert!(text.contains(from), "{from}");
            text.replace(from, to)
        });
        let eni = EniFile::from_bytes(text.as_bytes()).unwrap_or_else(|error| panic!("{error}"));
        let all = checked_of(&eni.configuration, &eni.stated(), LINE, &[]);
        all.into_iter().map(|it| (it.kind, it.prevents_op, it.text)).collect::<Vec<_>>()
    };
    assert_eq!(of(&[]), []);
    let mailbox =
        [("0010800026000100", "0010800024000100"), ("<ControlByte>38</ControlByte>", "<ControlByte>36</ControlByte>")];
    let text = "position 2 \"servo (1003)\": SM 0: expected control byte 0x24, got 0x26";
    assert_eq!(of(&mailbox)[..1], one(SyncManager, true, text));
    let network = file_of(LINE, |file| {
        let control = file.subdevice[1].sync_manager[0].control.as_mut().expect("the scan has it");
        *control ^= 0x20;
    });
    let export = network.file.to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    let eni = EniFile::from_bytes(export.text.as_bytes()).unwrap_or_else(|error| panic!("{error}"));
    let all = checked_of(&eni.configuration, &eni.stated(), LINE, &[]);
    assert_eq!(all.iter().map(|it| (it.kind, it.prevents_op)).collect::<Vec<_>>(), [(SyncManager, false)], "{all:#?}");
}

/// `RevisionNo` is a required element: 0 where the file has none.
// covers: network-file, eni-run
#[test]
fn an_eni_of_a_file_without_revisions_and_identities_has_no_difference() {
    for vendor in [true, false] {
        let network = file_of(LINE, |file| {
            for it in &mut file.subdevice {
                it.revision = None;
                if !vendor {
                    (it.vendor, it.product) = (None, None);
                }
            }
        });
        let export = network.file.to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
        let eni = EniFile::from_bytes(export.text.as_bytes()).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(checked_of(&eni.configuration, &eni.stated(), LINE, &[]), []);
    }
}

/// An SII does not describe modules; a SyncManager that is missing in the ENI is a difference nevertheless.
// covers: network-file, eni-run, ES-69
#[test]
fn process_data_of_modules_that_is_missing_in_an_eni_is_reported() {
    let bus = with_modules("\"0x00010001\"");
    for (left, names) in [(0, &[2, 3][..]), (1, &[3])] {
        let network = file_of(&bus, |file| {
            file.subdevice[0].startup = commands(&MODULES[..1], false);
            file.subdevice[0].sync_manager.truncate(left);
        });
        let by_file = checked_of(&network.configuration, &network.stated(), &bus, &listed(&bus));
        assert_eq!(by_file, [], "the SubDevice has it");
        let export = network.file.to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
        let eni = EniFile::from_bytes(export.text.as_bytes()).unwrap_or_else(|error| panic!("{error}"));
        let by_eni = checked_of(&eni.configuration, &eni.stated(), &bus, &listed(&bus));
        let sync_managers = by_eni.iter().map(|it| it.text.split_once("SM ").expect("a SyncManager").1);
        let sync_managers: Vec<String> = sync_managers.map(|text| text[..1].to_owned()).collect();
        assert_eq!(sync_managers, names.iter().map(i32::to_string).collect::<Vec<_>>(), "{by_eni:#?}");
        assert!(by_eni.iter().all(|it| it.text.ends_with("the file has no process data for it")), "{by_eni:#?}");
        // Without its list of modules, nothing shows that it has process data.
        let (_, scan) = scanned(&bus, &Options::default());
        let found = FoundNetwork::new(&scan.subdevices, &scan.topology);
        let unknown = eni.configuration.differences(found, &eni.stated());
        assert_eq!(unknown.iter().map(|it| it.prevents_op).collect::<Vec<_>>(), vec![false; names.len()]);
    }
}

// covers: network-file, dc-sync, ES-60
#[test]
fn sync_signals_that_no_mode_has_and_a_cycle_of_0_prevent_op() {
    let none = |word: &str| {
        format!(
            "position 2 \"servo\": AssignActivate {word} activates SYNC signals of none of its modes (0x0000, 0x0300, \
             0x0700)"
        )
    };
    let no_cycle = "position 2 \"servo\": its SYNC signals need a cycle of SYNC0, the file has 0".to_owned();
    for (word, cycle, expected) in [
        (0x0300, 1_000_000, None),
        (0x0700, 1_000_000, None),
        (0x0000, 0, None),
        (0x0300, 0, Some(no_cycle)),
        (0x0500, 1_000_000, Some(none("0x0500"))),
        (0x0100, 1_000_000, Some(none("0x0100"))),
    ] {
        let network = file_of(LINE, |file| {
            file.clocks = Some(Clocks::default());
            let signals = ringcat::SyncSignals::sync0(cycle, 0).with_assign_activate(word);
            file.subdevice[2].sync = Some(Sync::from(signals));
        });
        let expected = expected.map_or(Vec::new(), |text| one(OfClocks, true, &text));
        assert_eq!(checked(&network, LINE), expected, "{word:#06x}, {cycle} ns");
    }
}
