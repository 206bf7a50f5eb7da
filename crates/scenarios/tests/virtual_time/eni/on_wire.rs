//! Commands of a file on the wire: retries, frames of their own, VoE, and the transitions to BOOT and back (protocol
//! 8.2).

use ringcat::simulated::SimulatedSegment;
use ringcat::{Event, MainDevice, Options, SubDeviceId};

use ringcat_wire::al::AlState;
use ringcat_wire::command::Command;
use ringcat_wire::mailbox::Protocol;
use ringcat_wire::mailbox::voe::VoeMessage;
use scenarios::witness::{Witness, datagrams};

use super::commands::{USER, go, record, register, served, user, with};
use super::{DRIVE, EniFile, activate};

/// A register that no controller has.
const UNUSED: u16 = 0x0E80;
/// Enough for some hundred retries, one per millisecond.
const CYCLES: usize = 2_000;

/// Command and register of each datagram, frame by frame, until the drive is in OP or has failed; whether it failed.
fn sent(file: &EniFile) -> (Vec<Vec<(u8, u16)>>, bool) {
    let network = file.simulated(false).expect("a segment");
    let (links, frames) = Witness::new(SimulatedSegment::new(network));
    let mut main_device = MainDevice::request(links, &Options::default());
    main_device.scan().expect("a scan");
    let mut application = main_device.activate(file.declaration(false)).expect("it fits");
    let mut has_failed = false;
    for _ in 0..CYCLES {
        application.cycle(|_| ());
        while let Some(event) = application.pop_event() {
            has_failed |= matches!(event.event, Event::ConfigurationFailed { subdevice: SubDeviceId(DRIVE), .. });
        }
        if has_failed || application.all_settled() {
            break;
        }
    }
    let all = frames.take().into_iter().filter(|passed| passed.is_sent);
    (all.map(|passed| datagrams(&passed.frame)).collect(), has_failed)
}

/// A write to a register with further elements.
fn write(register: u16, more: &str) -> String {
    format!(
        "<InitCmd><Transition>PS</Transition>{more}<Cmd>5</Cmd><Adp>1005</Adp><Ado>{register}</Ado><Data>1200</Data>\
         <Cnt>1</Cnt></InitCmd>"
    )
}

// covers: 8.2, eni-run
#[test]
fn a_command_without_a_response_is_repeated_as_often_as_the_file_says() {
    let mut attempts = None;
    for retries in [0_usize, 3, 255, 300] {
        let command = write(UNUSED, "").replace("</Cnt>", &format!("</Cnt><Retries>{retries}</Retries>"));
        let (frames, has_failed) = sent(&with(&command, "", "", ""));
        let tries = frames.iter().flatten().filter(|it| **it == (Command::Fpwr.code(), UNUSED)).count();
        assert!(has_failed, "{retries}");
        // The configuration is tried more than once before it has failed, with all its commands.
        let expected = *attempts.get_or_insert(tries);
        assert_eq!(tries, expected * (retries + 1), "{retries} retries");
    }
}

// covers: 8.2, eni-run
#[test]
fn commands_that_require_a_cycle_share_no_frame() {
    let commands: String = (0..4_u16).map(|it| write(USER.0 + 2 * it, "<Requires>cycle</Requires>")).collect();
    let (frames, has_failed) = sent(&with(&commands, "", "", ""));
    assert!(!has_failed);
    let own = USER.0..USER.0 + 8;
    let of_frame = |frame: &Vec<(u8, u16)>| {
        frame.iter().filter(|(code, at)| *code == Command::Fpwr.code() && own.contains(at)).map(|it| it.1).collect()
    };
    let writes: Vec<Vec<u16>> = frames.iter().map(of_frame).filter(|it: &Vec<u16>| !it.is_empty()).collect();
    let expected: Vec<Vec<u16>> = (0..4).map(|it| vec![USER.0 + 2 * it]).collect();
    assert_eq!(writes, expected, "in the order of the file, one in a frame");
}

// covers: 6.8, 8.2, eni-run
#[test]
fn messages_of_voe_in_a_file_reach_the_simulated_drive() {
    let mut message = vec![0; VoeMessage::OVERHEAD + 3];
    VoeMessage { vendor_id: 0xC47, vendor_type: 7, data: &[1, 2, 3] }.encode(&mut message).expect("it fits");
    let data: String = message.iter().map(|byte| format!("{byte:02x}")).collect();
    let command = |at: &str| format!("<InitCmd><Transition>{at}</Transition><Data>{data}</Data></InitCmd>");
    let voe = format!("<VoE><InitCmds>{}{}</InitCmds></VoE>", command("PS"), command("SO"));
    let mut plant = activate(with("", "", &voe, ""), false, false).expect("it fits");
    record(&mut plant);
    plant.settle();
    let expected = [AlState::PreOp, AlState::SafeOp].map(|state| (state, message.clone()));
    assert_eq!(served(&plant, Protocol::Voe), expected);
}

// covers: 5.1, 8.2, eni-run
#[test]
fn commands_of_a_file_on_the_ways_to_boot_and_back_are_sent() {
    let boot = "<Protocol>FoE</Protocol><BootStrap><Send><Start>4096</Start><Length>128</Length></Send>\
                <Recv><Start>4224</Start><Length>128</Length></Recv></BootStrap>";
    let registers = register(&["IB"], 5, "1baa") + &register(&["BI"], 5, "b1aa");
    let file = with(&registers, "", boot, "");
    let silent: Vec<_> = file.configuration.notices.iter().filter(|it| it.reason.contains("not sent")).collect();
    assert!(silent.is_empty(), "{silent:?}");
    let mut plant = activate(file, false, false).expect("it fits");
    plant.settle();
    assert_eq!(user(&plant, DRIVE), [0, 0]);
    go(&mut plant, AlState::Boot);
    assert_eq!(user(&plant, DRIVE), [0x1B, 0xAA]);
    go(&mut plant, AlState::Init);
    assert_eq!(user(&plant, DRIVE), [0xB1, 0xAA]);
    go(&mut plant, AlState::Op);
    plant.settle();
}
