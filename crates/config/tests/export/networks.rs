//! ENIs from network files.

use ringcat_config::eni::Target;
use ringcat_config::{Export, ExportOptions, LrwUse};
use ringcat_engine::config::{ConfigAddress, ReferenceClock, StartupAction, SyncManagerRole, Transition};
use ringcat_engine::declared::{GroupId, SubDeviceId};
use ringcat_engine::info::Direction;
use ringcat_wire::address::RegisterAddress;
use ringcat_wire::al::AlState;
use ringcat_wire::command::Command;

use crate::{CELL, again, model, network};

// covers: eni-run
#[test]
fn the_eni_of_a_network_file_declares_the_network_of_the_file() {
    let file = network(CELL);
    let export = file.to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    let (before, after) = (file.configuration(), export.configuration);
    for (index, (of, got)) in before.declaration.subdevices.iter().zip(&after.declaration.subdevices).enumerate() {
        let place = (of.address, of.expected, of.group, of.optional, of.sync);
        assert_eq!((got.address, got.expected, got.group, got.optional, got.sync), place);
        let registers = (of.watchdog_divider, of.watchdog_intervals, of.pdi_watchdog_intervals, of.sii_to_pdi);
        assert_eq!(
            (got.watchdog_divider, got.watchdog_intervals, got.pdi_watchdog_intervals, got.sii_to_pdi),
            registers
        );
        for transition in [Transition::Ip, Transition::Ps, Transition::So, Transition::Os, Transition::Sp] {
            let own = of.startup.iter().filter(|command| command.transition == transition);
            let is_of_pdos = |action: &StartupAction| match action {
                StartupAction::Sdo(sdo) => matches!(sdo.index, 0x1600..=0x1BFF | 0x1C10..=0x1C2F),
                _ => false,
            };
            let all = got.startup.iter().filter(|it| it.transition == transition && !is_of_pdos(&it.action));
            assert_eq!(all.collect::<Vec<_>>(), own.collect::<Vec<_>>(), "{index}, {transition}");
        }
        let limits = |from, to| (of.limit(from, to), got.limit(from, to));
        for (from, to) in [(AlState::Init, AlState::PreOp), (AlState::Op, AlState::Init)] {
            let (expected, got) = limits(from, to);
            assert_eq!(expected, got);
        }
        let pdos = of.pdos.iter().flatten().map(|it| (it.sync_manager, it.pdos.clone()));
        let declared = got.declared.iter().flatten().filter(|it| !it.pdos.is_empty());
        assert_eq!(
            declared.map(|it| (it.index, it.pdos.clone())).collect::<Vec<_>>(),
            pdos.filter(|(_, pdos)| !pdos.is_empty()).collect::<Vec<_>>()
        );
    }
    assert_eq!(after.groups, ["tool 1", "camera"]);
    let names = |of: &ringcat_config::Configuration| {
        let mut names: Vec<String> = of.image.variables.iter().map(|variable| variable.name.clone()).collect();
        names.sort();
        names
    };
    assert_eq!(names(&after), names(&before));
    assert_eq!(after.subdevices[1].plugged_into, before.subdevices[1].plugged_into);
    let clocks = after.declaration.clocks.as_ref().expect("the file has clocks");
    assert_eq!((clocks.reference, clocks.bus_shift), (ReferenceClock::Declared(SubDeviceId(1)), true));
}

