//! `compare` marks process data of an ENI that a SubDevice does not have: left out, of another length than the start-up
//! commands leave, in SyncManagers that are not enabled. The same network is activated on the simulated bus.

use std::time::Duration;

use ringcat::config::network::Bytes;
use ringcat::config::network::model::{Sdo, Startup};
use ringcat::config::{Configuration, Difference, DifferenceKind, ExportOptions, FoundNetwork, StatedProperties};
use ringcat::eni::EniFile;
use ringcat::network::{LoadedNetwork, NetworkFile, ScanOptions};
use ringcat::simulated::SimulatedSegment;
use ringcat::{MainDevice, Options, Scan};

use DifferenceKind::{Mailbox, Pdos, SyncManager};

const LIMIT: Duration = Duration::from_secs(5);
const PERIOD: Duration = Duration::from_millis(1);

fn scanned(bus: &str) -> (MainDevice<SimulatedSegment>, Scan) {
    let devices: String = bus.split(' ').map(|kind| format!("[[device]]\ntype = \"{kind}\"\n")).collect();
    let links = SimulatedSegment::from_toml(&devices).expect("the segment is valid");
    let mut main_device = MainDevice::request(links, &Options::default());
    let scan = main_device.scan().expect("the scan succeeds");
    (main_device, scan)
}

fn file_of(bus: &str, change: impl FnOnce(&mut NetworkFile)) -> NetworkFile {
    let (_, scan) = scanned(bus);
    let mut file = NetworkFile::from_scan(&scan.subdevices, &scan.topology, &ScanOptions::new("machine", PERIOD));
    change(&mut file);
    file
}

fn exported(file: &NetworkFile) -> String {
    file.to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{error}")).text
}

/// The differences of a bus, whose marks are checked on the bus.
fn checked(configuration: &Configuration, stated: &[StatedProperties], bus: &str) -> Vec<Difference> {
    let (main_device, scan) = scanned(bus);
    let network = FoundNetwork::new(&scan.subdevices, &scan.topology);
    let differences = configuration.differences(network, stated);
    let is_prevented = differences.iter().any(|it| it.prevents_op);
    let reached = main_device.activate(configuration.declaration.clone()).map_err(|error| error.to_string());
    let reached = reached.and_then(|mut it| it.wait_until_op(LIMIT).map_err(|error| error.to_string()));
    assert_eq!(!is_prevented, reached.is_ok(), "{bus}: {reached:?}, {differences:#?}");
    differences
}

fn kinds(differences: &[Difference]) -> Vec<(DifferenceKind, bool)> {
    differences.iter().map(|it| (it.kind, it.prevents_op)).collect()
}

fn of_file(file: NetworkFile, bus: &str) -> Vec<(DifferenceKind, bool)> {
    let network = LoadedNetwork::new(file);
    kinds(&checked(&network.configuration, &network.stated(), bus))
}

fn of_eni(text: &str, bus: &str) -> Vec<Difference> {
    let eni = EniFile::from_bytes(text.as_bytes()).unwrap_or_else(|error| panic!("{error}"));
    checked(&eni.configuration, &eni.stated(), bus)
}

/// The differences to an exported ENI in which texts are replaced.
fn replaced(file: &NetworkFile, changes: &[(&str, &str)], bus: &str) -> Vec<Difference> {
    let text = changes.iter().fold(exported(file), |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replace(from, to)
    });
    of_eni(&text, bus)
}

/// The network file leaves the process data to the EEPROM; its ENI has none.
// covers: network-file, eni-run
#[test]
fn process_data_that_an_eni_leaves_out_prevents_op() {
    for (bus, expected) in [
        ("coupler", &[][..]),
        ("digital-output-8", &[(Pdos, true)]),
        ("digital-input-8", &[(Pdos, true)]),
        ("analog-input-4", &[(Pdos, true)]),
        ("servo", &[(Pdos, true), (Pdos, true)]),
        ("emulated-output-8", &[(Pdos, false)]),
    ] {
        let file = file_of(bus, |file| file.subdevice[0].sync_manager.clear());
        let text = exported(&file);
        assert_eq!(of_file(file, bus), [], "{bus}");
        assert_eq!(kinds(&of_eni(&text, bus)), expected, "{bus}");
    }
    // Without the mailbox as well, which is then that of the EEPROM.
    let file = file_of("servo", |file| {
        file.subdevice[0].sync_manager.clear();
        file.subdevice[0].mailbox = None;
    });
    let differences = of_eni(&exported(&file), "servo");
    assert_eq!(kinds(&differences), [(Mailbox, false), (Pdos, true), (Pdos, true)]);
    let text = "position 0 \"servo (1001)\": SM 2: PDO 0x1600 is assigned, but not in the file; expected a length of \
                0, got 12: the file has no process data for it";
    assert_eq!(differences[1].text, text);
    // One of two SyncManagers.
    let file = file_of("servo", |file| drop(file.subdevice[0].sync_manager.pop()));
    assert_eq!(of_file(file.clone(), "servo"), [(Pdos, false)], "the EEPROM has it");
    let of_mapping = |line: &&str| !line.contains("0x1c13");
    let text: Vec<String> = exported(&file).lines().filter(of_mapping).map(str::to_owned).collect();
    assert_eq!(kinds(&of_eni(&text.join("\n"), "servo")), [(Pdos, true)]);
}

