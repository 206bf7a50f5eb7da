//! Assignment and mapping of PDOs that a SubDevice with CoE has when SAFEOP is requested (protocol 6.3): as start-up
//! commands and the tables of a network file leave them. Objects that are not written, or that the SubDevice does not
//! permit to write, are as in the SII.

use std::collections::{BTreeMap, BTreeSet};

use ringcat_engine::AreaPlan;
use ringcat_engine::config::{SdoDownload, StartupAction, StartupCommand, SubDeviceConfig, Transition};
use ringcat_engine::info::SubDeviceInfo;
use ringcat_wire::mailbox::coe::pdo_objects::{ASSIGNMENT_BASE, is_mapping, is_of_pdos};

use crate::pdo_list::PdoList;

/// Whether a SubDevice permits to write assignment and mapping. An SII without CoE details contains no information
/// about them.
fn permits(info: &SubDeviceInfo) -> (bool, bool) {
    match info.coe {
        details if details.0 == 0 => (true, true),
        details => (details.pdo_assign(), details.pdo_configuration()),
    }
}

/// Whether start-up commands write an assignment or a mapping.
pub(super) fn writes_pdos(declared: &SubDeviceConfig) -> bool {
    declared.startup.iter().any(|command| download(command).is_some())
}

/// The write of an object of PDOs.
fn download(command: &StartupCommand) -> Option<&SdoDownload> {
    match &command.action {
        StartupAction::Sdo(download) if is_of_pdos(download.index) => Some(download),
        _ => None,
    }
}

/// The objects that were written.
pub(super) struct Written<'a> {
    info: &'a SubDeviceInfo,
    objects: BTreeMap<u16, PdoList>,
    /// Objects that a start-up command wrote last.
    by_commands: BTreeSet<u16>,
    /// Whether a write is not permitted.
    is_refused: bool,
}

impl<'a> Written<'a> {
    /// The objects when SAFEOP is requested. `areas` are planned from the declaration.
    pub(super) fn by(declared: &SubDeviceConfig, info: &'a SubDeviceInfo, areas: &[AreaPlan]) -> Written<'a> {
        let mut written = Written { info, objects: BTreeMap::new(), by_commands: BTreeSet::new(), is_refused: false };
        let at = |transition| declared.startup.iter().filter(move |command| command.transition == transition);
        let (after, before): (Vec<_>, Vec<_>) = at(Transition::Ps).partition(|command| command.is_after_pdos());
        at(Transition::Ip).chain(before).filter_map(download).for_each(|download| written.write(download));
        if declared.declared.is_none() {
            written.assign(declared, areas);
        }
        after.into_iter().filter_map(download).for_each(|download| written.write(download));
        written
    }

    /// The PDOs of a network file, which are written between the commands.
    fn assign(&mut self, declared: &SubDeviceConfig, areas: &[AreaPlan]) {
        let (can_assign, can_map) = permits(self.info);
        for assignment in declared.pdos.iter().flatten() {
            let Some(area) = areas.iter().find(|area| area.sync_manager == assignment.sync_manager) else { continue };
            let own = ASSIGNMENT_BASE + u16::from(area.sync_manager);
            let fixed: BTreeSet<u16> = assignment.pdos.iter().filter(|pdo| pdo.fixed).map(|pdo| pdo.index).collect();
            let mappings = area.pdos.iter().filter(|pdo| can_map && !fixed.contains(&pdo.index));
            let mappings = mappings.map(|pdo| {
                (pdo.index, PdoList::new(pdo.entries.iter().map(|entry| entry.bit_length.into()).collect()))
            });
            let pdos = can_assign.then(|| (own, PdoList::new(area.pdos.iter().map(|pdo| pdo.index.into()).collect())));
            for (object, list) in mappings.chain(pdos) {
                self.objects.insert(object, list);
                self.by_commands.remove(&object);
            }
        }
    }

    /// Bytes of a SyncManager, and whether they are due to a command; `None` where a PDO is not known. Those of the SII
    /// (`own`) where it has no assignment and the commands write none.
    pub(super) fn bytes(&self, sync_manager: u8, own: Option<u16>) -> Option<(u16, bool)> {
        let assignment = ASSIGNMENT_BASE + u16::from(sync_manager);
        let object = self.objects.get(&assignment);
        let pdos: Vec<u32> = match object {
            Some(list) => list.values()?,
            None => self.assigned(sync_manager).collect(),
        };
        if object.is_none() && pdos.is_empty() {
            return own.map(|own| (own, false));
        }
        let is_mapped = |pdo: &u32| self.by_commands.iter().any(|index| u32::from(*index) == *pdo);
        let is_written = self.by_commands.contains(&assignment) || pdos.iter().any(is_mapped);
        let bits = |pdo: u32| {
            let index = u16::try_from(pdo).ok()?;
            match self.objects.get(&index) {
                Some(list) => Some(list.values()?.into_iter().map(|entry| entry & 0xFF).sum()),
                None => self.info.pdo(index).map(|pdo| pdo.bit_length()),
            }
        };
        let bits = pdos.into_iter().map(bits).sum::<Option<u32>>()?;
        u16::try_from(bits.div_ceil(8)).ok().map(|bytes| (bytes, is_written))
    }

    /// Whether commands write objects that the SubDevice does not permit to write.
    pub(super) fn is_refused(&self) -> bool {
        self.is_refused
    }

    fn assigned(&self, sync_manager: u8) -> impl Iterator<Item = u32> {
        self.info.assigned_pdos(sync_manager).map(|pdo| u32::from(pdo.index))
    }

    fn write(&mut self, download: &SdoDownload) {
        let index = download.index;
        let (can_assign, can_map) = permits(self.info);
        let is_permitted = if is_mapping(index) { can_map } else { can_assign };
        if !is_permitted {
            self.is_refused = true;
            return;
        }
        let list = match self.objects.remove(&index) {
            Some(list) => list,
            None => PdoList::new(self.described(index)),
        };
        self.objects.insert(index, list.with(download));
        self.by_commands.insert(index);
    }

    /// The entries of an object by the SII.
    fn described(&self, index: u16) -> Vec<u32> {
        if !is_mapping(index) {
            let sync_manager = u8::try_from(index - ASSIGNMENT_BASE).unwrap_or(u8::MAX);
            return self.assigned(sync_manager).collect();
        }
        let entries = self.info.pdo(index).into_iter().flat_map(|pdo| &pdo.entries);
        entries.map(|entry| u32::from(entry.bit_length)).collect()
    }
}
