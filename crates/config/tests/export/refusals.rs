//! What an ENI cannot express: refused with SubDevice, setting and reason, or listed.

use ringcat_config::network::model::{Sdo, Startup, SubDevice, SyncManager, Target};
use ringcat_config::network::{Bytes, NetworkError, NetworkFile, Time};
use ringcat_config::{Configuration, ExportDetails, ExportOptions, export};
use ringcat_engine::config::{RegisterAccess, RegisterCommand, StartupAction, StartupCommand, Transition};
use ringcat_wire::address::RegisterAddress;

use crate::{CELL, SMALL, configured, network};

const COUPLER: usize = 0;
const DRIVE: usize = 1;

/// The error of the network file after a change.
fn refusal(change: impl FnOnce(&mut NetworkFile)) -> String {
    let mut file = network(CELL);
    change(&mut file);
    file.to_eni(&ExportOptions::default()).expect_err("an ENI cannot express it").to_string()
}

// covers: eni-run
#[test]
fn settings_without_which_another_network_results_are_refused_by_name() {
    let of_drive =
        |change: fn(&mut ringcat_config::network::model::SubDevice)| refusal(|file| change(&mut file.subdevice[DRIVE]));
    let expect = |got: String, expected: &str| assert!(got.starts_with(expected), "{got}");
    let drive = "SubDevice 1 \"Drive\": ";
    expect(of_drive(|it| it.target = Target::Preop), &format!("{drive}target: PREOP"));
    expect(of_drive(|it| it.check_identification = Some(3)), &format!("{drive}identification"));
    expect(of_drive(|it| it.alias = Some(7)), &format!("{drive}place: an alias"));
    expect(of_drive(|it| it.sync_manager[0].start = None), &format!("{drive}SyncManager 2: an ENI needs its `start`"));
    expect(
        of_drive(|it| it.sync_manager[0].pdo[0].entries = None),
        &format!("{drive}SyncManager 2: the entries of its PDOs"),
    );
    expect(
        of_drive(|it| it.startup[0].limit = Some(Time(std::time::Duration::from_micros(1_500)))),
        &format!("{drive}time limit"),
    );
    expect(refusal(|file| file.domain[0].period = Time(std::time::Duration::from_nanos(1_500))), "domain: 1.5µs");
    expect(refusal(|file| file.clocks = None), &format!("{drive}SYNC signals"));
}

/// A text of the file, what takes its place, the line and the rest of the error.
const REFUSED: [(&str, &str, &str); 8] = [
    ("check_revision = \"equal\"", "target = \"PREOP\"", "28: SubDevice \"Drive\": subdevice[1].target: PREOP: an ENI"),
    ("serial = 77", "alias = 7", "29: SubDevice \"Drive\": subdevice[1].alias: an alias or an identification"),
    ("serial = 77", "identification = 7", "29: SubDevice \"Drive\": subdevice[1].identification: an alias or an"),
    ("serial = 77", "check_identification = 7", "29: SubDevice \"Drive\": subdevice[1].check_identification: an ENI"),
    ("start = 0x1200\n", "", "47: SubDevice \"Drive\": subdevice[1].sync_manager[0]: an ENI needs its `start`"),
    ("number = 3", "number = 1", "63: SubDevice \"Drive\": subdevice[1].sync_manager[1]: a mailbox uses it"),
    ("\"1ms\"", "\"1000500ns\"", "10: domain[0].period: 1.0005ms: a cycle time of an ENI"),
    ("limit = \"3s\"", "limit = \"1500us\"", "89: SubDevice \"Drive\": subdevice[1].startup[0].limit: 1.5ms: a time"),
];

// covers: eni-run, network-file
#[test]
fn refusals_of_a_network_file_have_the_line_of_the_key() {
    for (from, to, expected) in REFUSED {
        let text = CELL.replacen(from, to, 1);
        assert_ne!(text, CELL, "{from}");
        let error = network(&text).to_eni(&ExportOptions::default()).expect_err("an ENI cannot express it");
        let error = NetworkError::of_export("cell.toml", &text, &error).to_string();
        assert!(error.starts_with(&format!("cell.toml:{expected}")), "{from} -> {to}: {error}");
    }
}

// covers: eni-run
#[test]
fn commands_that_the_maindevice_sends_itself_are_refused_as_start_up_commands() {
    let mut configuration = configured(SMALL);
    let write = RegisterAccess::Write(vec![1, 0]);
    let action = StartupAction::Register(RegisterCommand::new(RegisterAddress(0x0120), write));
    configuration.declaration.subdevices[COUPLER].startup.push(StartupCommand::new(Transition::Ps, action));
    let error = export(&configuration, &ExportDetails::default(), &ExportOptions::default()).expect_err("not sent");
    assert!(error.to_string().contains("start-up commands") || error.what == "the written file", "{error}");
}

