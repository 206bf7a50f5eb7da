//! Start-up commands of descriptions and the assignment that they need.

use std::time::Duration;

use ringcat_config::ExportOptions;
use ringcat_config::eni::{self, Transition};
use ringcat_config::esi::{Choices, NoReferences, read_with, select};
use ringcat_config::network::NetworkFile;
use ringcat_config::network::model::{At, Ip, Startup, SubDevice};
use ringcat_engine::config::StartupAction;

use crate::ACME;
use crate::reading::acme_of;

/// Two PDOs of one and four bits in one SyncManager.
const OUTPUTS: &str = include_str!("../files/outputs.xml");
const ANALOG: usize = 2;
const DRIVE: usize = 3;
const CYCLE: Duration = Duration::from_millis(1);
/// The mailbox of the drive.
const COE: &str = "<CoE SdoInfo=\"1\" PdoAssign=\"1\" PdoConfig=\"0\" CompleteAccess=\"1\"/></Mailbox>\n        <Dc>";

/// A file with the description and these start-up commands of the drive.
fn with_commands(coe: &str, soe: &str) -> String {
    let (head, tail) = ACME.split_once(COE).expect("the drive has CoE");
    let own = format!("<CoE SdoInfo=\"1\" PdoAssign=\"1\" CompleteAccess=\"1\">{coe}</CoE><SoE>{soe}</SoE></Mailbox>");
    format!("{head}{own}\n        <Dc>{tail}")
}

/// The network of one SubDevice, and the notices.
fn network(text: &str, device: usize) -> (NetworkFile, Vec<String>) {
    let esi = acme_of(text);
    let choices = Choices::default();
    let selection = select(&esi, &esi.devices[device], &choices).unwrap_or_else(|error| panic!("{error}"));
    let from = SubDevice::from_esi(&selection, CYCLE, 1033).unwrap_or_else(|error| panic!("{error}"));
    let mut file = NetworkFile::empty("machine", CYCLE);
    file.push(from.subdevice);
    (file, from.notices.iter().map(|notice| notice.text.clone()).collect())
}

// covers: esi-declare, ES-49
#[test]
fn assigned_pdos_follow_each_other_bit_by_bit() {
    let esi = acme_of(OUTPUTS);
    let choices = Choices::default();
    let selection = select(&esi, &esi.devices[0], &choices).unwrap();
    let bits: Vec<u32> = selection.sync_managers[0].pdos.iter().map(|pdo| pdo.bit_length()).collect();
    assert!(bits.len() == 2 && bits.iter().all(|bits| bits % 8 != 0), "{bits:?}");
    assert_eq!(selection.sync_managers[0].bytes(), bits.iter().sum::<u32>().div_ceil(8), "no padding between them");
    let (file, _) = network(OUTPUTS, 0);
    let configuration = file.configuration();
    let offsets = configuration.image.variables.iter().map(|variable| variable.image_bit as u64);
    let offsets: Vec<u64> = offsets.collect();
    let gap = selection.sync_managers[0].pdos[1].entries.iter().take_while(|entry| entry.index.index == 0);
    let gap: u64 = gap.map(|entry| u64::from(entry.bit_length)).sum();
    assert_eq!(offsets, [0, u64::from(bits[0]) + gap]);
}

// covers: esi-declare, ES-58
#[test]
fn start_up_commands_have_the_six_transitions_of_a_description() {
    let command = |transition: &str, sub: u8| {
        format!(
            "<InitCmd><Transition>{transition}</Transition><Index>#x2000</Index><SubIndex>{sub}</SubIndex>\
             <Data>01</Data><Comment>at {transition}</Comment></InitCmd>"
        )
    };
    let transitions = ["IP", "PS", "SO", "SP", "OP", "OS"];
    let all: String = (0..).zip(transitions).map(|(sub, transition)| command(transition, sub)).collect();
    let (file, notices) = network(&with_commands(&all, ""), DRIVE);
    let sent: Vec<(At, u8)> = file.subdevice[0]
        .startup
        .iter()
        .filter_map(|it| it.sdo.as_ref().filter(|sdo| sdo.index == 0x2000).map(|sdo| (it.at, sdo.sub)))
        .collect();
    assert_eq!(sent, [(At::Ip, 0), (At::Ps, 1), (At::So, 2), (At::Sp, 3), (At::Os, 5)]);
    let of_op: Vec<&String> = notices.iter().filter(|text| text.contains("\"at OP\"")).collect();
    assert!(of_op.len() == 1 && of_op[0].contains("at OP: not sent"), "{notices:?}");
    for wrong in ["II", "PI", "SI", "BI", "IB", "PP", "SS", "OI", "XY", ""] {
        let text = with_commands(&command(wrong, 0), "");
        let error = read_with("acme.xml", text.as_bytes(), &NoReferences);
        let error = error.map(|_| ()).expect_err(wrong).to_string();
        assert!(error.starts_with("acme.xml:") && error.contains("a transition"), "{wrong}: {error}");
    }
    let twice = command("PS", 7)
        .replace("<Transition>PS</Transition>", "<Transition>PS</Transition><Transition>SO</Transition>");
    let (file, _) = network(&with_commands(&twice, ""), DRIVE);
    let both = file.subdevice[0].startup.iter().filter(|it| it.sdo.as_ref().is_some_and(|sdo| sdo.sub == 7));
    assert_eq!(both.map(|it| it.at).collect::<Vec<_>>(), [At::Ps, At::So]);
}

