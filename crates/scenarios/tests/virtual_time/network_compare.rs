//! `compare` marks the differences that prevent OP: the same network is activated on the simulated bus, and has to
//! reach OP exactly if no difference is marked.

use std::time::Duration;

use ringcat::config::network::model::{CheckRevision, Entry, Protocol, Required, SubDevice};
use ringcat::config::{Difference, DifferenceKind, ExportOptions, FoundNetwork, StatedProperties};
use ringcat::eni::EniFile;
use ringcat::network::{LoadedNetwork, NetworkFile, ScanOptions};
use ringcat::simulated::SimulatedSegment;
use ringcat::{Declaration, MainDevice, Options, Scan};
use ringcat_wire::al::{AlState, AlStatus};

use DifferenceKind::{
    Additional, Cable, Device, Identification, Mailbox, Missing, Order, Pdos, Ports, Protocols, Revision, Serial,
    SyncManager,
};

const LIMIT: Duration = Duration::from_secs(5);
const PERIOD: Duration = Duration::from_millis(1);

const OUTPUTS: usize = 1;
const ANALOG: usize = 2;
const DRIVE: usize = 3;
/// The bus of the files: outputs without CoE, analogue inputs with fixed PDOs, a drive whose PDOs can be written.
const BUS: [&str; 4] = ["coupler", "digital-output-8", "analog-input-4", "servo"];

fn scanned(types: &[&str]) -> (MainDevice<SimulatedSegment>, Scan) {
    let devices = types.iter().enumerate().map(|(at, kind)| {
        let (kind, more) = kind.split_once(' ').unwrap_or((kind, ""));
        format!("[[device]]\ntype = \"{kind}\"\nname = \"d{at}\"\n{}\n", more.replace(' ', "\n").replace('=', " = "))
    });
    let links = SimulatedSegment::from_toml(&devices.collect::<String>()).expect("the segment is valid");
    let mut main_device = MainDevice::request(links, &Options::default());
    let scan = main_device.scan().expect("the scan succeeds");
    (main_device, scan)
}

/// The file of the bus, after a change.
fn file_of(types: &[&str], change: impl FnOnce(&mut NetworkFile)) -> LoadedNetwork {
    let (_, scan) = scanned(types);
    let mut file = NetworkFile::from_scan(&scan.subdevices, &scan.topology, &ScanOptions::new("machine", PERIOD));
    change(&mut file);
    LoadedNetwork::new(file)
}

fn found(scan: &Scan) -> FoundNetwork<'_> {
    FoundNetwork::new(&scan.subdevices, &scan.topology)
}

/// Whether the declared network reaches OP.
fn reaches_op(main_device: MainDevice<SimulatedSegment>, declaration: Declaration) -> bool {
    let Ok(mut application) = main_device.activate(declaration) else { return false };
    application.wait_until_op(LIMIT).is_ok()
}

/// The differences of a network on a bus, whose marks are checked on the bus.
fn checked(network: &LoadedNetwork, types: &[&str]) -> Vec<Difference> {
    let (main_device, scan) = scanned(types);
    let differences = network.configuration.differences(found(&scan), &network.stated());
    let is_prevented = differences.iter().any(|it| it.prevents_op);
    assert_eq!(!is_prevented, reaches_op(main_device, network.declaration()), "{types:?}: {differences:#?}");
    differences
}

fn kinds(differences: &[Difference]) -> Vec<(DifferenceKind, bool)> {
    differences.iter().map(|it| (it.kind, it.prevents_op)).collect()
}

/// The same bus with a SubDevice inserted before this position.
fn with(at: usize, kind: &str) -> Vec<&str> {
    let mut types = BUS.to_vec();
    types.insert(at, kind);
    types
}

// covers: network-file
#[test]
fn an_additional_subdevice_prevents_op_where_it_moves_declared_positions() {
    let network = file_of(&BUS, |_| ());
    assert_eq!(kinds(&checked(&network, &BUS)), []);
    let of_places = |differences: Vec<Difference>| kinds(&differences);
    for (at, prevents) in [(0, true), (1, true), (3, true), (4, false)] {
        assert_eq!(of_places(checked(&network, &with(at, "digital-input-8"))), [(Additional, prevents)], "{at}");
    }
    // One more of a row is the last one of it.
    let row = ["coupler", "digital-output-8", "digital-output-8", "analog-input-4", "servo"];
    assert_eq!(of_places(checked(&network, &row)), [(Additional, true)]);
    let two = ["coupler", "digital-input-8", "digital-output-8", "analog-input-4", "servo", "digital-input-8"];
    assert_eq!(of_places(checked(&network, &two)), [(Additional, true), (Additional, false)]);
}

