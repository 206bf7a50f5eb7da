//! The PDOs of each SyncManager that are to be in the dictionary of a SubDevice, and what cannot be written there.

use alloc::vec::Vec;

use ringcat_wire::mailbox::coe::pdo_objects::is_of_pdos;

use super::error::PlanWarning;
use super::sdos::{HeldPdos, PdoPlan};
use super::subdevice::{AreaPlan, MappedPdo};
use crate::config::{PdoAssignment, PdoEntry, PdoMapping, StartupAction, SubDeviceConfig};
use crate::info::SubDeviceInfo;

/// The plans of all areas whose PDOs can be in a dictionary.
pub(super) fn pdo_plans(
    config: &SubDeviceConfig,
    info: &SubDeviceInfo,
    areas: &[AreaPlan],
    warnings: &mut Vec<PlanWarning>,
) -> Vec<PdoPlan> {
    let has_dictionary = info.protocols.coe() && info.mailbox.is_some();
    let mut plans = Vec::new();
    for area in areas {
        let sync_manager = area.sync_manager;
        let declared = config.pdos.iter().flatten().find(|assignment| assignment.sync_manager == sync_manager);
        let is_declared = declared.is_some();
        // Without a declaration those of the SubDevice stay, whatever they are: the SII describes none, or start-up
        // commands write them.
        let is_described = info.pdo_source.is_of_dictionary() || info.assigned_pdos(sync_manager).next().is_some();
        if !is_declared && (!is_described || writes_pdos(config)) {
            continue;
        }
        let wanted = PdoAssignment::new(sync_manager, area.direction, area.pdos.iter().map(wanted).collect());
        let fixed = declared.iter().flat_map(|it| &it.pdos).filter(|pdo| pdo.fixed).map(|pdo| pdo.index).collect();
        let mut plan = PdoPlan { wanted, details: info.coe, fixed, sdos: Vec::new() };
        let held = HeldPdos::of(info, sync_manager);
        if is_declared {
            warn(&plan, &held, has_dictionary, warnings);
        }
        if has_dictionary {
            plan.sdos = if is_declared { plan.downloads(&held) } else { Vec::new() };
            plans.push(plan);
        }
    }
    plans
}

fn wanted(pdo: &MappedPdo) -> PdoMapping {
    let entries = pdo.entries.iter().map(|entry| PdoEntry::new(entry.index, entry.sub_index, entry.bit_length));
    PdoMapping::of(pdo.index, entries.collect::<Vec<_>>())
}

/// Whether start-up commands write assignments or mappings.
fn writes_pdos(config: &SubDeviceConfig) -> bool {
    config.startup.iter().any(|command| match &command.action {
        StartupAction::Sdo(download) => is_of_pdos(download.index),
        StartupAction::Upload(_)
        | StartupAction::Idn(_)
        | StartupAction::IdnRead(_)
        | StartupAction::Mail(_)
        | StartupAction::FileWrite(_)
        | StartupAction::FileRead(_)
        | StartupAction::Ip(_)
        | StartupAction::Register(_) => false,
    })
}

/// What cannot be written: the SubDevice decides whether it accepts it nevertheless.
fn warn(plan: &PdoPlan, held: &HeldPdos, has_dictionary: bool, warnings: &mut Vec<PlanWarning>) {
    let (sync_manager, is_assigned) = (plan.wanted.sync_manager, plan.is_assigned_in(held));
    let changed = || plan.changed(held);
    if !has_dictionary {
        if !is_assigned || changed().next().is_some() {
            warnings.push(PlanWarning::NoCoe { sync_manager });
        }
        return;
    }
    if !is_assigned && !plan.can_assign() {
        warnings.push(PlanWarning::FixedAssignment { sync_manager });
    }
    let kept = changed().filter(|pdo| !plan.can_map_pdo(pdo.index));
    warnings.extend(kept.map(|pdo| PlanWarning::FixedMapping { pdo: pdo.index }));
}