// covers: esi-declare, ES-59
#[test]
fn a_start_up_command_of_soe_writes_the_value_of_an_idn_of_its_drive() {
    let command = |channel: &str, idn: &str| {
        format!("<InitCmd{channel}><Transition>PS</Transition><IDN>{idn}</IDN><Data>e803</Data></InitCmd>")
    };
    let soe = command(" Chn=\"1\"", "15") + &command("", "#x8001");
    let (file, notices) = network(&with_commands("", &soe), DRIVE);
    let sent = file.subdevice[0].startup.iter().filter_map(|it| it.idn.as_ref());
    let sent: Vec<_> = sent.map(|it| (it.drive, it.idn, it.data.0.clone())).collect();
    assert_eq!(sent, [(1, 15, vec![0xE8, 3]), (0, 0x8001, vec![0xE8, 3])], "{notices:?}");
    let configuration = file.configuration();
    let actions = configuration.declaration.subdevices[0].startup.iter().filter_map(|it| match &it.action {
        StartupAction::Idn(write) => Some((write.drive, write.idn.0, write.data.clone())),
        _ => None,
    });
    assert_eq!(actions.collect::<Vec<_>>(), sent, "the engine writes element 7, the value");
}

/// Objects that the commands of CoE at PS write in an exported ENI, each once in a row.
fn exported(file: &NetworkFile) -> Vec<u16> {
    let export = file.to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    let model = eni::read(export.text.as_bytes()).unwrap_or_else(|error| panic!("{error}"));
    let coe = &model.subdevices[0].mailbox.as_ref().expect("a mailbox").coe;
    let at_ps = coe.iter().filter(|command| command.transitions == [Transition::Ps]);
    let mut objects: Vec<u16> = at_ps.map(|command| command.index).collect();
    objects.dedup();
    objects
}

/// The same of the network file, with the place of the PDOs.
fn declared(file: &NetworkFile) -> Vec<(u16, bool)> {
    let startup = &file.configuration().declaration.subdevices[0].startup;
    let mut objects: Vec<(u16, bool)> = startup
        .iter()
        .filter_map(|it| match &it.action {
            StartupAction::Sdo(sdo) => Some((sdo.index, it.is_after_pdos())),
            _ => None,
        })
        .collect();
    objects.dedup();
    objects
}

// covers: esi-declare, ES-125, ES-126, eni-run
#[test]
fn modules_are_before_the_pdos_and_start_up_commands_after_them() {
    let command = |index: &str| {
        format!(
            "<InitCmd><Transition>PS</Transition><Index>{index}</Index><SubIndex>0</SubIndex><Data>01</Data></InitCmd>"
        )
    };
    let (mut file, _) = network(&with_commands(&command("#x2000"), ""), DRIVE);
    assert_eq!(declared(&file), [(0xF030, false), (0x2000, true), (0x6060, true)]);
    assert_eq!(exported(&file), [0xF030, 0x1C12, 0x1C13, 0x1C12, 0x1C13, 0x2000, 0x6060]);
    // What is written in the file stays where the file says.
    file.subdevice[0].startup[0..].iter_mut().for_each(|it| it.after_pdos = !it.after_pdos);
    assert_eq!(exported(&file), [0x2000, 0x6060, 0x1C12, 0x1C13, 0x1C12, 0x1C13, 0xF030]);
    // A description that assigns the PDOs itself is corrected by the engine.
    let (file, _) = network(&with_commands(&(command("#x2000") + &command("#x1C12")), ""), DRIVE);
    assert_eq!(declared(&file), [(0xF030, false), (0x2000, false), (0x1C12, false), (0x6060, false)]);
    assert_eq!(exported(&file), [0xF030, 0x2000, 0x1C12, 0x6060, 0x1C12, 0x1C13, 0x1C12, 0x1C13]);
}

