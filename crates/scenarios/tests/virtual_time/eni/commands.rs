//! Commands of a file beside the way to OP: on ways to INIT, at states that are requested again, for the whole bus, of
//! SoE and AoE. Evaluated by what the SubDevices have served, in which state, and by their registers.

use ringcat::{Event, SubDeviceId};
use ringcat_sim::application::ServedMail;
use ringcat_sim::cable::DeviceIndex;
use ringcat_wire::address::RegisterAddress;
use ringcat_wire::al::AlState;
use ringcat_wire::mailbox::Protocol;
use ringcat_wire::mailbox::sdo::SdoRequest;

use super::{DRIVE, EniFile, MACHINE, Plant, activate};

/// User memory of a controller.
pub(super) const USER: RegisterAddress = RegisterAddress(0x0F80);

/// The machine with commands before those of the drive, of its dictionary, of its other protocols, of the bus.
pub(super) fn with(registers: &str, objects: &str, protocols: &str, bus: &str) -> EniFile {
    let text = String::from_utf8(MACHINE.to_vec()).expect("it is text");
    let insert = |text: &str, from: usize, mark: &str, new: &str| {
        let at = from + text[from..].find(mark).unwrap_or_else(|| panic!("{mark}")) + mark.len();
        [&text[..at], new, &text[at..]].concat()
    };
    let drive = |text: &str| text.find("<Name>Drive</Name>").expect("it is there");
    let mailbox = drive(&text) + text[drive(&text)..].find("</Mailbox>").expect("it has one");
    let text = insert(&text, mailbox, "<InitCmds>", registers);
    let text = insert(&text, drive(&text), "<InitCmds>", objects);
    let text = insert(&text, drive(&text), "</CoE>", protocols);
    let text = insert(&text, 0, "<InitCmds>", bus);
    EniFile::from_bytes(text.as_bytes()).unwrap_or_else(|error| panic!("{error}"))
}

fn transitions(names: &[&str]) -> String {
    names.iter().map(|name| format!("<Transition>{name}</Transition>")).collect()
}

pub(super) fn register(names: &[&str], code: u8, data: &str) -> String {
    let (at, adp) = (transitions(names), if code == 8 { 0 } else { 1005 });
    format!(
        "<InitCmd>{at}<Comment>user memory</Comment><Cmd>{code}</Cmd><Adp>{adp}</Adp><Ado>{}</Ado><Data>{data}</Data>\
         <Cnt>1</Cnt></InitCmd>",
        USER.0
    )
}

/// A download to the mode of operation, the value of which distinguishes the commands.
fn object(names: &[&str], value: u8) -> String {
    let at = transitions(names);
    format!("<InitCmd>{at}<Comment>mode</Comment><Ccs>1</Ccs><Index>24672</Index><Data>{value:02x}</Data></InitCmd>")
}

pub(super) fn user(plant: &Plant, index: usize) -> [u8; 2] {
    *plant.device(index).controller.register(USER, 2).first_chunk().expect("two bytes")
}

pub(super) fn served(plant: &Plant, protocol: Protocol) -> Vec<(AlState, Vec<u8>)> {
    let served = plant.device(DRIVE).application.served_mail().iter().filter(|mail| mail.protocol == protocol);
    served.map(|mail| (mail.state, mail.payload.clone())).collect()
}

/// Values written to the mode of operation since the recording began.
fn modes(plant: &Plant) -> Vec<(AlState, u8)> {
    let mode = |mail: &ServedMail| match SdoRequest::decode(&mail.payload).ok()? {
        SdoRequest::DownloadExpedited { index: 0x6060, data, .. } => Some((mail.state, data[0])),
        _ => None,
    };
    plant.device(DRIVE).application.served_mail().iter().filter_map(mode).collect()
}

pub(super) fn record(plant: &mut Plant) {
    plant.network_mut().device_mut(DeviceIndex(DRIVE)).application.record_mail();
}

pub(super) fn go(plant: &mut Plant, state: AlState) {
    let mut work = plant.application.engine_mut().start_state_request(SubDeviceId(DRIVE), state);
    let result = loop {
        match work.take() {
            Some(result) => break result,
            None => plant.cycle(),
        }
    };
    result.unwrap_or_else(|error| panic!("{state}: {error}"));
}