// covers: network-file
#[test]
fn an_additional_subdevice_moves_no_declaration_by_alias() {
    let types = ["coupler", "digital-output-8 alias=11", "servo alias=12"];
    let by_alias = |file: &mut NetworkFile| {
        for (subdevice, alias) in file.subdevice.iter_mut().skip(1).zip([11, 12]) {
            (subdevice.position, subdevice.alias, subdevice.offset) = (None, Some(alias), Some(0));
        }
    };
    let network = file_of(&types, by_alias);
    let more = ["coupler", "digital-output-8 alias=11", "digital-input-8", "servo alias=12"];
    assert_eq!(kinds(&checked(&network, &more))[0], (Additional, false));
    let before = ["digital-input-8", "coupler", "digital-output-8 alias=11", "servo alias=12"];
    assert_eq!(kinds(&checked(&network, &before))[0], (Additional, true), "the coupler is declared by position");
}

// covers: network-file
#[test]
fn a_missing_subdevice_prevents_op_unless_it_is_optional() {
    let without: Vec<&str> = BUS.iter().copied().filter(|kind| *kind != "digital-output-8").collect();
    assert_eq!(kinds(&checked(&file_of(&BUS, |_| ()), &without))[0], (Missing, true));
    let optional = |file: &mut NetworkFile| file.subdevice[OUTPUTS].optional = true;
    let network = file_of(&BUS, optional);
    assert_eq!(kinds(&checked(&network, &without)), [(Missing, false)]);
    let other = ["coupler", "digital-input-8", "analog-input-4", "servo"];
    assert_eq!(kinds(&checked(&network, &other)), [(Device, false)], "another device in place of an optional one");
    let all = file_of(&BUS, |file| {
        optional(file);
        file.required = Required::All;
    });
    assert_eq!(kinds(&checked(&all, &without)), [(Missing, true)]);
}

/// The file of a bus with nothing required.
fn nothing_required(types: &[&str], change: impl FnOnce(&mut NetworkFile)) -> LoadedNetwork {
    file_of(types, |file| {
        file.required = Required::Nothing;
        change(file);
    })
}

/// The states on a bus after an activation with nothing required: whether each SubDevice is in OP.
fn in_op(network: &LoadedNetwork, types: &[&str]) -> Vec<bool> {
    let (main_device, _) = scanned(types);
    let mut application = main_device.activate(network.declaration()).expect("nothing is required");
    // One that is missing stays so.
    let _ = application.wait_until_op(Duration::from_secs(2));
    application.links().network().devices().map(|it| it.al_status() == AlStatus::new(AlState::Op)).collect()
}

/// The engine finds SubDevices at other positions by their identities once it is active.
// covers: network-file, mandatory
#[test]
fn with_nothing_required_no_difference_of_places_prevents_op() {
    let network = nothing_required(&BUS, |_| ());
    let (coupler, outputs, analog, servo) = (BUS[0], BUS[1], BUS[2], BUS[3]);
    for (types, kind, expected) in [
        (vec![coupler, outputs, analog], Missing, vec![true; 3]),
        (vec![coupler, analog, servo], Missing, vec![true; 3]),
        (vec![coupler, analog, servo, outputs], Order, vec![true, true, true, false]),
        (vec![coupler, "digital-input-8", outputs, analog, servo], Additional, vec![true, false, true, true, true]),
        (vec![coupler, outputs, analog, servo, "digital-input-8"], Additional, vec![true, true, true, true, false]),
    ] {
        let (_, scan) = scanned(&types);
        let differences = network.configuration.differences(found(&scan), &network.stated());
        let places: Vec<_> = kinds(&differences).into_iter().filter(|(kind, _)| *kind != Cable).collect();
        assert_eq!(places, [(kind, false)], "{types:?}: {differences:#?}");
        assert_eq!(in_op(&network, &types), expected, "{types:?}");
    }
    // A SubDevice of another identity is absent; all others are in OP.
    let own = ["coupler", "digital-output-8 serial=11", "servo"];
    let compared = nothing_required(&own, |file| file.subdevice[1].serial = Some(12));
    let (_, scan) = scanned(&own);
    let differences = compared.configuration.differences(found(&scan), &compared.stated());
    assert_eq!(kinds(&differences), [(Serial, false)]);
    assert_eq!(in_op(&compared, &own), [true, false, true]);
}

