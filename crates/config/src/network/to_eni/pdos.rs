//! The commands that bring the dictionary of a SubDevice to the PDOs of a file (protocol 6.3), which the engine sends
//! where the dictionary holds others.

use ringcat_engine::config::{SdoDownload, StartupAction, StartupCommand, Transition};

use crate::network::model::{Pdo, Protocol, SubDevice};

/// PDO assignment of SyncManager n.
const ASSIGNMENT: u16 = 0x1C10;

/// Puts them before the start-up commands of the file, unless these have some of their own.
pub(super) fn prepend(startup: &mut Vec<StartupCommand>, of: &SubDevice) {
    let Some(mailbox) = of.mailbox.as_ref().filter(|mailbox| mailbox.protocols.contains(&Protocol::CoE)) else {
        return;
    };
    let is_own = |command: &StartupCommand| match &command.action {
        StartupAction::Sdo(download) => {
            matches!(download.index, 0x1600..=0x17FF | 0x1A00..=0x1BFF | 0x1C10..=0x1C2F)
        }
        _ => false,
    };
    if startup.iter().any(is_own) {
        return;
    }
    let mut commands = Vec::new();
    for it in of.sync_manager.iter().filter(|it| !it.pdo.is_empty()) {
        let object = ASSIGNMENT + u16::from(it.number);
        if mailbox.pdo_assign {
            commands.push(download(object, 0, [0], format!("clear sm pdos ({object:#06x})")));
        }
        // The mapping of an assigned PDO cannot be changed.
        if mailbox.pdo_assign && mailbox.pdo_config {
            it.pdo.iter().for_each(|pdo| map(pdo, &mut commands));
        }
        if mailbox.pdo_assign {
            for (sub, pdo) in (1..=u8::MAX).zip(&it.pdo) {
                let comment = format!("assign pdo {:#06x}", pdo.index);
                commands.push(download(object, sub, pdo.index.to_le_bytes(), comment));
            }
            let count = u8::try_from(it.pdo.len()).unwrap_or(u8::MAX);
            commands.push(download(object, 0, [count], format!("set count of sm pdos ({object:#06x})")));
        }
    }
    startup.splice(0..0, commands);
}

fn map(pdo: &Pdo, commands: &mut Vec<StartupCommand>) {
    let Some(entries) = &pdo.entries else { return };
    commands.push(download(pdo.index, 0, [0], format!("clear pdo {:#06x} entries", pdo.index)));
    for (sub, entry) in (1..=u8::MAX).zip(entries) {
        let value = u32::from(entry.index) << 16 | u32::from(entry.sub) << 8 | u32::from(entry.bits);
        let comment = format!("map {:#06x}:{:02x}", entry.index, entry.sub);
        commands.push(download(pdo.index, sub, value.to_le_bytes(), comment));
    }
    let count = u8::try_from(entries.len()).unwrap_or(u8::MAX);
    commands.push(download(pdo.index, 0, [count], format!("set count of pdo {:#06x} entries", pdo.index)));
}

fn download(index: u16, sub: u8, data: impl Into<Vec<u8>>, comment: String) -> StartupCommand {
    let action = StartupAction::Sdo(SdoDownload::new(index, sub, data));
    StartupCommand::new(Transition::Ps, action).with_comment(comment)
}
