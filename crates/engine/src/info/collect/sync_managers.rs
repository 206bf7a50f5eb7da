//! Purpose of each SyncManager, and faults of their description (protocol 4.4, 3.11).

use ringcat_wire::sii::{
    CategoryKind, FmmuUsage, PdoDirection, Pdos, SiiSyncManager, SiiSyncManagers, SyncManagerKind,
};

use super::parts::{Parts, whole, within};
use crate::info::subdevice::SubDeviceInfo;
use crate::info::warning::{InfoWarning, SiiProblem};

const KIND: CategoryKind = CategoryKind::SyncManager;

/// The SyncManagers with their purposes.
pub(super) fn collect(info: &mut SubDeviceInfo, parts: &Parts<'_, '_>) {
    let available = usize::from(info.controller.sync_manager_count);
    let mut beyond = None;
    for category in parts.all(KIND) {
        // Entries after an erased one are erased too; a warning was given.
        let described = SiiSyncManagers::new(category.data).take_while(|manager| !manager.is_erased());
        for (place, manager) in described.enumerate() {
            let at = place * SiiSyncManager::LEN;
            let number = info.sync_managers.len();
            if number == available {
                beyond.get_or_insert((category, at));
            }
            let taken = SiiSyncManager { kind: kind(parts, number, &manager), ..manager };
            check(info, number, &manager, &taken).into_iter().for_each(|problem| {
                info.warnings.push(within(&category, at, problem));
            });
            info.sync_managers.push(taken);
        }
        whole(&category, SiiSyncManager::LEN, &mut info.warnings);
    }
    if let Some((category, at)) = beyond {
        let problem = SiiProblem::SyncManagers { expected: available, got: info.sync_managers.len() };
        info.warnings.push(within(&category, at, problem));
        info.sync_managers.truncate(available);
    }
}

/// Purpose by the type in the SII; without a type by its PDOs (as in SOEM), otherwise by its control byte (as in IgH).
/// A SyncManager that is unused or has no length has no purpose.
fn kind(parts: &Parts<'_, '_>, number: usize, manager: &SiiSyncManager) -> SyncManagerKind {
    match manager.kind {
        SyncManagerKind::MailboxOut
        | SyncManagerKind::MailboxIn
        | SyncManagerKind::Outputs
        | SyncManagerKind::Inputs => return manager.kind,
        SyncManagerKind::Unused | SyncManagerKind::Other(_) => {}
    }
    let has_pdo = |direction: PdoDirection| {
        let mut pdos = parts.all(direction.category()).flat_map(|category| Pdos::new(category.data));
        pdos.any(|pdo| pdo.sync_manager.map(usize::from) == Some(number))
    };
    if has_pdo(PdoDirection::Rx) {
        SyncManagerKind::Outputs
    } else if has_pdo(PdoDirection::Tx) {
        SyncManagerKind::Inputs
    } else if manager.is_enabled() && manager.length > 0 {
        manager.kind_of_control()
    } else {
        SyncManagerKind::Unused
    }
}

/// Fault of a SyncManager.
fn check(info: &SubDeviceInfo, number: usize, manager: &SiiSyncManager, taken: &SiiSyncManager) -> Option<SiiProblem> {
    let sync_manager = u8::try_from(number).unwrap_or(u8::MAX);
    let beyond = number >= usize::from(info.controller.sync_manager_count);
    if beyond {
        return None;
    }
    if manager.kind != taken.kind {
        let (got, taken) = (manager.kind.code(), taken.kind);
        return Some(SiiProblem::NoType { sync_manager, got, taken });
    }
    let is_used = !matches!(manager.kind, SyncManagerKind::Unused | SyncManagerKind::Other(_));
    let wrong = is_used && manager.kind != manager.kind_of_control();
    wrong.then_some(SiiProblem::Control { sync_manager, control: manager.control })
}

/// Detects a truncated image in which every remaining category is valid: SyncManagers or PDOs are missing.
pub(super) fn check_completeness(info: &mut SubDeviceInfo, parts: &Parts<'_, '_>) {
    let exchanges = info.fmmu_usages.iter().any(|usage| matches!(usage, FmmuUsage::Outputs | FmmuUsage::Inputs));
    let needed = exchanges || info.mailbox.is_some() || !info.pdos.is_empty();
    if info.sync_managers.is_empty() && needed && !parts.parts.is_empty() {
        info.warnings.push(InfoWarning { category: Some(KIND), offset: None, problem: SiiProblem::NoSyncManagers });
    }
    if !info.pdos.is_empty() || info.mailbox.is_some() {
        return;
    }
    let is_exchanged = |manager: &SiiSyncManager| {
        matches!(manager.kind, SyncManagerKind::Outputs | SyncManagerKind::Inputs) && manager.is_enabled()
    };
    let number = info.sync_managers.iter().position(is_exchanged).and_then(|number| u8::try_from(number).ok());
    if let Some(sync_manager) = number {
        let problem = SiiProblem::NoPdos { sync_manager };
        info.warnings.push(InfoWarning { category: Some(KIND), offset: None, problem });
    }
}