// covers: network-file
#[test]
fn swapped_subdevices_are_one_difference_that_names_both_places() {
    let network = file_of(&BUS, |_| ());
    let differences = checked(&network, &["coupler", "analog-input-4", "digital-output-8", "servo"]);
    assert_eq!(kinds(&differences), [(Order, true)]);
    let text = "\"digital-output-8\" is at position 2 instead of position 1, and \"analog-input-4\" at position 1 \
                instead of position 2";
    assert_eq!(differences[0].text, text);
    let differences = checked(&network, &["coupler", "servo", "analog-input-4", "digital-output-8"]);
    assert_eq!(kinds(&differences), [(Order, true)], "{differences:#?}");
    let text = "\"digital-output-8\" is at position 3 instead of position 1, and \"servo\" at position 1 instead of \
                position 3";
    assert_eq!(differences[0].text, text);
    let differences = checked(&network, &["coupler", "analog-input-4", "servo", "digital-output-8"]);
    assert_eq!(kinds(&differences), [(Order, true)]);
    assert_eq!(differences[0].text, "\"digital-output-8\" is at position 3, the file has it at position 1");
    let differences = checked(&network, &["digital-output-8", "servo", "analog-input-4"]);
    assert_eq!(kinds(&differences), [(Missing, true), (Order, true)], "{differences:#?}");
    let text = "\"analog-input-4\" and \"servo\" have changed places: they are at positions 2 and 1, the file has them \
                at positions 2 and 3";
    assert_eq!(differences[1].text, text);
    let optional = file_of(&BUS, |file| file.subdevice[OUTPUTS].optional = true);
    assert!(!kinds(&checked(&optional, &["coupler", "analog-input-4", "servo", "digital-output-8"]))[0].1);
}

// covers: network-file
#[test]
fn another_identity_prevents_op_where_it_is_compared() {
    let types = |serial: &str| ["coupler".to_owned(), format!("digital-output-8 serial={serial}"), "servo".to_owned()];
    let (own, other) = (types("11"), types("12"));
    let (own, other): (Vec<&str>, Vec<&str>) =
        (own.iter().map(String::as_str).collect(), other.iter().map(String::as_str).collect());
    let declared = |optional: bool| {
        file_of(&own, |file| (file.subdevice[1].serial, file.subdevice[1].optional) = (Some(11), optional))
    };
    assert_eq!(kinds(&checked(&declared(false), &own)), []);
    assert_eq!(kinds(&checked(&declared(false), &other)), [(Serial, true)]);
    assert_eq!(kinds(&checked(&declared(true), &other)), [(Serial, false)]);
    let revision = |check: CheckRevision| {
        file_of(&own, |file| {
            file.subdevice[1].revision = file.subdevice[1].revision.map(|revision| revision + 1);
            file.subdevice[1].check_revision = check;
        })
    };
    assert_eq!(kinds(&checked(&revision(CheckRevision::None), &own)), [(Revision, false)]);
    assert_eq!(kinds(&checked(&revision(CheckRevision::LowEqual), &own)), [(Revision, true)]);
    assert_eq!(kinds(&checked(&revision(CheckRevision::HighEqual), &own)), [(Revision, false)]);
    let identified = file_of(&own, |file| file.subdevice[2].check_identification = Some(5));
    assert_eq!(kinds(&checked(&identified, &own)), [(Identification, true)]);
}

/// A change of the entries of the first PDO of a SubDevice.
fn entries(at: usize, change: fn(&mut Vec<Entry>)) -> LoadedNetwork {
    file_of(&BUS, |file| change(pdo_entries(&mut file.subdevice[at])))
}

fn pdo_entries(subdevice: &mut SubDevice) -> &mut Vec<Entry> {
    let with_pdos = subdevice.sync_manager.iter_mut().find(|it| !it.pdo.is_empty()).expect("process data");
    with_pdos.pdo[0].entries.as_mut().expect("the scan has them")
}