// covers: eni-run
#[test]
fn sync_managers_mailboxes_and_domains_of_a_network_file_are_in_its_eni() {
    let export = network(CELL).to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    let configs = &export.configuration.declaration.subdevices;
    let shape = |index: usize| {
        let declared = configs[index].declared.iter().flatten();
        declared.map(|it| (it.index, it.role, it.register.start, it.register.length, it.op_only)).collect::<Vec<_>>()
    };
    use SyncManagerRole::{Inputs, MailboxIn, MailboxOut, Outputs};
    assert_eq!(shape(0), []);
    let drive = [
        (0, MailboxOut, 0x1000, 128, false),
        (1, MailboxIn, 0x1080, 128, false),
        (2, Outputs, 0x1200, 7, false),
        (3, Inputs, 0x1300, 2, false),
    ];
    assert_eq!(shape(1), drive);
    assert_eq!(shape(2), [(0, Outputs, 0x0F00, 2, true)], "it is enabled in OP only");
    assert_eq!(configs[2].address, ConfigAddress::Alias { alias: 5, offset: 0 });
    assert_eq!(configs[4].address, ConfigAddress::Identification { value: 9, offset: 0 });
    assert_eq!((configs[3].group, configs[4].group), (Some(GroupId(0)), Some(GroupId(1))));
    let declared = configs[1].declared.as_ref().expect("SyncManagers");
    assert_eq!(declared[2].register.control.bits(), 0x64, "with the watchdog");
    let boot = configs[1].declared_bootstrap.as_ref().expect("mailboxes of BOOT");
    assert_eq!((boot[0].register.length, boot[1].register.start), (256, 0x1100));
    let domains: Vec<_> = export
        .configuration
        .declaration
        .domains
        .iter()
        .map(|domain| {
            let members = domain.members.iter().map(|it| (it.subdevice.0, it.sync_managers.clone()));
            (domain.period.as_millis(), members.collect::<Vec<_>>())
        })
        .collect();
    let fast = vec![(1, Some(vec![2])), (2, None)];
    assert_eq!(domains, [(1, fast), (10, vec![(1, Some(vec![3])), (3, None)])]);
    let assigned = configs[1].startup.iter().filter_map(|command| match &command.action {
        StartupAction::Sdo(download) if download.index >= 0x1C12 && download.index < 0x1C20 => {
            Some(download.data.clone())
        }
        _ => None,
    });
    let expected: [Vec<u8>; 6] = [vec![0], vec![0], vec![0x00, 0x16], vec![1], vec![0x00, 0x1A], vec![1]];
    assert_eq!(assigned.collect::<Vec<_>>(), expected);
    let eni = model(&export.text);
    assert_eq!(eni.main_device.name, "Cell & <4>");
    let drive = &eni.subdevices[1];
    assert_eq!((drive.physics.as_str(), drive.revision, drive.serial), ("YY", Some(0x10_0000), Some(77)));
    assert_eq!(drive.mailbox.as_ref().unwrap().protocols, ["EoE", "CoE", "FoE", "SoE"]);
    let pdo = &drive.process_data.as_ref().unwrap().pdos[0];
    assert_eq!((pdo.name.as_str(), pdo.entries[1].name.as_str()), ("Command", "Target > \"0\""));
}

// covers: eni-run, ES-182
#[test]
fn an_assignment_is_cleared_filled_and_counted() {
    let text = CELL.replacen("pdo_config = true", "pdo_config = false", 1);
    let second = "[[subdevice.sync_manager.pdo]]\nindex = 0x160f\nentries = [{ index = 0x60ff, bits = 32 }]\n\n";
    let text = text.replacen("index = 0x1600", "index = 0x160a", 1).replacen("index = 0x1a00", "index = 0x1a0a", 1);
    let (head, tail) = text.split_once("[[subdevice.sync_manager]]\nnumber = 3").expect("the drive has two");
    let text = format!("{head}{second}[[subdevice.sync_manager]]\nnumber = 3{tail}");
    let export = network(&text).to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    let written = export.configuration.declaration.subdevices[1].startup.iter().filter_map(|it| match &it.action {
        StartupAction::Sdo(it) if matches!(it.index, 0x1600..=0x1C1F) => {
            Some((it.index, it.sub_index, it.data.clone()))
        }
        _ => None,
    });
    let expected = [
        (0x1C12, 0, vec![0]),
        (0x1C13, 0, vec![0]),
        (0x1C12, 1, vec![0x0A, 0x16]),
        (0x1C12, 2, vec![0x0F, 0x16]),
        (0x1C12, 0, vec![2]),
        (0x1C13, 1, vec![0x0A, 0x1A]),
        (0x1C13, 0, vec![1]),
    ];
    assert_eq!(written.collect::<Vec<_>>(), expected);
}

