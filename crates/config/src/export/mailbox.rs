//! `Mailbox` of a SubDevice: buffers, protocols, commands.

use ringcat_engine::config::{DeclaredSyncManager, SubDeviceConfig, SyncManagerRole};

use super::details::SubDeviceDetails;
use super::mailbox_commands;
use super::order::{Order, Section, section};
use crate::configuration::SubDeviceFacts;
use crate::eni::{Mailbox, MailboxBuffer, Place};

pub(super) fn mailbox(
    config: &SubDeviceConfig,
    facts: &SubDeviceFacts,
    details: &SubDeviceDetails,
    order: &Order,
) -> Option<Mailbox> {
    let declared = config.declared.as_deref().unwrap_or_default();
    let of = |role| declared.iter().find(|it| it.role == role && it.register.length > 0).map(buffer);
    let bootstrap = config.declared_bootstrap.as_ref().map(|[send, receive]| (buffer(send), buffer(receive)));
    let mut mailbox = Mailbox {
        send: of(SyncManagerRole::MailboxOut),
        receive: of(SyncManagerRole::MailboxIn),
        bootstrap,
        protocols: details.protocols.clone(),
        net_id: facts.net_id,
        ..Mailbox::default()
    };
    mailbox_commands::add(&config.startup, order, &mut mailbox);
    for command in &config.startup {
        let name = match section(&command.action) {
            Some(Section::CoE) => "CoE",
            Some(Section::SoE) => "SoE",
            Some(Section::EoE) => "EoE",
            Some(Section::AoE) => "AoE",
            Some(Section::FoE) => "FoE",
            Some(Section::VoE) => "VoE",
            Some(Section::Registers) | None => continue,
        };
        if !mailbox.protocols.iter().any(|protocol| protocol == name) {
            mailbox.protocols.push(name.to_owned());
        }
    }
    (mailbox != Mailbox::default()).then_some(mailbox)
}

const fn buffer(of: &DeclaredSyncManager) -> MailboxBuffer {
    MailboxBuffer { place: Place { line: 0, column: 0 }, start: of.register.start, length: of.register.length }
}