// covers: network-file
#[test]
fn pdos_that_differ_prevent_op_where_they_cannot_be_written() {
    let longer: fn(&mut Vec<Entry>) = |entries| entries[0].bits += 8;
    assert_eq!(kinds(&checked(&entries(OUTPUTS, longer), &BUS)), [(Pdos, true)], "without CoE");
    assert_eq!(kinds(&checked(&entries(ANALOG, longer), &BUS)), [(Pdos, true)], "the SII fixes them");
    // The same length: the SubDevice takes the bits for what it has.
    let other: fn(&mut Vec<Entry>) = |entries| entries[0].index += 1;
    assert_eq!(kinds(&checked(&entries(OUTPUTS, other), &BUS)), [(Pdos, false)]);
    assert_eq!(kinds(&checked(&entries(ANALOG, other), &BUS)), [(Pdos, false)]);
    let two: fn(&mut Vec<Entry>) = |entries| entries.iter_mut().take(2).for_each(|entry| entry.index += 1);
    let differences = checked(&entries(ANALOG, two), &BUS);
    assert_eq!(kinds(&differences), [(Pdos, false)]);
    assert!(differences[0].text.ends_with("; 1 more entry differs"), "{}", differences[0].text);
    // The mapping is written.
    let shorter: fn(&mut Vec<Entry>) = |entries| drop(entries.pop());
    assert_eq!(kinds(&checked(&entries(DRIVE, shorter), &BUS)), [(Pdos, false)]);
}

// covers: network-file
#[test]
fn pdos_that_are_left_out_prevent_op_where_the_assignment_cannot_be_written() {
    let types = ["coupler", "digital-output-16", "analog-input-4"];
    let left = |at: usize, count: usize| {
        file_of(&types, |file| {
            let sync_manager = file.subdevice[at].sync_manager.iter_mut().rfind(|it| it.pdo.len() > 1);
            sync_manager.expect("it has several PDOs").pdo.truncate(count);
        })
    };
    let differences = checked(&left(1, 8), &types);
    assert_eq!(kinds(&differences), [(Pdos, true)], "{differences:#?}");
    assert!(differences[0].text.contains("; expected a length of 1, got 2"), "{}", differences[0].text);
    assert_eq!(kinds(&checked(&left(2, 3), &types)), [(Pdos, false)], "it is written");
}

/// A SyncManager that only the file leaves out keeps its PDOs; a file without any leaves all to the SubDevice.
// covers: network-file
#[test]
fn a_syncmanager_that_the_file_leaves_out_is_a_difference_unless_all_are() {
    let without = |at: usize, kept: usize| {
        let change = |file: &mut NetworkFile| file.subdevice[at].sync_manager.truncate(kept);
        checked(&file_of(&BUS, change), &BUS)
    };
    for (at, count) in [(DRIVE, 2), (ANALOG, 1)] {
        for kept in 0..count {
            let expected: &[_] = if kept == 0 { &[] } else { &[(Pdos, false)] };
            let differences = without(at, kept);
            assert_eq!(kinds(&differences), expected, "{at}, {kept}: {differences:#?}");
        }
    }
}

// covers: network-file
#[test]
fn cables_and_mailboxes_of_a_network_file_do_not_prevent_op() {
    let mailbox = file_of(&BUS, |file| file.subdevice[DRIVE].mailbox.as_mut().expect("CoE").read.length += 2);
    assert_eq!(kinds(&checked(&mailbox, &BUS)), [(Mailbox, false)]);
    let cable = file_of(&BUS, |file| {
        file.subdevice[ANALOG].plugged_into.as_mut().expect("a cable").port = 3;
    });
    assert_eq!(kinds(&checked(&cable, &BUS)), [(Cable, false)]);
}