fn write(index: u16, sub: u8, data: &[u8]) -> Startup {
    let sdo = Sdo { index, sub, data: Bytes(data.to_vec()), complete: false };
    Startup { sdo: Some(sdo), ..Startup::default() }
}

// covers: network-file, eni-run, ES-182
#[test]
fn the_pdos_that_the_commands_of_an_eni_leave_have_to_fill_the_syncmanager() {
    let file = file_of("servo", |_| ());
    assert_eq!(kinds(&replaced(&file, &[], "servo")), []);
    let longer = [("00110c0064", "00110e0064"), ("<DefaultSize>12<", "<DefaultSize>14<")];
    let differences = replaced(&file, &longer, "servo");
    assert_eq!(kinds(&differences), [(Pdos, true)]);
    let text = "position 0 \"servo (1001)\": SM 2: expected a length of 14, got 12 with the PDOs that the start-up \
                commands leave";
    assert_eq!(differences[0].text, text);
    // Without commands the SubDevice has its own PDOs.
    let text = longer.iter().fold(exported(&file), |text, (from, to)| text.replace(from, to));
    let (begin, end) = (text.find("<CoE>").expect("commands"), text.find("</CoE>").expect("their end"));
    let differences = of_eni(&format!("{}{}", &text[..begin], &text[end + "</CoE>".len()..]), "servo");
    assert_eq!(kinds(&differences), [(Pdos, true)]);
    let text = "position 0 \"servo (1001)\": SM 2: expected a length of 14, got 12 with the PDOs of the SubDevice: the \
                file does not write them";
    assert_eq!(differences[0].text, text);
    // A SyncManager that is disabled, and whose PDOs the commands assign.
    let disabled = replaced(&file, &[("00110c0064000100", "00110c0064000000")], "servo");
    assert_eq!(kinds(&disabled), [(Pdos, true)]);
    // No PDO is assigned.
    let text = exported(&file);
    let (head, count) = text.split_once("set count of sm pdos (0x1c13)").expect("the command");
    let text = format!("{head}set count of sm pdos (0x1c13){}", count.replacen("<Data>01", "<Data>00", 1));
    assert_eq!(kinds(&of_eni(&text, "servo")), [(Pdos, true)]);
}

/// The engine reads the assignment after the commands, and corrects it; another MainDevice has the commands of the ENI.
// covers: network-file, eni-run, ES-125
#[test]
fn an_eni_has_the_pdos_of_the_tables_where_start_up_commands_write_others() {
    let commands = [
        ("no PDO", vec![write(0x1C13, 0, &[0])]),
        ("a missing entry", vec![write(0x1C12, 0, &[0]), write(0x1600, 0, &[0]), write(0x1600, 0, &[1])]),
        (
            "another mapping",
            vec![
                write(0x1C12, 0, &[0]),
                write(0x1600, 0, &[0]),
                write(0x1600, 1, &[16, 0, 0x40, 0x60]),
                write(0x1600, 0, &[1]),
                write(0x1C12, 1, &[0, 0x16]),
                write(0x1C12, 0, &[1]),
            ],
        ),
    ];
    for (what, commands) in commands {
        let file = file_of("servo", |file| file.subdevice[0].startup = commands.clone());
        assert_eq!(of_file(file.clone(), "servo"), [], "{what}");
        assert_eq!(kinds(&of_eni(&exported(&file), "servo")), [], "{what}");
        // Sent after the PDOs, the commands undo the tables: a run does not reach OP, and an ENI is refused.
        let undone = file_of("servo", |file| {
            let after = |command: &Startup| Startup { after_pdos: true, ..command.clone() };
            file.subdevice[0].startup = commands.iter().map(after).collect();
        });
        assert_eq!(of_file(undone.clone(), "servo"), [(Pdos, true)], "{what}");
        let refused = undone.to_eni(&ExportOptions::default()).expect_err(what).to_string();
        assert!(refused.contains("\"servo\"") && refused.contains("start-up command"), "{what}: {refused}");
    }
}

