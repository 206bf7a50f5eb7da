//! The commands that bring the dictionary of a SubDevice to the PDOs of a file (protocol 6.3), which the engine sends
//! where the dictionary holds others.

use ringcat_engine::config::{SdoDownload, StartupAction, StartupCommand, Transition};
use ringcat_wire::mailbox::coe::pdo_objects::{ASSIGNMENT_BASE, is_of_pdos};

use crate::export::is_expressible;
use crate::network::model::{Direction, Pdo, Protocol, SubDevice, SyncManager};

/// Puts them after the start-up commands of the file without `after_pdos` and before the others, as the engine sends
/// them, unless the file has such commands itself. If an ENI cannot have this order, they directly follow the other
/// commands of CoE, and the result is false.
pub(super) fn place(startup: &mut Vec<StartupCommand>, of: &SubDevice) -> bool {
    let commands = commands(startup, of);
    if commands.is_empty() {
        return true;
    }
    let with = |list: &[StartupCommand], place: usize| [&list[..place], &commands[..], &list[place..]].concat();
    let mut sorted = startup.clone();
    sorted.sort_by_key(StartupCommand::is_after_pdos);
    let before = sorted.iter().position(StartupCommand::is_after_pdos).unwrap_or(sorted.len());
    let exact = with(&sorted, before);
    let is_exact = is_expressible(&exact);
    let last = |list: &[StartupCommand]| list.iter().rposition(is_coe_before).map_or(0, |last| last + 1);
    let others = [with(&sorted[..], last(&sorted)), with(startup, last(startup))];
    *startup = others.into_iter().find(|list| !is_exact && is_expressible(list)).unwrap_or(exact);
    startup.iter_mut().for_each(|command| command.after_pdos = false);
    is_exact
}

/// Whether it is a command of CoE that is sent at PS before the PDOs.
fn is_coe_before(command: &StartupCommand) -> bool {
    let is_coe = matches!(command.action, StartupAction::Sdo(_) | StartupAction::Upload(_));
    is_coe && command.transition == Transition::Ps && !command.after_pdos
}

/// The commands that assign and map PDOs; none without CoE, and none if start-up commands write these objects.
fn commands(startup: &[StartupCommand], of: &SubDevice) -> Vec<StartupCommand> {
    let Some(mailbox) = of.mailbox.as_ref().filter(|mailbox| mailbox.protocols.contains(&Protocol::CoE)) else {
        return Vec::new();
    };
    let is_own = |command: &StartupCommand| match &command.action {
        StartupAction::Sdo(download) => is_of_pdos(download.index),
        _ => false,
    };
    if startup.iter().any(is_own) {
        return Vec::new();
    }
    // The mapping of an assigned PDO cannot be changed.
    if !mailbox.pdo_assign {
        return Vec::new();
    }
    let assigned: Vec<(u16, &SyncManager)> = of
        .sync_manager
        .iter()
        .filter(|it| !it.pdo.is_empty() || it.length.is_none())
        .map(|it| (ASSIGNMENT_BASE + u16::from(it.number), it))
        .collect();
    let clear = |(object, _): &(u16, &SyncManager)| download(*object, 0, [0], format!("clear sm pdos ({object:#06x})"));
    let mut commands: Vec<StartupCommand> = assigned.iter().map(clear).collect();
    // No PDO is assigned any more, so one may pass from a SyncManager to another. Other tools map inputs first, too.
    for direction in [Direction::Inputs, Direction::Outputs].into_iter().filter(|_| mailbox.pdo_config) {
        let own = assigned.iter().filter(|(_, it)| it.direction == direction);
        own.flat_map(|(_, it)| &it.pdo).filter(|pdo| !pdo.fixed).for_each(|pdo| map(pdo, &mut commands));
    }
    for (object, it) in assigned {
        for (sub, pdo) in (1..=u8::MAX).zip(&it.pdo) {
            let comment = format!("assign pdo {:#06x}", pdo.index);
            commands.push(download(object, sub, pdo.index.to_le_bytes(), comment));
        }
        let count = u8::try_from(it.pdo.len()).unwrap_or(u8::MAX);
        commands.push(download(object, 0, [count], format!("set count of sm pdos ({object:#06x})")));
    }
    commands
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
