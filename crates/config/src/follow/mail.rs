//! Commands through mailboxes: those of CoE, SoE, EoE, AoE, FoE and VoE become start-up commands (protocol 6, 8.1).

use std::net::Ipv4Addr;
use std::time::Duration;

use ringcat_engine::config::{
    IdnRead, IdnWrite, IpSettings, MailMessage, SdoDownload, SdoUpload, StartupAction, StartupCommand,
};
use ringcat_wire::mailbox::soe::{Idn, SoeElements};

use super::bus::Bus;
use super::files;
use super::messages::{contradiction, named};
use super::notices::Notices;
use super::transitions::{Planned, comment};
use crate::eni::{CoeCommand, Eni, EniError, EoeCommand, Place, RawMailCommand, SoeCommand, Transition};
use crate::ip;

/// SoE: the element flag of the value of an IDN, and the op codes of a read and a write.
const SOE_VALUE: u8 = 0x40;
const SOE_READ: u8 = 2;
const SOE_WRITE: u8 = 3;
/// Drives of a SubDevice (protocol 6.6).
const SOE_DRIVES: u8 = 8;

/// Appends the mailbox commands of a SubDevice.
pub(super) fn startup(
    eni: &Eni,
    index: usize,
    bus: &Bus,
    startup: &mut Vec<(Place, StartupCommand)>,
    notices: &mut Notices,
) -> Result<(), EniError> {
    let Some(mailbox) = &eni.subdevices[index].mailbox else { return Ok(()) };
    let mut add =
        |place, transitions: &[Transition], subject: &str, timeout_ms, words: &str, action, notices: &mut Notices| {
            let planned = Planned { place, transitions, subdevice: Some(index), subject, action };
            let commands = planned.at_transitions(notices).into_iter();
            let whole = |command: StartupCommand| command.with_limit(limit(timeout_ms)).with_comment(comment(words));
            startup.extend(commands.map(|(place, command)| (place, whole(command))));
        };
    if bus.ccs_is_reversed && !mailbox.coe.is_empty() {
        let reason = "2 in all commands, and all have data: taken as downloads, as some tools write them";
        notices.add(Some(mailbox.coe[0].place), Some(index), "CoE/InitCmd/Ccs", reason);
    }
    for command in mailbox.coe.iter().filter(|command| !command.disabled) {
        let subject = named("CoE/InitCmd", &command.comment);
        match sdo(command, bus.ccs_is_reversed) {
            Ok(action) => {
                let CoeCommand { place, transitions, timeout_ms, comment, .. } = command;
                add(*place, transitions, &subject, *timeout_ms, comment, action, notices);
            }
            Err(reason) => {
                let what = format!("{subject} of object {:#06x}:{:02x}", command.index, command.sub_index);
                return Err(contradiction(eni, index, command.place, what, reason, "none", ""));
            }
        }
    }
    for command in mailbox.soe.iter().filter(|command| !command.disabled) {
        let subject = named("SoE/InitCmd", &command.comment);
        let SoeCommand { place, transitions, timeout_ms, comment, .. } = command;
        match idn(command) {
            Ok(action) => add(*place, transitions, &subject, *timeout_ms, comment, action, notices),
            Err(reason) => notices.add(Some(*place), Some(index), subject, reason),
        }
    }
    for command in mailbox.eoe.iter().filter(|command| !command.disabled) {
        let subject = named("EoE/InitCmd", &command.comment);
        let EoeCommand { place, transitions, timeout_ms, comment, .. } = command;
        match settings(command).map(StartupAction::Ip) {
            Ok(action) => add(*place, transitions, &subject, *timeout_ms, comment, action, notices),
            Err(reason) => notices.add(Some(*place), Some(index), subject, reason),
        }
    }
    for (command, action) in others(&mailbox.others) {
        let RawMailCommand { place, transitions, timeout_ms, comment, .. } = command;
        let subject = named(&format!("{}/InitCmd", command.protocol), comment);
        match action {
            Ok(action) => add(*place, transitions, &subject, *timeout_ms, comment, action, notices),
            Err(reason) => notices.add(Some(*place), Some(index), subject, reason),
        }
    }
    Ok(())
}