/// The commands write the assignment; the mapping is that of the SII.
// covers: network-file, eni-run
#[test]
fn a_network_file_and_its_eni_have_the_same_mark_with_commands_for_the_assignment() {
    let bus = "analog-input-4";
    let longer = |file: &mut NetworkFile| {
        let with_pdos = file.subdevice[0].sync_manager.iter_mut().find(|it| !it.pdo.is_empty()).expect("it has PDOs");
        with_pdos.pdo[0].entries.as_mut().expect("the scan has them")[0].bits += 16;
    };
    let same = |_: &mut NetworkFile| ();
    for (change, prevents) in [(&longer as &dyn Fn(&mut NetworkFile), true), (&same, false)] {
        let file = file_of(bus, change);
        let eni = exported(&file);
        let with_commands = file_of(bus, |file| {
            change(file);
            let of = &mut file.subdevice[0];
            let assigned = of.sync_manager.iter().find(|it| !it.pdo.is_empty()).expect("it has PDOs");
            let object = 0x1C10 + u16::from(assigned.number);
            let entries = (1..).zip(&assigned.pdo).map(|(sub, pdo)| write(object, sub, &pdo.index.to_le_bytes()));
            let count = write(object, 0, &[assigned.pdo.len() as u8]);
            of.startup = std::iter::once(write(object, 0, &[0])).chain(entries).chain([count]).collect();
        });
        let eni_with_commands = exported(&with_commands);
        let expected: &[_] = if prevents { &[(Pdos, true)] } else { &[] };
        assert_eq!(of_file(file, bus), expected);
        assert_eq!(kinds(&of_eni(&eni, bus)), expected);
        assert_eq!(of_file(with_commands, bus), expected, "with commands");
        assert_eq!(kinds(&of_eni(&eni_with_commands, bus)), expected, "ENI with commands");
    }
}

// covers: network-file, eni-run
#[test]
fn mailboxes_of_an_eni_that_are_not_enabled_prevent_op() {
    let file = file_of("servo", |_| ());
    for (number, from, to) in [(0, "0010800026000100", "0010800026000000"), (1, "8010800022000100", "8010800022000000")]
    {
        let differences = replaced(&file, &[(from, to)], "servo");
        assert_eq!(kinds(&differences), [(SyncManager, true)], "{number}");
        let text = format!("position 0 \"servo (1001)\": SM {number}: a mailbox that the file does not enable");
        assert_eq!(differences[0].text, text);
    }
}

/// The command that writes the SyncManager is not in the ENI.
// covers: network-file, eni-run
#[test]
fn a_syncmanager_that_an_eni_does_not_write_prevents_op() {
    let bus = "coupler digital-output-8";
    let file = file_of(bus, |_| ());
    let text = exported(&file);
    let at = text.find("set sm 0").expect("the command");
    let begin = text[..at].rfind("<InitCmd>").expect("its begin");
    let end = at + text[at..].find("</InitCmd>").expect("its end") + "</InitCmd>".len();
    let without = format!("{}{}", &text[..begin], &text[end..]);
    assert_eq!(kinds(&of_eni(&without, bus)), [(Pdos, true)]);
    let disabled = replaced(&file, &[("0010010064000100", "0010010064000000")], bus);
    assert_eq!(kinds(&disabled), [(Pdos, true)]);
}

// covers: network-file, eni-run
#[test]
fn a_terminal_without_a_processor_accepts_process_data_of_any_length() {
    let bus = "coupler emulated-output-8";
    let file = file_of(bus, |file| {
        let entries = file.subdevice[1].sync_manager[0].pdo[0].entries.as_mut().expect("the scan has them");
        entries[0].bits += 16;
    });
    let text = exported(&file);
    assert_eq!(of_file(file, bus), [(Pdos, false)]);
    assert_eq!(kinds(&of_eni(&text, bus)), [(Pdos, false)]);
}