// covers: eni-run
#[test]
fn each_domain_of_a_network_file_has_an_lrw_of_its_own() {
    let export = network(CELL)
        .to_eni(&ExportOptions::default().with_lrw(LrwUse::Always))
        .unwrap_or_else(|error| panic!("{error}"));
    assert!(export.left_out.iter().all(|it| it.what != "place of the inputs"), "{:?}", export.left_out);
    let lrw = &export.configuration.declaration.explicit_lrw;
    let subdevices: Vec<Vec<usize>> = lrw.iter().map(|it| it.subdevices.iter().map(|it| it.0).collect()).collect();
    assert_eq!(subdevices, [vec![1, 2], vec![1, 3]]);
}

/// The inputs of the drive would replace the outputs for the tool behind it.
// covers: eni-run
#[test]
fn inputs_that_would_replace_outputs_in_an_lrw_are_behind_the_outputs() {
    let mut file = network(CELL);
    file.subdevice[1].sync_manager.remove(0);
    file.subdevice[1].sync_manager[0].domain = None;
    let export =
        file.to_eni(&ExportOptions::default().with_lrw(LrwUse::Always)).unwrap_or_else(|error| panic!("{error}"));
    let image = &export.configuration.image;
    let inputs = image.areas.iter().filter(|area| area.direction == Direction::Inputs);
    let outputs = image.areas.iter().filter(|area| area.direction == Direction::Outputs);
    let outputs = outputs.map(|area| (area.image_bit + area.bits).div_ceil(8)).max().expect("there are outputs");
    assert_eq!(inputs.map(|area| area.image_bit).min(), Some(outputs * 8));
    assert!(export.left_out.iter().any(|it| it.what == "place of the inputs"), "{:?}", export.left_out);
    let apart = file.to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    let first = |of: &Export| {
        let inputs = of.configuration.image.areas.iter().filter(|area| area.direction == Direction::Inputs);
        inputs.map(|area| area.image_bit).min().expect("there are inputs")
    };
    assert_eq!(first(&apart) + outputs * 8, first(&export));
}

// covers: eni-run
#[test]
fn names_of_any_characters_give_a_well_formed_file() {
    let file = network(CELL);
    let every: Vec<char> = (0..=0xFFFF_u32).filter_map(char::from_u32).chain(['\u{1F600}', '\u{10FFFF}']).collect();
    for chunk in every.chunks(4096) {
        let mut file = file.clone();
        let text: String = format!("]]>{}--&lt;<a b='\"", chunk.iter().collect::<String>());
        file.name.clone_from(&text);
        file.domain[0].name.clone_from(&text);
        file.subdevice[1].sync_manager[0].pdo[0].name.clone_from(&text);
        file.subdevice[1].startup[0].comment = Some(text.clone());
        file.subdevice[3].name.clone_from(&text);
        for it in &mut file.subdevice {
            if let Some(group) = &mut it.group {
                group.push_str(&text);
            }
        }
        let export = file.to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
        let read = model(&export.text);
        let expected: String = text
            .chars()
            .map(|it| match it {
                '\u{FFFE}' | '\u{FFFF}' => '\u{FFFD}',
                it if it.is_control() => ' ',
                it => it,
            })
            .collect();
        assert_eq!(read.main_device.name, expected.trim());
        assert_eq!(export.configuration.subdevices[3].name, expected.trim());
    }
}

// covers: 4.3, 8.2, eni-run
#[test]
fn a_group_found_by_a_data_word_is_exported_with_the_address_of_the_word() {
    let text = CELL.replace("identification = 9\n", "identification = 9\nidentification_word = 0x1000\n");
    let file = network(&text);
    let export = file.to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    let expected = ConfigAddress::DataWord { register: RegisterAddress(0x1000), value: 9, offset: 0 };
    assert_eq!(file.configuration().declaration.subdevices[4].address, expected);
    assert_eq!(export.configuration.declaration.subdevices[4].address, expected);
    let written = model(&export.text);
    let group = written.subdevices[4].hot_connect.as_ref().expect("a group");
    let [identify] = &group.identify[..] else { panic!("one command reads the word: {:?}", group.identify) };
    let Target::Register { ado, .. } = identify.datagram.target else { panic!("it reads memory") };
    let validate = identify.validate.as_ref().expect("it compares the word");
    assert_eq!((identify.datagram.command, ado.0, &validate.data[..]), (Command::Aprd, 0x1000, &[9, 0][..]));
    let again = again(&export.text, &ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(again.configuration.declaration.subdevices[4].address, expected, "and once more");
}