/// An ENI has SyncManagers of its own, which are written.
// covers: network-file, eni-run
#[test]
fn differences_from_an_eni_are_checked_by_the_bus_too() {
    type Change = fn(&mut NetworkFile);
    let changes: [(Change, &[(DifferenceKind, bool)]); 8] = [
        (|_| (), &[]),
        (|file| file.subdevice[DRIVE].mailbox.as_mut().expect("CoE").read.length -= 2, &[(Mailbox, true)]),
        (|file| pdo_entries(&mut file.subdevice[OUTPUTS])[0].bits += 8, &[(Pdos, true)]),
        (|file| drop(pdo_entries(&mut file.subdevice[DRIVE]).pop()), &[(Pdos, false)]),
        (|file| file.subdevice[DRIVE].sync_manager[0].start = Some(0x1D00), &[(SyncManager, true)]),
        (|file| file.subdevice[DRIVE].sync_manager[0].control = Some(0x66), &[(SyncManager, true)]),
        (
            |file| file.subdevice[DRIVE].mailbox.as_mut().expect("CoE").protocols.push(Protocol::SoE),
            &[(Protocols, false)],
        ),
        (|file| file.subdevice[DRIVE].ports = "KKY".to_owned(), &[(Ports, false)]),
    ];
    for (change, expected) in changes {
        assert_eq!(of_eni(&BUS, change), expected);
    }
    // A terminal without a processor takes any address.
    let types = ["coupler", "emulated-output-8"];
    assert_eq!(of_eni(&types, |_| ()), []);
    let moved: Change =
        |file| file.subdevice[1].sync_manager[0].start = file.subdevice[1].sync_manager[0].start.map(|it| it + 2);
    assert_eq!(of_eni(&types, moved), [(SyncManager, false)]);
}

// covers: network-file, eni-run
#[test]
fn an_eni_without_protocols_of_a_mailbox_states_nothing_of_them() {
    let export = file_of(&BUS, |_| ()).file.to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    let has_protocol = |line: &&str| line.contains("<Protocol>");
    assert!(export.text.lines().any(|line| has_protocol(&line)));
    let text: Vec<&str> = export.text.lines().filter(|line| !has_protocol(line)).collect();
    let eni = EniFile::from_bytes(text.join("\n").as_bytes()).unwrap_or_else(|error| panic!("{error}"));
    let (_, scan) = scanned(&BUS);
    assert_eq!(kinds(&eni.configuration.differences(found(&scan), &eni.stated())), []);
}

/// The differences of a bus to the ENI of a changed network file, whose marks are checked on the bus.
fn of_eni(types: &[&str], change: fn(&mut NetworkFile)) -> Vec<(DifferenceKind, bool)> {
    let file = file_of(types, change).file;
    let export = file.to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    let eni = EniFile::from_bytes(export.text.as_bytes()).unwrap_or_else(|error| panic!("{error}"));
    let (main_device, scan) = scanned(types);
    let stated: Vec<StatedProperties> = eni.stated();
    let differences = eni.configuration.differences(found(&scan), &stated);
    let is_prevented = differences.iter().any(|it| it.prevents_op);
    assert_eq!(!is_prevented, reaches_op(main_device, eni.declaration(false)), "{differences:#?}");
    kinds(&differences)
}

/// The place of a SubDevice that is declared by its alias does not count for an activation; the cables show it.
// covers: network-file
#[test]
fn subdevices_by_alias_that_have_changed_places_are_one_difference() {
    let types = ["coupler", "digital-output-8 alias=7", "analog-input-4 alias=8", "servo alias=9", "digital-output-8"];
    let network = file_of(&types, |file| {
        for (subdevice, alias) in file.subdevice[1..4].iter_mut().zip([7, 8, 9]) {
            (subdevice.position, subdevice.alias) = (None, Some(alias));
        }
    });
    assert_eq!(kinds(&checked(&network, &types)), []);
    let mut exchanged = types;
    exchanged.swap(1, 2);
    let differences = checked(&network, &exchanged);
    assert_eq!(kinds(&differences), [(Order, false)], "{differences:#?}");
    for part in [&network.file.subdevice[1].name, &network.file.subdevice[2].name, "at positions 2 and 1"] {
        assert!(differences[0].text.contains(part), "{}: {part}", differences[0].text);
    }
    // The one behind the others: those that are declared by position are not at theirs.
    let behind = [types[0], types[2], types[3], types[4], types[1]];
    let differences = checked(&network, &behind);
    assert_eq!(kinds(&differences), [(Order, true)], "{differences:#?}");
    assert!(differences[0].text.contains("is at position 3, the file has it at position 4"), "{}", differences[0].text);
    // Only one of them at another place: the cables of its neighbours are no differences of their own.
    let moved = [types[0], types[2], types[3], types[1], types[4]];
    let differences = checked(&network, &moved);
    assert_eq!(kinds(&differences), [(Cable, false)], "{differences:#?}");
}