// covers: ES-121, eni-run
#[test]
fn bits_of_a_revision_that_are_no_word_of_it_are_refused() {
    let mut configuration = network(CELL).configuration();
    configuration.declaration.subdevices[DRIVE].expected.revision_mask = 0x00FF_0000;
    let error = export(&configuration, &ExportDetails::default(), &ExportOptions::default()).expect_err("not a word");
    assert!(error.to_string().starts_with("SubDevice 1 \"Drive\": comparison of the revision: "), "{error}");
}

// covers: eni-run
#[test]
fn a_network_without_subdevices_is_refused() {
    let error = export(&Configuration::default(), &ExportDetails::default(), &ExportOptions::default());
    assert_eq!(error.expect_err("nothing is there").to_string(), "network: it has no SubDevice");
}

// covers: ES-139, eni-run
#[test]
fn settings_that_an_eni_has_no_place_for_are_listed() {
    let mut file = network(CELL);
    file.subdevice[COUPLER].optional = true;
    file.subdevice[DRIVE].firmware = "1.0".to_owned();
    file.subdevice[DRIVE].timeouts.sdo = Some(Time(std::time::Duration::from_secs(9)));
    file.domain[1].send_again = true;
    file.redundancy.ring = true;
    let export = file.to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    let listed: Vec<_> = export.left_out.iter().map(|it| (it.subdevice, it.what.as_str())).collect();
    let expected = [
        (None, "mailbox"),
        (None, "redundancy"),
        (Some(DRIVE), "firmware"),
        (None, "domain/send_again"),
        (Some(COUPLER), "optional"),
        (Some(DRIVE), "timeouts"),
    ];
    let order = (Some(DRIVE), "order of the start-up commands at PS");
    assert_eq!(listed, [&expected[..3], &[order, (Some(4), "sync_manager")], &expected[3..]].concat());
    let plain = network(CELL).to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(plain.left_out.len(), 3, "{:?}", plain.left_out);
}

/// A file that says nothing of mailboxes may have been written by hand. One with the ports of a SubDevice was made from
/// a scan or a description.
// covers: eni-run
#[test]
fn mailboxes_left_to_the_eeprom_are_listed_if_a_subdevice_may_need_them() {
    let listed = |file: &NetworkFile| -> Vec<(Option<usize>, String)> {
        let export = file.to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
        let left_out = export.left_out.into_iter().filter(|it| it.what == "mailbox");
        left_out.map(|it| (it.subdevice, it.reason)).collect()
    };
    let mut file = network(CELL);
    let [(None, whole)] = &listed(&file)[..] else { panic!("{:?}", listed(&file)) };
    assert!(whole.contains("whether 2 of 5 SubDevices have mailboxes") && whole.contains("ringcat init"), "{whole}");
    for subdevice in &mut file.subdevice {
        subdevice.ports = "YY".to_owned();
    }
    assert_eq!(listed(&file), [], "a simple terminal of a scan");
    file.subdevice[1].mailbox = None;
    let [(Some(1), of_drive)] = &listed(&file)[..] else { panic!("{:?}", listed(&file)) };
    assert!(of_drive.contains("start-up commands need a mailbox"), "{of_drive}");
    let registers = |it: &Startup| it.write.is_some() || it.check.is_some();
    file.subdevice[1].startup.retain(registers);
    assert_eq!(listed(&file), [], "commands to registers need none");
}

