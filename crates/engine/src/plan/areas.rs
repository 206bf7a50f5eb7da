//! The process data area of each SyncManager: its PDOs, the place of each entry, its length (protocol 3.11, 4.2 to
//! 4.5).

use alloc::collections::BTreeSet;
use alloc::vec::Vec;

use ringcat_wire::mailbox::coe::pdo_objects::ASSIGNMENT_BASE;
use ringcat_wire::register::{SyncManager, SyncManagerControl, SyncManagerDirection, SyncManagerMode};
use ringcat_wire::sii::{SiiSyncManager, SyncManagerKind};

use super::error::PlanProblem;
use super::subdevice::{AreaPlan, MappedEntry, MappedPdo, SmPlan};
use crate::config::{PdoAssignment, PdoMapping, SubDeviceConfig, Watchdog};
use crate::info::{Direction, PdoInfo, SubDeviceInfo};
use crate::order::InOrder;

/// Largest number of PDOs in an assignment, and of entries in a PDO: subindices 1 to 254.
const MAX_OBJECT_ENTRIES: usize = 254;

/// Plans all process data SyncManagers, in the order of their numbers.
pub(super) fn areas(
    config: &SubDeviceConfig,
    info: &SubDeviceInfo,
    mailbox: &[SmPlan],
) -> Result<Vec<AreaPlan>, PlanProblem> {
    let mut areas = Vec::new();
    for index in numbers(config, info, mailbox) {
        if mailbox.iter().any(|sm| sm.index == index) {
            return Err(PlanProblem::MailboxSyncManager { sync_manager: index });
        }
        areas.extend(area(config, info, index)?);
    }
    pdo_twice(&areas)?;
    Ok(areas)
}

/// Numbers of the SyncManagers with process data, from the SII or the declaration.
fn numbers(config: &SubDeviceConfig, info: &SubDeviceInfo, mailbox: &[SmPlan]) -> BTreeSet<u8> {
    let declared = config.sync_managers.iter().map(|sm| sm.index);
    let assigned = config.pdos.iter().flatten().map(|assignment| assignment.sync_manager);
    // An SII that assigns a PDO to a mailbox is faulty; the scan gave a warning.
    let of_mailbox = |index: &u8| mailbox.iter().any(|sm| sm.index == *index);
    let by_pdo = info.pdos.iter().filter_map(|pdo| pdo.sync_manager).filter(move |index| !of_mailbox(index));
    let by_kind = (0..).zip(&info.sync_managers).filter(|(_, sm)| kind_direction(sm).is_some()).map(|(index, _)| index);
    let described = by_pdo.chain(by_kind);
    // An SII that assigns a PDO to a missing SyncManager is faulty too; such a declaration is an error.
    let exists = |index: &u8| usize::from(*index) < info.sync_managers.len();
    declared.chain(assigned).chain(described.filter(exists)).collect()
}

fn kind_direction(sm: &SiiSyncManager) -> Option<Direction> {
    match sm.kind {
        SyncManagerKind::Outputs => Some(Direction::Outputs),
        SyncManagerKind::Inputs => Some(Direction::Inputs),
        SyncManagerKind::Unused
        | SyncManagerKind::MailboxOut
        | SyncManagerKind::MailboxIn
        | SyncManagerKind::Other(_) => None,
    }
}

/// Plans one SyncManager; `None` for a virtual SyncManager, which has no hardware.
fn area(config: &SubDeviceConfig, info: &SubDeviceInfo, index: u8) -> Result<Option<AreaPlan>, PlanProblem> {
    let available = info.controller.sync_manager_count;
    if index >= available {
        return Err(PlanProblem::NoSuchSyncManager { sync_manager: index, available });
    }
    let unknown = PlanProblem::UnknownSyncManager { sync_manager: index, described: info.sync_managers.len() };
    let sii = info.sync_managers.get(usize::from(index)).ok_or(unknown)?;
    if sii.enable & SiiSyncManager::VIRTUAL != 0 {
        return Ok(None);
    }
    let assignment = config.pdos.iter().flatten().find(|assignment| assignment.sync_manager == index);
    let direction = direction(config, info, index, sii, assignment)?;
    let pdos = match assignment {
        Some(assignment) => declared_pdos(info, assignment, direction)?,
        None => sii_pdos(info.assigned_pdos(index).filter(|pdo| pdo.direction == direction)),
    };
    let bits: u64 = pdos.iter().flat_map(|pdo| &pdo.entries).map(|entry| u64::from(entry.bit_length)).sum();
    // The default length of the SII does not apply if the dictionary was read and assigns no PDO.
    let is_known = assignment.is_some() || !pdos.is_empty() || info.pdo_source.is_of_dictionary();
    let length = if is_known {
        let too_long = PlanProblem::TooLong { sync_manager: index, bits };
        u16::try_from(bits.div_ceil(8)).map_err(|_| too_long)?
    } else if sii.is_enabled() {
        sii.length
    } else {
        0
    };
    let override_ = config.sync_managers.iter().find(|declared| declared.index == index);
    let mut register = sync_manager(sii.start, length, sii.control);
    // Process data has three buffers, whatever the mode in the control byte.
    register.control.mode = SyncManagerMode::Buffered;
    register.control.direction = match direction {
        Direction::Outputs => SyncManagerDirection::Write,
        Direction::Inputs => SyncManagerDirection::Read,
    };
    match override_.map_or(Watchdog::Default, |declared| declared.watchdog) {
        Watchdog::Default => {}
        Watchdog::On => register.control.watchdog = true,
        Watchdog::Off => register.control.watchdog = false,
    }
    Ok(Some(AreaPlan {
        sync_manager: index,
        direction,
        physical: sii.start,
        length,
        register,
        op_only: sii.enable & SiiSyncManager::OP_ONLY != 0,
        pdos,
    }))
}

