//! SDO downloads of PDO assignment and mapping, if they differ from the SII (protocol 5.2, 6.3).
//!
//! Per SyncManager: subindex 0 of the assignment is set to 0; for each changed PDO, subindex 0 of the mapping is set to
//! 0, then its entries and their number are written; then the entries of the assignment and their number are written.

use alloc::vec::Vec;

use super::areas::ASSIGNMENT_BASE;
use super::error::{PlanProblem, PlanWarning};
use super::subdevice::{AreaPlan, MappedPdo};
use crate::config::{SdoDownload, SubDeviceConfig};
use crate::info::SubDeviceInfo;

/// The downloads for all declared assignments that differ from the SII.
pub(super) fn assign_sdos(
    config: &SubDeviceConfig,
    info: &SubDeviceInfo,
    areas: &[AreaPlan],
    warnings: &mut Vec<PlanWarning>,
) -> Result<Vec<SdoDownload>, PlanProblem> {
    let mut sdos = Vec::new();
    for area in areas {
        let declared = config.pdos.iter().flatten().any(|assignment| assignment.sync_manager == area.sync_manager);
        // The assignment that was read may be volatile: another program may have written it, and the next power failure
        // would clear it.
        let read = info.read_online.contains(&area.sync_manager) && info.coe.pdo_assign();
        if !declared && !read {
            continue;
        }
        let remap = |pdo: &&MappedPdo| mapping_differs(info, pdo) || (declared && read && info.coe.pdo_configuration());
        let changed: Vec<_> = area.pdos.iter().filter(remap).collect();
        let reassigned = read || assignment_differs(info, area);
        if !reassigned && changed.is_empty() {
            continue;
        }
        if info.protocols.coe() && info.mailbox.is_some() {
            of_area(info, area, reassigned, &changed, &mut sdos, warnings);
        } else {
            fixed(info, area)?;
        }
    }
    Ok(sdos)
}

fn mapping_differs(info: &SubDeviceInfo, pdo: &MappedPdo) -> bool {
    let Some(described) = info.pdo(pdo.index) else { return true };
    let ours = pdo.entries.iter().map(|entry| (entry.index, entry.sub_index, entry.bit_length));
    let theirs = described.entries.iter().map(|entry| (entry.index, entry.sub_index, entry.bit_length));
    !ours.eq(theirs)
}

fn assignment_differs(info: &SubDeviceInfo, area: &AreaPlan) -> bool {
    let theirs = info.assigned_pdos(area.sync_manager).map(|pdo| pdo.index);
    !area.pdos.iter().map(|pdo| pdo.index).eq(theirs)
}

/// Without CoE, only the number of bits must match; other names of the entries do no harm.
fn fixed(info: &SubDeviceInfo, area: &AreaPlan) -> Result<(), PlanProblem> {
    let described: u64 = info.assigned_pdos(area.sync_manager).map(|pdo| u64::from(pdo.bit_length())).sum();
    let declared: u64 = area.pdos.iter().flat_map(|pdo| &pdo.entries).map(|entry| u64::from(entry.bit_length)).sum();
    // An empty declaration disables the SyncManager; without PDOs in the SII its length is undefined.
    if declared == 0 || described == 0 || described == declared {
        return Ok(());
    }
    Err(PlanProblem::FixedProcessData { sync_manager: area.sync_manager, expected: described, got: declared })
}

fn of_area(
    info: &SubDeviceInfo,
    area: &AreaPlan,
    reassigned: bool,
    changed: &[&MappedPdo],
    sdos: &mut Vec<SdoDownload>,
    warnings: &mut Vec<PlanWarning>,
) {
    // An SII without CoE details contains no information about them.
    let unknown = info.coe.0 == 0;
    let can_assign = unknown || info.coe.pdo_assign();
    let can_map = unknown || info.coe.pdo_configuration();
    let object = ASSIGNMENT_BASE + u16::from(area.sync_manager);
    let map = can_map && !changed.is_empty();
    // The mapping of an assigned PDO cannot be changed.
    let assign = can_assign && (reassigned || map);
    if reassigned && !can_assign {
        warnings.push(PlanWarning::FixedAssignment { sync_manager: area.sync_manager });
    }
    if !can_map {
        warnings.extend(changed.iter().map(|pdo| PlanWarning::FixedMapping { pdo: pdo.index }));
    }
    if assign {
        sdos.push(download(object, 0, [0]));
    }
    if map {
        changed.iter().for_each(|pdo| mapping(pdo, sdos));
    }
    if assign {
        for (sub_index, pdo) in (1..=u8::MAX).zip(&area.pdos) {
            sdos.push(download(object, sub_index, pdo.index.to_le_bytes()));
        }
        sdos.push(download(object, 0, [area.pdos.len() as u8]));
    }
}

fn mapping(pdo: &MappedPdo, sdos: &mut Vec<SdoDownload>) {
    sdos.push(download(pdo.index, 0, [0]));
    for (sub_index, entry) in (1..=u8::MAX).zip(&pdo.entries) {
        let object = u32::from(entry.index) << 16 | u32::from(entry.sub_index) << 8 | u32::from(entry.bit_length);
        sdos.push(download(pdo.index, sub_index, object.to_le_bytes()));
    }
    sdos.push(download(pdo.index, 0, [pdo.entries.len() as u8]));
}

fn download(index: u16, sub_index: u8, data: impl Into<Vec<u8>>) -> SdoDownload {
    SdoDownload { index, sub_index, complete_access: false, data: data.into() }
}
