//! SDO downloads of PDO assignment and mapping, where the dictionary of a SubDevice holds others (protocol 5.2, 6.3).
//!
//! Per SyncManager: subindex 0 of the assignment is set to 0; for each changed PDO, subindex 0 of the mapping is set to
//! 0, then its entries and their number are written; then the entries of the assignment and their number are written.

use alloc::vec::Vec;

use ringcat_wire::mailbox::coe::pdo_objects::ASSIGNMENT_BASE;
use ringcat_wire::sii::CoeDetails;

use crate::config::{PdoAssignment, PdoEntry, PdoMapping, SdoDownload};
use crate::info::{PdoInfo, SubDeviceInfo};

/// The PDOs of a SyncManager as they are to be in the dictionary of the SubDevice.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct PdoPlan {
    /// The PDOs with their entries.
    pub wanted: PdoAssignment,
    /// What the SubDevice permits; without any details it may permit all.
    pub details: CoeDetails,
    /// PDOs that are declared as fixed: their mapping is not written.
    pub fixed: Vec<u16>,
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
    pub(super) fn of(info: &SubDeviceInfo, sync_manager: u8) -> HeldPdos {
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

    /// Whether the mapping of this PDO may be written.
    pub(super) fn can_map_pdo(&self, pdo: u16) -> bool {
        self.can_map() && !self.fixed.contains(&pdo)
    }

    pub(super) fn is_assigned_in(&self, held: &HeldPdos) -> bool {
        let wanted = self.wanted.pdos.iter().map(|pdo| pdo.index);
        held.assigned.as_ref().is_some_and(|assigned| wanted.eq(assigned.iter().copied()))
    }

    /// PDOs that are mapped in another way.
    pub(super) fn changed<'a>(&'a self, held: &'a HeldPdos) -> impl Iterator<Item = &'a PdoMapping> {
        self.wanted.pdos.iter().filter(|pdo| !held.mapped.contains(pdo))
    }

    /// The downloads that bring a dictionary from what it holds to what is planned, as far as the SubDevice permits.
    pub(crate) fn downloads(&self, held: &HeldPdos) -> Vec<SdoDownload> {
        let changed: Vec<&PdoMapping> = self.changed(held).filter(|pdo| self.can_map_pdo(pdo.index)).collect();
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