/// Transfers of files, and the messages of AoE and VoE.
fn others(commands: &[RawMailCommand]) -> Vec<(&RawMailCommand, Result<StartupAction, String>)> {
    let transfers = files::transfers(commands).into_iter().map(|transfer| (transfer.command, transfer.action));
    let messages = commands.iter().filter(|command| !command.disabled && command.protocol != files::PROTOCOL);
    let message = |command| message(command).map(StartupAction::Mail).map_err(str::to_owned);
    transfers.chain(messages.map(|command| (command, message(command)))).collect()
}

/// A limit of 0 is the default.
fn limit(timeout_ms: u32) -> Option<Duration> {
    (timeout_ms > 0).then(|| Duration::from_millis(timeout_ms.into()))
}

fn sdo(command: &CoeCommand, is_reversed: bool) -> Result<StartupAction, &'static str> {
    let (index, sub_index, complete_access) = (command.index, command.sub_index, command.complete_access);
    let data = command.data.clone();
    if (command.ccs == 2) != is_reversed {
        let expected = (!data.is_empty()).then_some(data);
        return Ok(StartupAction::Upload(
            SdoUpload::new(index, sub_index).with_complete_access(complete_access).with_expected(expected),
        ));
    }
    if data.is_empty() {
        return Err("Data to download");
    }
    Ok(StartupAction::Sdo(SdoDownload::new(index, sub_index, data).with_complete_access(complete_access)))
}

fn idn(command: &SoeCommand) -> Result<StartupAction, String> {
    if command.drive >= SOE_DRIVES {
        return Err(format!("DriveNo {}: a SubDevice has drives 0 to 7", command.drive));
    }
    let (drive, idn, data) = (command.drive, Idn(command.idn), command.data.clone());
    match (command.op_code, command.elements) {
        (SOE_READ, 0) => Err("Elements 0x00: there is nothing to read".to_owned()),
        (SOE_READ, elements) => {
            let read = IdnRead::new(drive, idn).with_elements(SoeElements(elements));
            Ok(StartupAction::IdnRead(read.with_expected((!data.is_empty()).then_some(data))))
        }
        (SOE_WRITE, SOE_VALUE) => Ok(StartupAction::Idn(IdnWrite::new(drive, idn, data))),
        (SOE_WRITE, elements) => Err(format!("Elements {elements:#04x}: only values (0x40) are written, and alone")),
        (op_code, _) => Err(format!("OpCode {op_code}: only reads (2) and writes (3) are sent")),
    }
}

/// A message of AoE or VoE.
fn message(command: &RawMailCommand) -> Result<MailMessage, &'static str> {
    let data = command.data.clone();
    let (message, reason) = match command.protocol {
        "AoE" => (MailMessage::Aoe(data), "its Data is no AMS header with a request: not sent"),
        _ => (MailMessage::Voe(data), "its Data is no VoE header with data: not sent"),
    };
    if message.is_sound() { Ok(message) } else { Err(reason) }
}

/// The IP settings, from separate elements or from the message.
fn settings(command: &EoeCommand) -> Result<IpSettings, &'static str> {
    if !command.data.is_empty() {
        return ip::settings(&command.data);
    }
    if command.kind.is_some_and(|kind| kind != ip::SET_IP) {
        return Err("a message that does not set addresses is not sent");
    }
    let address = |bytes: &Option<Vec<u8>>| match bytes.as_deref() {
        None | Some([]) => Ok(None),
        Some(&[a, b, c, d]) => Ok(Some(Ipv4Addr::new(a, b, c, d))),
        Some(_) => Err("an IP address that has not four bytes: not sent"),
    };
    let mac = match command.mac.as_deref() {
        None | Some([]) => None,
        Some(bytes) => Some(bytes.try_into().map_err(|_| "a MAC address that has not six bytes: not sent")?),
    };
    let name = command.name.as_ref().filter(|name| !name.is_empty()).map(|name| name.clone().into_bytes());
    if name.as_ref().is_some_and(|name| name.len() > ip::NAME) {
        return Err("a name of more than 32 bytes: not sent");
    }
    let settings = IpSettings::default()
        .with_mac(mac)
        .with_address(address(&command.ip)?)
        .with_mask(address(&command.subnet)?)
        .with_gateway(address(&command.gateway)?)
        .with_dns(address(&command.server)?)
        .with_name(name);
    if settings == IpSettings::default() { Err("no address in it: not sent") } else { Ok(settings) }
}
