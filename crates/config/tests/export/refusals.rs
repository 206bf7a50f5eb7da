//! What an ENI cannot express: refused with SubDevice, setting and reason, or listed.

use ringcat_config::network::model::{Startup, Target};
use ringcat_config::network::{NetworkFile, Time};
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
fn mailboxes_left_to_the_eeprom_are_listed_if_a_subdevice_may_need_one() {
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