/// Direction of a SyncManager, in order of precedence: from declarations, the type in the SII, the PDOs, the control
/// byte.
fn direction(
    config: &SubDeviceConfig,
    info: &SubDeviceInfo,
    index: u8,
    sii: &SiiSyncManager,
    assignment: Option<&PdoAssignment>,
) -> Result<Direction, PlanProblem> {
    let declared = config.sync_managers.iter().find(|declared| declared.index == index);
    let directions = (declared.map(|declared| declared.direction), assignment.map(|a| a.direction));
    if let (Some(expected), Some(got)) = directions
        && expected != got
    {
        return Err(PlanProblem::Directions { sync_manager: index, expected, got });
    }
    let by_pdo = || info.assigned_pdos(index).map(|pdo| pdo.direction).next();
    let by_control = || if sii.control & 0x0C == 0x04 { Direction::Outputs } else { Direction::Inputs };
    let described = || kind_direction(sii).or_else(by_pdo).unwrap_or_else(by_control);
    Ok(directions.0.or(directions.1).unwrap_or_else(described))
}

/// PDOs of the SII.
fn sii_pdos<'i>(pdos: impl Iterator<Item = &'i PdoInfo>) -> Vec<MappedPdo> {
    let mut bit = 0;
    pdos.map(|pdo| MappedPdo {
        index: pdo.index,
        entries: place(pdo.entries.iter().map(|e| (e.index, e.sub_index, e.bit_length)), &mut bit),
    })
    .collect()
}

/// PDOs as the application declares them.
fn declared_pdos(
    info: &SubDeviceInfo,
    assignment: &PdoAssignment,
    expected: Direction,
) -> Result<Vec<MappedPdo>, PlanProblem> {
    let sync_manager = assignment.sync_manager;
    limit(ASSIGNMENT_BASE + u16::from(sync_manager), assignment.pdos.len())?;
    let mut bit = 0;
    let mut mapped = Vec::with_capacity(assignment.pdos.len());
    for PdoMapping { index, entries, .. } in &assignment.pdos {
        let described = info.pdo(*index);
        if let Some(got) = described.map(|pdo| pdo.direction).filter(|got| *got != expected) {
            return Err(PlanProblem::PdoDirection { sync_manager, pdo: *index, expected, got });
        }
        let entries = match (entries, described) {
            (Some(entries), _) => {
                limit(*index, entries.len())?;
                place(entries.iter().map(|e| (e.index, e.sub_index, e.bit_length)), &mut bit)
            }
            (None, Some(pdo)) => place(pdo.entries.iter().map(|e| (e.index, e.sub_index, e.bit_length)), &mut bit),
            (None, None) => return Err(PlanProblem::UnknownPdo { sync_manager, pdo: *index }),
        };
        mapped.push(MappedPdo { index: *index, entries });
    }
    Ok(mapped)
}

/// Places of adjacent entries, from bit `bit` on.
pub(super) fn place(entries: impl Iterator<Item = (u16, u8, u8)>, bit: &mut u32) -> Vec<MappedEntry> {
    entries
        .map(|(index, sub_index, bit_length)| {
            let bit_offset = *bit;
            *bit = bit.saturating_add(u32::from(bit_length));
            MappedEntry { index, sub_index, bit_offset, bit_length }
        })
        .collect()
}

fn limit(object: u16, got: usize) -> Result<(), PlanProblem> {
    if got <= MAX_OBJECT_ENTRIES {
        return Ok(());
    }
    Err(PlanProblem::TooMany { object, expected: MAX_OBJECT_ENTRIES, got })
}

/// Refuses a PDO that is assigned twice.
fn pdo_twice(areas: &[AreaPlan]) -> Result<(), PlanProblem> {
    let mut all: Vec<(u16, u8)> =
        areas.iter().flat_map(|area| area.pdos.iter().map(|pdo| (pdo.index, area.sync_manager))).collect();
    all.put_in_order();
    match all.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        Some(pair) => Err(PlanProblem::PdoTwice { pdo: pair[0].0, first: pair[0].1, second: pair[1].1 }),
        None => Ok(()),
    }
}

/// Bytes that a SyncManager occupies: three buffers; one buffer for a mailbox or a single byte.
pub(super) fn occupied(register: &ringcat_wire::register::SyncManager) -> u32 {
    let length = u32::from(register.length);
    match register.control.mode {
        SyncManagerMode::Buffered if length > 1 && register.start >= PROCESS_RAM => 3 * length,
        SyncManagerMode::Buffered | SyncManagerMode::Mailbox | SyncManagerMode::Reserved(_) => length,
    }
}

/// Start of the process RAM; digital outputs and user RAM lie below it and have one buffer.
pub(super) const PROCESS_RAM: u16 = 0x1000;

pub(super) fn sync_manager(start: u16, length: u16, control: u8) -> SyncManager {
    let mut register =
        SyncManager { start, length, control: SyncManagerControl::from_bits(control), ..SyncManager::default() };
    register.activate.enable = length > 0;
    register
}
