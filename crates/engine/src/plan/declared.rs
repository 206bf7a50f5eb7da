//! SyncManagers as a configuration file declares them, which override the SII (protocol 8.1).

use alloc::vec::Vec;

use ringcat_wire::register::SyncManagerDirection;

use super::areas::place;
use super::error::PlanProblem;
use super::subdevice::{AreaPlan, MappedPdo, SmPlan};
use crate::config::{DeclaredArea, DeclaredSyncManager, SyncManagerRole};
use crate::info::{Direction, SubDeviceInfo};
use crate::order::InOrder;

/// Mailboxes (first the mailbox that the MainDevice writes), and process data by SyncManager number.
pub(super) fn areas(
    declared: &[DeclaredSyncManager],
    info: &SubDeviceInfo,
) -> Result<(Vec<SmPlan>, Vec<AreaPlan>), PlanProblem> {
    let available = info.controller.sync_manager_count;
    let mut sorted: Vec<&DeclaredSyncManager> = declared.iter().collect();
    sorted.put_in_order_by_key(|sm| sm.index);
    if let Some(pair) = sorted.windows(2).find(|pair| pair[0].index == pair[1].index) {
        return Err(PlanProblem::DeclaredTwice { sync_manager: pair[0].index });
    }
    if let Some(sm) = sorted.iter().find(|sm| sm.index >= available) {
        return Err(PlanProblem::NoSuchSyncManager { sync_manager: sm.index, available });
    }
    let of = |role| sorted.iter().copied().filter(move |sm| sm.role == role);
    let (out, inward) = (of(SyncManagerRole::MailboxOut), of(SyncManagerRole::MailboxIn));
    let counts = (out.clone().count(), inward.clone().count());
    if !matches!(counts, (0, 0) | (1, 1)) {
        return Err(PlanProblem::DeclaredMailboxes { out: counts.0, inward: counts.1 });
    }
    let mut process_data = Vec::new();
    for sm in &sorted {
        check_control(sm)?;
        process_data.extend(area(sm, info)?);
    }
    Ok((managers(out.chain(inward)).collect(), process_data))
}

/// SyncManagers as declared.
pub(super) fn managers<'d>(
    declared: impl IntoIterator<Item = &'d DeclaredSyncManager>,
) -> impl Iterator<Item = SmPlan> {
    declared.into_iter().map(|sm| SmPlan { index: sm.index, register: sm.register })
}

fn area(sm: &DeclaredSyncManager, info: &SubDeviceInfo) -> Result<Option<AreaPlan>, PlanProblem> {
    let Some(DeclaredArea { sync_manager, direction, length }) = sm.area() else { return Ok(None) };
    let mut bit = 0;
    let mut pdos = Vec::with_capacity(sm.pdos.len());
    for pdo in &sm.pdos {
        let entries = match (&pdo.entries, info.pdo(pdo.index)) {
            (Some(entries), _) => place(entries.iter().map(|e| (e.index, e.sub_index, e.bit_length)), &mut bit),
            (None, Some(known)) => place(known.entries.iter().map(|e| (e.index, e.sub_index, e.bit_length)), &mut bit),
            (None, None) => return Err(PlanProblem::UnknownPdo { sync_manager, pdo: pdo.index }),
        };
        pdos.push(MappedPdo { index: pdo.index, entries });
    }
    let (expected, got) = (u64::from(bit), 8 * u64::from(length));
    // A disabled SyncManager has no place in the image, so its entries have none.
    if length == 0 {
        pdos.clear();
    } else if expected > got {
        return Err(PlanProblem::DeclaredTooShort { sync_manager, expected, got });
    }
    let DeclaredSyncManager { register, op_only, .. } = *sm;
    Ok(Some(AreaPlan { sync_manager, direction, physical: register.start, length, register, op_only, pdos }))
}

/// Refuses a control byte with the wrong direction: no data would be exchanged, without any error.
fn check_control(sm: &DeclaredSyncManager) -> Result<(), PlanProblem> {
    let expected = match sm.role {
        SyncManagerRole::MailboxOut | SyncManagerRole::Outputs => Direction::Outputs,
        SyncManagerRole::MailboxIn | SyncManagerRole::Inputs => Direction::Inputs,
    };
    let got = match sm.register.control.direction {
        SyncManagerDirection::Write => Direction::Outputs,
        SyncManagerDirection::Read => Direction::Inputs,
        SyncManagerDirection::Reserved(_) => return Ok(()),
    };
    if expected == got || sm.register.length == 0 {
        return Ok(());
    }
    Err(PlanProblem::DeclaredControl { sync_manager: sm.index, expected, got })
}