// covers: 5.1, 8.2, eni-run
#[test]
fn commands_of_a_file_on_ways_to_init_and_at_repeated_requests_are_sent() {
    use AlState::{Init, Op, PreOp, SafeOp};
    let ways = [("PI", 0x11), ("SI", 0x12), ("OI", 0x13), ("PP", 0x14), ("SS", 0x15)];
    let objects: String = ways.iter().map(|(name, value)| object(&[*name], *value)).collect();
    let data = |value: u8| format!("{value:02x}aa");
    let registers: String = ways.iter().map(|(name, value)| register(&[*name], 5, &data(*value))).collect();
    let registers = registers + &register(&["II"], 5, "10aa");
    let file = with(&registers, &objects, "", "");
    assert!(file.configuration.notices.iter().all(|notice| !notice.reason.contains("not sent")));
    let mut plant = activate(file, false, false).expect("it fits");
    plant.settle();
    assert_eq!(user(&plant, DRIVE), [0x10, 0xAA]);
    for (path, state, value, memory) in [
        (&[PreOp, PreOp][..], PreOp, 0x14, 0x14),
        (&[Init], PreOp, 0x11, 0x11),
        (&[SafeOp, SafeOp], SafeOp, 0x15, 0x15),
        (&[Init], SafeOp, 0x12, 0x12),
        (&[Op, Init], Op, 0x13, 0x13),
    ] {
        record(&mut plant);
        path.iter().for_each(|state| go(&mut plant, *state));
        let own: Vec<_> = modes(&plant).into_iter().filter(|(_, value)| *value >= 0x10).collect();
        assert_eq!((own, user(&plant, DRIVE)), (vec![(state, value)], [memory, 0xAA]), "{path:?}");
    }
    go(&mut plant, Op);
    plant.settle();
}

// covers: 8.2, eni-run
#[test]
fn commands_of_a_file_to_the_whole_bus_reach_each_subdevice_also_after_its_return() {
    let mut plant = activate(with("", "", "", &register(&["IP"], 8, "cdab")), false, false).expect("it fits");
    plant.settle();
    let all = |plant: &Plant| (0..5).map(|index| user(plant, index)).collect::<Vec<_>>();
    assert_eq!(all(&plant), [[0xCD, 0xAB]; 5]);
    plant.network_mut().power_off(DeviceIndex(DRIVE));
    plant.run(50);
    plant.network_mut().power_on(DeviceIndex(DRIVE));
    assert_ne!(user(&plant, DRIVE), [0xCD, 0xAB], "its memory is lost");
    plant.settle();
    assert_eq!(all(&plant), [[0xCD, 0xAB]; 5]);
}

// covers: 6.6, 6.7, 8.2, eni-run
#[test]
fn reads_of_soe_messages_of_aoe_and_files_in_a_file_reach_the_simulated_drive() {
    let ams = "050607080301e803050607080301008004000400000000000000000034120000";
    let read = |at: &str, data: &str| {
        format!(
            "<InitCmd><Transition>{at}</Transition><Comment>diagnosis</Comment><OpCode>2</OpCode><IDN>11</IDN>{data}\
             </InitCmd>"
        )
    };
    let both = [read("PS", "<Data>0000</Data>"), read("SO", "")].concat();
    let soe = format!("<SoE><InitCmds>{both}</InitCmds></SoE>");
    let aoe =
        format!("<AoE><InitCmds><InitCmd><Transition>PS</Transition><Data>{ams}</Data></InitCmd></InitCmds></AoE>");
    // "gains" with the contents "12" in two packets, and "log" as it is.
    let command = |data: &str| format!("<InitCmd><Transition>PS</Transition><Data>{data}</Data></InitCmd>");
    let write = ["0200000000006761696e73", "03000100000031", "03000200000032"].map(command).concat();
    let foe = format!("<FoE><InitCmds>{write}{}</InitCmds></FoE>", command("0100000000006c6f67"));
    let mut plant = activate(with("", "", &(soe + &aoe + &foe), ""), false, false).expect("it fits");
    record(&mut plant);
    plant.settle();
    let states = |protocol| served(&plant, protocol).into_iter().map(|(state, _)| state).collect::<Vec<_>>();
    assert_eq!(states(Protocol::Soe), [AlState::PreOp, AlState::SafeOp]);
    assert_eq!(states(Protocol::Aoe), [AlState::PreOp]);
    let read = plant.events.iter().filter_map(|event| match event {
        Event::StartupRead { subdevice: SubDeviceId(DRIVE), comment, data, .. } => {
            Some((comment.clone(), data.clone()))
        }
        _ => None,
    });
    let read: Vec<_> = read.collect();
    assert_eq!(read, [(None, b"log".to_vec()), (Some("diagnosis".to_owned()), vec![0, 0])]);
    assert_eq!(plant.device(DRIVE).application.files().file(b"gains"), Some(&b"12"[..]));
}

// covers: 8.2, eni-run
#[test]
fn a_group_of_a_file_is_found_by_a_data_word() {
    let group = "<HotConnect><GroupName>Drive</GroupName><GroupMemberCnt>1</GroupMemberCnt><IdentifyCmd>\
                 <Cmd>1</Cmd><Adp>0</Adp><Ado>4096</Ado><Data>0000</Data><Validate><Data>0700</Data>\
                 <Timeout>100</Timeout></Validate></IdentifyCmd></HotConnect>";
    let text = String::from_utf8(MACHINE.to_vec()).expect("it is text");
    assert_eq!(text.matches("      <DC>").count(), 1);
    let text = text.replace("      <DC>", &format!("      {group}<DC>"));
    let file = EniFile::from_bytes(text.as_bytes()).unwrap_or_else(|error| panic!("{error}"));
    let mut plant = activate(file, false, false).expect("it fits");
    plant.settle();
    assert_eq!(plant.found[DRIVE].identification, None, "its EEPROM names no word");
    assert_eq!(plant.found[DRIVE].data_word(RegisterAddress(4096)), Some(7));
}
