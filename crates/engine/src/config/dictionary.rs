//! PDOs of the object dictionary in the place of those of the SII (protocol 4.5, 6.3).

use alloc::vec::Vec;

use ringcat_wire::sii::CategoryKind;

use super::pdo::{PdoAssignment, PdoEntry, PdoMapping};
use crate::info::{Direction, InfoWarning, PdoEntryInfo, PdoInfo, PdoSource, SiiProblem, SubDeviceInfo};

impl SubDeviceInfo {
    /// Takes over what its dictionary holds. Returns what contradicts the SII: nothing if the dictionary was written
    /// since power-on.
    pub(crate) fn take_dictionary(&mut self, held: &[PdoAssignment]) -> Vec<InfoWarning> {
        let is_of_sii = self.pdo_source == PdoSource::Sii;
        let warnings: Vec<InfoWarning> = held.iter().filter_map(|assignment| self.merge(assignment)).collect();
        self.pdo_source = self.pdo_source.held();
        if !is_of_sii {
            return Vec::new();
        }
        self.warnings.extend(&warnings);
        warnings
    }

    /// Takes an assignment over. The warning reports that another one was known.
    fn merge(&mut self, assignment: &PdoAssignment) -> Option<InfoWarning> {
        let PdoAssignment { sync_manager, direction, ref pdos } = *assignment;
        let before: Vec<PdoInfo> = self.assigned_pdos(sync_manager).cloned().collect();
        let known: Vec<PdoInfo> = pdos.iter().filter_map(|pdo| self.pdo(pdo.index).cloned()).collect();
        let now: Vec<PdoInfo> = pdos.iter().map(|pdo| describe(pdo, sync_manager, direction, &known)).collect();
        // First the PDOs, then the entries of each.
        let mapped = |pdos: &[PdoInfo]| -> Vec<(u16, u16, u8, u8)> {
            let entries = |pdo: &PdoInfo| {
                let of = pdo.index;
                let entry = move |entry: &PdoEntryInfo| (of, entry.index, entry.sub_index, entry.bit_length);
                pdo.entries.iter().map(entry).collect::<Vec<_>>()
            };
            let indices = pdos.iter().map(|pdo| (pdo.index, 0, 0, 0));
            indices.chain(pdos.iter().flat_map(entries)).collect()
        };
        let differs = mapped(&before) != mapped(&now);
        let bits = |pdos: &[PdoInfo]| pdos.iter().map(PdoInfo::bit_length).sum();
        let problem = SiiProblem::Dictionary { sync_manager, sii: bits(&before), dictionary: bits(&now) };
        let is_odd = differs && !before.is_empty();
        self.pdos.retain(|pdo| pdos.iter().all(|read| read.index != pdo.index));
        let is_of_it = |pdo: &&mut PdoInfo| pdo.sync_manager == Some(sync_manager);
        self.pdos.iter_mut().filter(is_of_it).for_each(|pdo| pdo.sync_manager = None);
        self.pdos.extend(now);
        let category = match direction {
            Direction::Outputs => CategoryKind::RxPdo,
            Direction::Inputs => CategoryKind::TxPdo,
        };
        is_odd.then_some(InfoWarning { category: Some(category), offset: None, problem })
    }
}

/// A PDO according to the dictionary, with the names of the SII.
fn describe(read: &PdoMapping, sync_manager: u8, direction: Direction, known: &[PdoInfo]) -> PdoInfo {
    let known = known.iter().find(|pdo| pdo.index == read.index);
    let entry = |entry: &PdoEntry| {
        let PdoEntry { index, sub_index, bit_length } = *entry;
        let named = known.into_iter().flat_map(|pdo| &pdo.entries);
        let mut same = named.filter(|named| (named.index, named.sub_index) == (index, sub_index));
        PdoEntryInfo { index, sub_index, bit_length, ..same.next().cloned().unwrap_or_default() }
    };
    PdoInfo {
        index: read.index,
        direction,
        sync_manager: Some(sync_manager),
        name: known.map(|pdo| pdo.name.clone()).unwrap_or_default(),
        flags: known.map_or(0, |pdo| pdo.flags),
        entries: read.entries.iter().flatten().map(entry).collect(),
    }
}
