//! Data of a SubDevice of whose SII a part was read, and what a larger part adds.

use alloc::vec::Vec;

use super::extent::SiiExtent;
use super::subdevice::{PdoEntryInfo, SubDeviceInfo};
use super::warning::{InfoWarning, SiiProblem};

impl SubDeviceInfo {
    /// Only this extent of the SII was read: that a name does not exist is not known yet.
    pub(crate) fn limit_to(&mut self, extent: SiiExtent) {
        self.extent = extent;
        if extent < SiiExtent::Complete {
            self.warnings.retain(|warning| !matches!(warning.problem, SiiProblem::NoString { .. }));
        }
    }

    /// Takes names, operation modes and further warnings from the same SII, of which a larger extent was read. Returns
    /// the new warnings; nothing if it is the SII of another SubDevice or extends nothing.
    pub(crate) fn extend(&mut self, read: &SubDeviceInfo) -> Vec<InfoWarning> {
        if read.extent <= self.extent || read.identity != self.identity {
            return Vec::new();
        }
        self.extent = read.extent;
        self.name.clone_from(&read.name);
        self.order_code.clone_from(&read.order_code);
        self.group.clone_from(&read.group);
        self.image.clone_from(&read.image);
        self.dc_modes.clone_from(&read.dc_modes);
        // The mapping may be that of a dictionary.
        for pdo in &mut self.pdos {
            let Some(named) = read.pdo(pdo.index) else { continue };
            pdo.name.clone_from(&named.name);
            let is_named = |entry: &PdoEntryInfo, named: &PdoEntryInfo| {
                (entry.index, entry.sub_index) == (named.index, named.sub_index)
            };
            for (number, entry) in pdo.entries.iter_mut().enumerate() {
                let at_its_place = named.entries.get(number).filter(|named| is_named(entry, named));
                if let Some(named) = at_its_place.or_else(|| named.entries.iter().find(|named| is_named(entry, named)))
                {
                    entry.name.clone_from(&named.name);
                }
            }
        }
        let known = self.warnings.clone();
        let new: Vec<InfoWarning> = read.warnings.iter().filter(|it| !known.contains(it)).copied().collect();
        self.warnings.extend(&new);
        new
    }
}
