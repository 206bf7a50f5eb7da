//! What a network file states of a SubDevice as its EEPROM describes it, for comparisons.

use ringcat_wire::sii::{CoeDetails, MailboxProtocols};

use super::model::{Buffer, Mailbox, Protocol, SubDevice};
use crate::compare::{StatedProperties, StatedSyncManager};

pub(super) fn stated(of: &SubDevice) -> StatedProperties {
    let mailbox = of.mailbox.as_ref();
    let boot = |of: &Mailbox| Some(both(&of.boot_write?, &of.boot_read?));
    let sync_managers =
        of.sync_manager.iter().map(|it| StatedSyncManager { number: it.number, start: it.start, control: it.control });
    StatedProperties {
        device: of.vendor.zip(of.product),
        revision: of.revision,
        mailbox: mailbox.map(|of| both(&of.write, &of.read)),
        boot_mailbox: mailbox.and_then(boot),
        protocols: mailbox.map(protocols),
        coe: mailbox.map(coe),
        sync_managers: sync_managers.collect(),
        ports: of.ports.clone(),
        firmware: of.firmware.clone(),
        modular: false,
    }
}

const fn both(write: &Buffer, read: &Buffer) -> [(u16, u16); 2] {
    [(write.start, write.length), (read.start, read.length)]
}

fn protocols(of: &Mailbox) -> MailboxProtocols {
    let bit = |protocol: &Protocol| match protocol {
        Protocol::AoE => MailboxProtocols::AOE,
        Protocol::EoE => MailboxProtocols::EOE,
        Protocol::CoE => MailboxProtocols::COE,
        Protocol::FoE => MailboxProtocols::FOE,
        Protocol::SoE => MailboxProtocols::SOE,
        Protocol::VoE => MailboxProtocols::VOE,
    };
    MailboxProtocols(of.protocols.iter().map(bit).fold(0, |all, bit| all | bit))
}

fn coe(of: &Mailbox) -> CoeDetails {
    let bits = [
        (of.complete_access, CoeDetails::COMPLETE_ACCESS),
        (of.pdo_assign, CoeDetails::PDO_ASSIGN),
        (of.pdo_config, CoeDetails::PDO_CONFIGURATION),
    ];
    CoeDetails(bits.into_iter().filter(|(is_set, _)| *is_set).fold(0, |all, (_, bit)| all | bit))
}
