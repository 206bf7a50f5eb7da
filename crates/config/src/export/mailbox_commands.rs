//! Start-up commands through the mailbox: CoE, SoE, EoE, AoE, VoE.

use ringcat_engine::config::{
    IdnRead, IdnWrite, IpSettings, MailMessage, SdoDownload, SdoUpload, StartupAction, StartupCommand,
};

use super::init_commands::ms;
use super::order::{Order, Section, place};
use super::transitions::transition;
use crate::eni::{CoeCommand, EoeCommand, Mailbox, Place, RawMailCommand, SoeCommand};
use crate::ip;

/// `Ccs`.
const DOWNLOAD: u8 = 1;
const UPLOAD: u8 = 2;
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

fn settings(command: &StartupCommand, of: &IpSettings, order: &Order) -> EoeCommand {
    let address = |address: Option<std::net::Ipv4Addr>| address.map(|address| address.octets().to_vec());
    EoeCommand {
        place: place(order, Section::EoE),
        transitions: vec![transition(command.transition)],
        comment: command.comment.clone().unwrap_or_default(),
        timeout_ms: limit(command),
        kind: Some(ip::SET_IP),
        mac: of.mac.map(|mac| mac.to_vec()),
        ip: address(of.address),
        subnet: address(of.mask),
        gateway: address(of.gateway),
        server: address(of.dns),
        name: of.name.as_ref().map(|name| String::from_utf8_lossy(name).into_owned()),
        data: Vec::new(),
        disabled: false,
    }
}