// covers: esi-declare, ES-47, ES-125, eni-run
#[test]
fn the_mapping_of_a_fixed_pdo_is_not_written() {
    let text = |fixed: &str| {
        let text = ACME.replace("CoE SdoInfo=\"true\" PdoAssign=\"true\"", "CoE PdoAssign=\"1\" PdoConfig=\"1\"");
        text.replace(
            "<TxPdo Fixed=\"1\" Mandatory=\"1\" Sm=\"3\">",
            &format!("<TxPdo{fixed} Mandatory=\"1\" Sm=\"3\">"),
        )
    };
    let (file, _) = network(&text(" Fixed=\"1\""), ANALOG);
    let fixed: Vec<(u16, bool)> = file.subdevice[0].sync_manager[1].pdo.iter().map(|it| (it.index, it.fixed)).collect();
    assert_eq!(fixed, [(0x1A00, true), (0x1A02, true)]);
    assert_eq!(exported(&file), [0x1C12, 0x1C13, 0x1C12, 0x1C13, 0x8000]);
    let (file, _) = network(&text(""), ANALOG);
    assert_eq!(exported(&file), [0x1C12, 0x1C13, 0x1A02, 0x1C12, 0x1C13, 0x8000]);
}

/// As EC-Engineer writes them: a PDO that passes from one SyncManager to another is in neither meanwhile.
// covers: eni-run, ES-125, ES-182
#[test]
fn all_assignments_are_cleared_before_mappings_and_inputs_are_mapped_first() {
    let (mut file, _) = network(ACME, DRIVE);
    file.subdevice[0].mailbox.as_mut().expect("CoE").pdo_config = true;
    file.subdevice[0].sync_manager.iter_mut().flat_map(|it| &mut it.pdo).for_each(|pdo| pdo.fixed = false);
    assert_eq!(exported(&file), [0xF030, 0x1C12, 0x1C13, 0x1A00, 0x1600, 0x1C12, 0x1C13, 0x6060]);
}

// covers: esi-declare
#[test]
fn a_pdo_of_a_module_has_the_module_in_its_name() {
    let esi = acme_of(ACME);
    let mut choices = Choices::default();
    choices.modules = ["csp axis", "status axis"].map(|it| Some(it.to_owned())).into();
    let selection = select(&esi, &esi.devices[DRIVE], &choices).unwrap_or_else(|error| panic!("{error}"));
    let from = SubDevice::from_esi(&selection, CYCLE, 1033).unwrap_or_else(|error| panic!("{error}"));
    let pdos = from.subdevice.sync_manager.iter().flat_map(|it| &it.pdo);
    let names: Vec<(u16, &str)> = pdos.map(|pdo| (pdo.index, pdo.name.as_str())).collect();
    assert_eq!(names, [(0x1600, "csp axis/Outputs"), (0x1A00, "csp axis/Inputs"), (0x1A10, "status axis/Inputs")]);
}

// covers: eni-run, ES-125
#[test]
fn an_order_of_commands_that_an_eni_cannot_have_is_named() {
    let (mut file, _) = network(&with_commands("", ""), DRIVE);
    let idents = file.subdevice[0].startup.len();
    let ip = Startup { ip: Some(Ip { name: Some("drive".to_owned()), ..Ip::default() }), ..Startup::default() };
    file.subdevice[0].startup.push(ip);
    assert_eq!(exported(&file), [0xF030, 0x1C12, 0x1C13, 0x1C12, 0x1C13, 0x6060]);
    let left_out = file.to_eni(&ExportOptions::default()).map(|export| export.left_out).unwrap_or_default();
    assert!(left_out.iter().any(|it| it.what.contains("order of the start-up commands")), "{left_out:?}");
    file.subdevice[0].startup[idents].after_pdos = true;
    let left_out = file.to_eni(&ExportOptions::default()).map(|export| export.left_out).unwrap_or_default();
    assert!(!left_out.iter().any(|it| it.what.contains("order")), "{left_out:?}");
}

// covers: esi-declare, ES-68, ES-69
#[test]
fn alignment_of_modules_and_the_list_of_their_addresses_are_notices() {
    let text = ACME.replacen(
        "DownloadModuleIdentList=\"1\">",
        "DownloadModuleIdentList=\"1\" DownloadModuleAddressList=\"1\"><SlotGroupData SlotGroup=\"0\">\
         <ModulePdoGroup Alignment=\"16\">digital</ModulePdoGroup></SlotGroupData>",
        1,
    );
    assert_ne!(text, ACME);
    let (file, notices) = network(&text, DRIVE);
    assert!(notices.iter().any(|text| text.contains("0xf020 is not written")), "{notices:?}");
    assert!(notices.iter().any(|text| text.starts_with("ModulePdoGroup: ")), "{notices:?}");
    let written = file.subdevice[0].startup.iter().filter_map(|it| it.sdo.as_ref()).map(|sdo| sdo.index);
    assert!(written.clone().any(|index| index == 0xF030) && !written.clone().any(|index| index == 0xF020));
}
