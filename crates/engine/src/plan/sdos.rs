//! SDO downloads of PDO assignment and mapping, where the dictionary of a SubDevice holds others (protocol 5.2, 6.3).
//!
//! Per SyncManager: subindex 0 of the assignment is set to 0; for each changed PDO, subindex 0 of the mapping is set to
//! 0, then its entries and their number are written; then the entries of the assignment and their number are written.

use alloc::vec::Vec;

use ringcat_wire::sii::CoeDetails;

use super::areas::ASSIGNMENT_BASE;
use super::error::PlanWarning;
use super::subdevice::{AreaPlan, MappedPdo};
use crate::config::{PdoAssignment, PdoEntry, PdoMapping, SdoDownload, StartupAction, SubDeviceConfig, is_of_pdos};
use crate::info::{PdoInfo, SubDeviceInfo};

/// The PDOs of a SyncManager as they are to be in the dictionary of the SubDevice.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct PdoPlan {
    /// The PDOs with their entries.
    pub wanted: PdoAssignment,
    /// What the SubDevice permits; without any details it may permit all.
    pub details: CoeDetails,
    /// The downloads, if the dictionary holds what is known of it.
    pub sdos: Vec<SdoDownload>,
}

/// What the dictionary of a SubDevice holds for a SyncManager.
#[derive(Clone, Debug, Default)]
pub(crate) struct HeldPdos {
    /// The assigned PDOs; `None`: unknown.
    pub assigned: Option<Vec<u16>>,
    /// The mapping of each known PDO.
    pub mapped: Vec<PdoMapping>,
}

impl HeldPdos {
    /// What is known of a SubDevice.
    fn of(info: &SubDeviceInfo, sync_manager: u8) -> HeldPdos {
        HeldPdos {
            assigned: Some(info.assigned_pdos(sync_manager).map(|pdo| pdo.index).collect()),
            mapped: info.pdos.iter().map(mapping_of).collect(),
        }
    }

    /// Whether the mapping of a PDO is known.
    pub fn has_mapping(&self, pdo: u16) -> bool {
        self.mapped.iter().any(|held| held.index == pdo)
    }
}

fn mapping_of(pdo: &PdoInfo) -> PdoMapping {
    let entries = pdo.entries.iter().map(|entry| PdoEntry::new(entry.index, entry.sub_index, entry.bit_length));
    PdoMapping::of(pdo.index, entries.collect::<Vec<_>>())
}

impl PdoPlan {
    /// Object of the assignment.
    fn object(&self) -> u16 {
        ASSIGNMENT_BASE + u16::from(self.wanted.sync_manager)
    }

    /// An SII without CoE details contains no information about them.
    pub(crate) fn can_assign(&self) -> bool {
        self.details.0 == 0 || self.details.pdo_assign()
    }

    /// The same for the mapping.
    pub(crate) fn can_map(&self) -> bool {
        self.details.0 == 0 || self.details.pdo_configuration()
    }

    fn is_assigned_in(&self, held: &HeldPdos) -> bool {
        let wanted = self.wanted.pdos.iter().map(|pdo| pdo.index);
        held.assigned.as_ref().is_some_and(|assigned| wanted.eq(assigned.iter().copied()))
    }

    /// PDOs that are mapped in another way.
    fn changed<'a>(&'a self, held: &'a HeldPdos) -> impl Iterator<Item = &'a PdoMapping> {
        self.wanted.pdos.iter().filter(|pdo| !held.mapped.contains(pdo))
    }

    /// The downloads that bring a dictionary from what it holds to what is wanted, as far as the SubDevice permits.
    pub(crate) fn downloads(&self, held: &HeldPdos) -> Vec<SdoDownload> {
        let changed: Vec<&PdoMapping> = self.changed(held).filter(|_| self.can_map()).collect();
        // The mapping of an assigned PDO cannot be changed.
        let is_assigned = self.can_assign() && (!self.is_assigned_in(held) || !changed.is_empty());
        let object = self.object();
        let mut sdos = Vec::new();
        if is_assigned {
            sdos.push(download(object, 0, [0]));
        }
        changed.iter().for_each(|pdo| map(pdo, &mut sdos));
        if is_assigned {
            for (sub_index, pdo) in (1..=u8::MAX).zip(&self.wanted.pdos) {
                sdos.push(download(object, sub_index, pdo.index.to_le_bytes()));
            }
            sdos.push(download(object, 0, [self.wanted.pdos.len() as u8]));
        }
        sdos
    }
}

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
        let is_declared = config.pdos.iter().flatten().any(|assignment| assignment.sync_manager == sync_manager);
        // Without a declaration those of the SubDevice stay, whatever they are: the SII describes none, or start-up
        // commands write them.
        let is_described = info.pdo_source.is_of_dictionary() || info.assigned_pdos(sync_manager).next().is_some();
        if !is_declared && (!is_described || writes_pdos(config)) {
            continue;
        }
        let wanted = PdoAssignment::new(sync_manager, area.direction, area.pdos.iter().map(wanted).collect());
        let mut plan = PdoPlan { wanted, details: info.coe, sdos: Vec::new() };
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
        StartupAction::Upload(_) | StartupAction::Idn(_) | StartupAction::Ip(_) | StartupAction::Register(_) => false,
    })
}

/// What cannot be written: the SubDevice decides whether it accepts it nevertheless.
fn warn(plan: &PdoPlan, held: &HeldPdos, has_dictionary: bool, warnings: &mut Vec<PlanWarning>) {
    let (sync_manager, is_assigned) = (plan.wanted.sync_manager, plan.is_assigned_in(held));
    let mut changed = plan.changed(held);
    if !has_dictionary {
        if !is_assigned || changed.next().is_some() {
            warnings.push(PlanWarning::NoCoe { sync_manager });
        }
        return;
    }
    if !is_assigned && !plan.can_assign() {
        warnings.push(PlanWarning::FixedAssignment { sync_manager });
    }
    if !plan.can_map() {
        warnings.extend(changed.map(|pdo| PlanWarning::FixedMapping { pdo: pdo.index }));
    }
}

fn map(pdo: &PdoMapping, sdos: &mut Vec<SdoDownload>) {
    let entries = pdo.entries.as_deref().unwrap_or_default();
    sdos.push(download(pdo.index, 0, [0]));
    for (sub_index, entry) in (1..=u8::MAX).zip(entries) {
        let object = u32::from(entry.index) << 16 | u32::from(entry.sub_index) << 8 | u32::from(entry.bit_length);
        sdos.push(download(pdo.index, sub_index, object.to_le_bytes()));
    }
    sdos.push(download(pdo.index, 0, [entries.len() as u8]));
}

fn download(index: u16, sub_index: u8, data: impl Into<Vec<u8>>) -> SdoDownload {
    SdoDownload { index, sub_index, complete_access: false, data: data.into() }
}
