//! The commands that bring the dictionary of a SubDevice to the PDOs of a file (protocol 6.3), which the engine sends
//! where the dictionary holds others.

use std::collections::BTreeMap;
use std::fmt;
use std::ops::Range;

use ringcat_engine::config::{DeclaredSyncManager, SdoDownload, StartupAction, StartupCommand, Transition};
use ringcat_wire::mailbox::coe::pdo_objects::{ASSIGNMENT_BASE, is_mapping, is_of_pdos};

use crate::export::is_expressible;
use crate::network::model::{Direction, Pdo, Protocol, SubDevice, SyncManager};
use crate::pdo_list::PdoList;

/// Start-up commands with those that assign and map PDOs.
pub(super) struct Placed {
    /// Commands of the file and commands of the tables, in the order of the ENI.
    pub(super) startup: Vec<StartupCommand>,
    /// Where the commands of the tables are.
    of_tables: Range<usize>,
    /// Whether the order is the one in which the engine sends them.
    pub(super) is_exact: bool,
}

/// Puts them after the start-up commands of the file without `after_pdos` and before the others, as the engine sends
/// them. If an ENI cannot have this order, they directly follow the other commands of CoE.
pub(super) fn place(startup: &[StartupCommand], of: &SubDevice) -> Placed {
    let commands = commands(of);
    if commands.is_empty() {
        return Placed { startup: startup.to_vec(), of_tables: 0..0, is_exact: true };
    }
    let with = |list: &[StartupCommand], place: usize| Placed {
        startup: [&list[..place], &commands[..], &list[place..]].concat(),
        of_tables: place..place + commands.len(),
        is_exact: false,
    };
    let mut sorted = startup.to_vec();
    sorted.sort_by_key(StartupCommand::is_after_pdos);
    let before = sorted.iter().position(StartupCommand::is_after_pdos).unwrap_or(sorted.len());
    let exact = with(&sorted, before);
    let is_exact = is_expressible(&exact.startup);
    let last = |list: &[StartupCommand]| list.iter().rposition(is_coe_before).map_or(0, |last| last + 1);
    let others = [with(&sorted, last(&sorted)), with(startup, last(startup))];
    let other = others.into_iter().find(|it| !is_exact && is_expressible(&it.startup));
    let mut placed = other.unwrap_or(Placed { is_exact, ..exact });
    placed.startup.iter_mut().for_each(|command| command.after_pdos = false);
    placed
}

impl Placed {
    /// A SyncManager whose PDOs have another length than its table when SAFEOP is requested, because of commands of the
    /// file: the SubDevice refuses SAFEOP. `None` where a PDO is not known.
    pub(super) fn undone(&self, declared: &[DeclaredSyncManager]) -> Option<Undone> {
        let mut objects: BTreeMap<u16, (PdoList, bool)> = BTreeMap::new();
        let sent = |transition| self.startup.iter().enumerate().filter(move |(_, it)| it.transition == transition);
        // Without commands of tables, commands with `after_pdos` keep this setting.
        let (after, at_ps): (Vec<_>, Vec<_>) = sent(Transition::Ps).partition(|(_, it)| it.is_after_pdos());
        for (place, command) in sent(Transition::Ip).chain(at_ps).chain(after) {
            let StartupAction::Sdo(download) = &command.action else { continue };
            if is_of_pdos(download.index) {
                let before = objects.remove(&download.index).map(|(list, _)| list);
                let list = before.unwrap_or_else(|| described(download.index, declared)).with(download);
                objects.insert(download.index, (list, !self.of_tables.contains(&place)));
            }
        }
        let of_area = |it: &DeclaredSyncManager| -> Option<Undone> {
            let expected = it.area()?.length;
            let object = ASSIGNMENT_BASE + u16::from(it.index);
            let list = |object: u16| objects.get(&object).map(|(list, is_own)| (list.clone(), *is_own));
            let (assigned, mut written) = list(object).unwrap_or_else(|| (described(object, declared), false));
            let mut bits = 0;
            for pdo in assigned.values()? {
                let pdo = u16::try_from(pdo).ok()?;
                let (entries, is_own) = list(pdo).unwrap_or_else(|| (described(pdo, declared), false));
                bits += entries.values()?.into_iter().map(|entry| entry & 0xFF).sum::<u32>();
                written |= is_own;
            }
            let bytes = bits.div_ceil(8);
            (written && bytes != u32::from(expected)).then_some(Undone { sync_manager: it.index, expected, bytes })
        };
        declared.iter().find_map(of_area)
    }
}

/// A SyncManager whose PDOs start-up commands of the file change.
pub(super) struct Undone {
    sync_manager: u8,
    /// Bytes of its table.
    expected: u16,
    /// Bytes of its PDOs.
    bytes: u32,
}

impl fmt::Display for Undone {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Undone { sync_manager, expected, bytes } = self;
        write!(
            f,
            "they leave {bytes} bytes in the PDOs of SyncManager {sync_manager}, its table has {expected}: the \
             SubDevice refuses SAFEOP"
        )
    }
}

/// An assignment or a mapping as the tables have it, with the bits of the entries.
fn described(object: u16, declared: &[DeclaredSyncManager]) -> PdoList {
    if !is_mapping(object) {
        let of = declared.iter().find(|it| ASSIGNMENT_BASE + u16::from(it.index) == object);
        return of.map_or_else(PdoList::default, |it| PdoList::new(it.pdos.iter().map(|it| it.index.into()).collect()));
    }
    let entries = declared.iter().flat_map(|it| &it.pdos).find(|pdo| pdo.index == object);
    let entries = entries.and_then(|pdo| pdo.entries.as_ref());
    entries.map_or_else(PdoList::default, |of| PdoList::new(of.iter().map(|it| it.bit_length.into()).collect()))
}

/// Whether it is a command of CoE that is sent at PS before the PDOs.
fn is_coe_before(command: &StartupCommand) -> bool {
    let is_coe = matches!(command.action, StartupAction::Sdo(_) | StartupAction::Upload(_));
    is_coe && command.transition == Transition::Ps && !command.after_pdos
}

/// The commands that assign and map PDOs; none without CoE.
fn commands(of: &SubDevice) -> Vec<StartupCommand> {
    let Some(mailbox) = of.mailbox.as_ref().filter(|mailbox| mailbox.protocols.contains(&Protocol::CoE)) else {
        return Vec::new();
    };
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
