//! Start-up commands of descriptions and the assignment that they need.

use std::time::Duration;

use ringcat_config::esi::{Choices, NoReferences, read_with, select};
use ringcat_config::network::NetworkFile;
use ringcat_config::network::model::{At, SubDevice};
use ringcat_engine::config::StartupAction;

use crate::ACME;
use crate::reading::acme_of;

/// Two PDOs of one and four bits in one SyncManager.
const OUTPUTS: &str = include_str!("../files/outputs.xml");
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