/// One of several tables was removed.
// covers: eni-run
#[test]
fn a_sync_manager_without_a_table_beside_others_is_listed() {
    let listed = |file: &NetworkFile| -> Vec<(Option<usize>, String)> {
        let export = file.to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
        let left_out = export.left_out.into_iter().filter(|it| it.what.starts_with("sync_manager "));
        left_out.map(|it| (it.subdevice, it.what)).collect()
    };
    let one = |number: u8| vec![(Some(DRIVE), format!("sync_manager {number}"))];
    let file = network(CELL);
    assert_eq!(file.subdevice[DRIVE].sync_manager.iter().map(|it| it.number).collect::<Vec<_>>(), [2, 3]);
    assert_eq!(listed(&file), []);
    for (at, number) in [(0, 2), (1, 3)] {
        let mut file = network(CELL);
        file.subdevice[DRIVE].sync_manager.remove(at);
        assert_eq!(listed(&file), one(number));
        // Without the mailbox, the numbers show it.
        file.subdevice[DRIVE].mailbox = None;
        assert_eq!(listed(&file), one(number));
        // A table without a length and without PDOs declares that there is no process data; a length of 0 leaves it to
        // the EEPROM.
        for (length, expected) in [(None, vec![]), (Some(0), one(number))] {
            let mut file = network(CELL);
            let table = &mut file.subdevice[DRIVE].sync_manager[at];
            (table.length, table.pdo) = (length, Vec::new());
            assert_eq!(listed(&file), expected);
        }
    }
    let mut file = network(CELL);
    let drive = file.subdevice[DRIVE].sync_manager[0].clone();
    let without_mailbox = |it: &&mut SubDevice| it.mailbox.is_none() && it.sync_manager.len() == 1;
    let terminal = file.subdevice.iter_mut().find(without_mailbox).expect("a simple terminal");
    let number = terminal.sync_manager[0].number;
    assert_eq!(number, 0);
    terminal.sync_manager.push(SyncManager { number: 2, ..drive });
    let [(Some(_), what)] = &listed(&file)[..] else { panic!("{:?}", listed(&file)) };
    assert_eq!(what, "sync_manager 1");
}

/// Commands that are sent after the PDOs undo the tables.
// covers: eni-run, ES-125
#[test]
fn start_up_commands_that_leave_other_process_data_than_the_tables_are_refused() {
    let mut file = network(CELL);
    let sdo = Sdo { index: 0x1C13, data: Bytes(vec![0]), ..Sdo::default() };
    let command = Startup { sdo: Some(sdo), after_pdos: true, ..Startup::default() };
    file.subdevice[DRIVE].startup.push(command.clone());
    let bytes = file.subdevice[DRIVE].sync_manager[1].pdo.iter().flat_map(|pdo| pdo.entries.iter().flatten());
    let bytes = bytes.map(|entry| u32::from(entry.bits)).sum::<u32>() / 8;
    let text = format!(
        "SubDevice 1 \"Drive\": start-up commands: they leave 0 bytes in the PDOs of SyncManager 3, its table has \
         {bytes}: the SubDevice refuses SAFEOP"
    );
    let refused = file.to_eni(&ExportOptions::default()).expect_err("the drive refuses SAFEOP");
    assert_eq!(refused.to_string(), text);
    file.subdevice[DRIVE].startup.pop();
    file.subdevice[DRIVE].startup.insert(0, Startup { after_pdos: false, ..command });
    let export = file.to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    let written = configured(&export.text).declaration.subdevices[DRIVE].startup.clone();
    let written = written.iter().filter_map(|command| match &command.action {
        StartupAction::Sdo(it) if (it.index, it.sub_index) == (0x1C13, 0) => Some(it.data.clone()),
        _ => None,
    });
    assert_eq!(written.collect::<Vec<_>>(), [[0], [0], [1]], "the PDOs of the table are written after it");
}

/// Ports and a mailbox do not show whether a SubDevice has process data. Couplers and junctions have none.
// covers: eni-run
#[test]
fn process_data_that_is_left_to_the_eeprom_is_listed_but_not_of_couplers() {
    let listed = |file: &NetworkFile| -> Vec<Option<usize>> {
        let export = file.to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
        let left_out = export.left_out.iter().filter(|it| it.what == "sync_manager");
        assert!(left_out.clone().all(|it| it.reason.contains("does not reach SAFEOP")), "{:?}", export.left_out);
        left_out.map(|it| it.subdevice).collect()
    };
    let mut file = network(CELL);
    let (coupler, terminal, camera) = (COUPLER, 3, Some(4));
    assert_eq!((&file.subdevice[coupler].ports[..], &file.subdevice[terminal].ports[..]), ("YKY", "KK"));
    assert_eq!(listed(&file), [camera]);
    file.subdevice[DRIVE].sync_manager.clear();
    assert_eq!(listed(&file), [Some(DRIVE), camera], "a mailbox");
    file.subdevice[terminal].sync_manager.clear();
    file.subdevice[terminal].domain = None;
    assert_eq!(listed(&file), [Some(DRIVE), Some(terminal), camera], "two ports of a kind");
    for (ports, is_listed) in [("YY", true), ("KY", false), ("K Y", false), ("YYYY", false), ("", true)] {
        file.subdevice[coupler].ports = ports.to_owned();
        assert_eq!(listed(&file).contains(&Some(coupler)), is_listed, "{ports:?}");
    }
    file.subdevice[coupler].ports = "YKY".to_owned();
    file.subdevice[coupler].domain = file.domain.first().map(|domain| domain.name.clone());
    assert!(listed(&file).contains(&Some(coupler)), "it names the domain of its process data");
}
