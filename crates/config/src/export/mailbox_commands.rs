//! Start-up commands through the mailbox: CoE, SoE, EoE, AoE, FoE, VoE.

use ringcat_engine::config::{
    FileRead, FileWrite, IdnRead, IdnWrite, IpSettings, MailMessage, SdoDownload, SdoUpload, StartupAction,
    StartupCommand, Transition,
};
use ringcat_wire::mailbox::foe::FoeMessage;

use super::init_commands::ms;
use super::order::{Order, Section, place};
use super::transitions::transition;
use crate::eni::{CoeCommand, EoeCommand, Mailbox, Place, RawMailCommand, SoeCommand};
use crate::ip;

/// `Ccs`.
const DOWNLOAD: u8 = 1;
const UPLOAD: u8 = 2;
/// Bytes of a mailbox of which the declaration does not state the size.
const SMALL_MAILBOX: usize = 128;
/// `OpCode` of a read; `OpCode` and `Elements` of a write of the value.
const SOE_READ: u8 = 2;
const SOE_WRITE: u8 = 3;
const SOE_VALUE: u8 = 0x40;

/// Adds the commands in their order.
pub(super) fn add(startup: &[StartupCommand], order: &Order, mailbox: &mut Mailbox) {
    for command in startup {
        match &command.action {
            StartupAction::Sdo(of) => mailbox.coe.push(download(command, of, order)),
            StartupAction::Upload(of) => mailbox.coe.push(upload(command, of, order)),
            StartupAction::Idn(of) => mailbox.soe.push(idn(command, of, order)),
            StartupAction::IdnRead(of) => mailbox.soe.push(idn_read(command, of, order)),
            StartupAction::Mail(MailMessage::Aoe(data)) => {
                mailbox.others.push(message(command, "AoE", data, place(order, Section::AoE)));
            }
            StartupAction::Mail(MailMessage::Voe(data)) => {
                mailbox.others.push(message(command, "VoE", data, place(order, Section::VoE)));
            }
            StartupAction::FileRead(FileRead { name, password, .. }) => {
                let request = FoeMessage::Read { password: *password, name: name.as_bytes() };
                mailbox.others.push(message(command, "FoE", &foe(&request), place(order, Section::FoE)));
            }
            StartupAction::FileWrite(of) => {
                let boot = mailbox.bootstrap.map(|(send, _)| send);
                let send = match command.transition {
                    Transition::Ib | Transition::Bi => boot.or(mailbox.send),
                    _ => mailbox.send,
                };
                let size = send.map_or(SMALL_MAILBOX, |send| send.length.into());
                let place = place(order, Section::FoE);
                let messages = file(of, FoeMessage::max_data(size)).into_iter();
                mailbox.others.extend(messages.map(|data| message(command, "FoE", &data, place)));
            }
            StartupAction::Ip(of) => mailbox.eoe.push(settings(command, of, order)),
            _ => {}
        }
    }
}

fn coe(command: &StartupCommand, order: &Order, ccs: u8) -> CoeCommand {
    CoeCommand {
        place: place(order, Section::CoE),
        transitions: vec![transition(command.transition)],
        comment: command.comment.clone().unwrap_or_default(),
        timeout_ms: limit(command),
        ccs,
        complete_access: false,
        index: 0,
        sub_index: 0,
        data: Vec::new(),
        disabled: false,
    }
}

fn limit(command: &StartupCommand) -> u32 {
    command.limit.and_then(ms).unwrap_or_default()
}

fn download(command: &StartupCommand, of: &SdoDownload, order: &Order) -> CoeCommand {
    CoeCommand {
        complete_access: of.complete_access,
        index: of.index,
        sub_index: of.sub_index,
        data: of.data.clone(),
        ..coe(command, order, DOWNLOAD)
    }
}

fn upload(command: &StartupCommand, of: &SdoUpload, order: &Order) -> CoeCommand {
    CoeCommand {
        complete_access: of.complete_access,
        index: of.index,
        sub_index: of.sub_index,
        data: of.expected.clone().unwrap_or_default(),
        ..coe(command, order, UPLOAD)
    }
}

fn idn(command: &StartupCommand, of: &IdnWrite, order: &Order) -> SoeCommand {
    SoeCommand {
        place: place(order, Section::SoE),
        transitions: vec![transition(command.transition)],
        comment: command.comment.clone().unwrap_or_default(),
        timeout_ms: limit(command),
        op_code: SOE_WRITE,
        drive: of.drive,
        idn: of.idn.0,
        elements: SOE_VALUE,
        attribute: 0,
        data: of.data.clone(),
        disabled: false,
    }
}

fn idn_read(command: &StartupCommand, of: &IdnRead, order: &Order) -> SoeCommand {
    let written = idn(command, &IdnWrite::new(of.drive, of.idn, of.expected.clone().unwrap_or_default()), order);
    SoeCommand { op_code: SOE_READ, elements: of.elements.0, ..written }
}

fn message(command: &StartupCommand, protocol: &'static str, data: &[u8], place: Place) -> RawMailCommand {
    RawMailCommand {
        place,
        protocol,
        transitions: vec![transition(command.transition)],
        comment: command.comment.clone().unwrap_or_default(),
        timeout_ms: limit(command),
        data: data.to_vec(),
        disabled: false,
    }
}

/// A request and the packets of a file; one that is not full ends it.
fn file(of: &FileWrite, full: usize) -> Vec<Vec<u8>> {
    let full = full.max(1);
    let request = FoeMessage::Write { password: of.password, name: of.name.as_bytes() };
    let end: Option<&[u8]> = of.data.len().is_multiple_of(full).then_some(&[]);
    let packets = of.data.chunks(full).chain(end);
    let packets = (1..).zip(packets).map(|(packet, data)| foe(&FoeMessage::Data { packet, data }));
    core::iter::once(foe(&request)).chain(packets).collect()
}

/// The bytes of a message.
fn foe(message: &FoeMessage<'_>) -> Vec<u8> {
    let data = match message {
        FoeMessage::Read { name, .. } | FoeMessage::Write { name, .. } => name.len(),
        FoeMessage::Data { data, .. } => data.len(),
        _ => 0,
    };
    let mut bytes = vec![0; FoeMessage::OVERHEAD + data];
    let length = message.encode(&mut bytes).unwrap_or_default();
    bytes.truncate(length);
    bytes
}

/// The message as it is sent, which every edition of the format has.
fn settings(command: &StartupCommand, of: &IpSettings, order: &Order) -> EoeCommand {
    EoeCommand {
        place: place(order, Section::EoE),
        transitions: vec![transition(command.transition)],
        comment: command.comment.clone().unwrap_or_default(),
        timeout_ms: limit(command),
        kind: None,
        mac: None,
        ip: None,
        subnet: None,
        gateway: None,
        server: None,
        name: None,
        data: ip::message(of),
        disabled: false,
    }
}
