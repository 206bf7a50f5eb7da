//! The declaration of a found SubDevice, and its PDOs that the SII does not list: those of modules in slots.

use std::collections::BTreeSet;

use ringcat_engine::info::SubDeviceInfo;

use super::align::{self, Place};
use super::difference::StatedProperties;
use super::modules;
use super::process_data;
use crate::configuration::Configuration;

impl Configuration {
    /// The declaration of each found SubDevice as [`Configuration::differences`] pairs them: its index in the file;
    /// `None` for a SubDevice that is not in it. `stated` is that of [`Configuration::differences`].
    pub fn counterparts(&self, found: &[SubDeviceInfo], stated: &[StatedProperties]) -> Vec<Option<usize>> {
        let mut counterparts = vec![None; found.len()];
        for place in align::align(self, found, stated) {
            if let Place::Both { config, info, .. } = place {
                counterparts[info] = Some(config);
            }
        }
        counterparts
    }

    /// Whether the file assigns PDOs to a declared SubDevice that the SII of the found one does not list: it may have
    /// modules in slots ([`StatedProperties::modular`]).
    pub fn has_unlisted_pdos(&self, config: usize, found: &SubDeviceInfo) -> bool {
        let listed: BTreeSet<u16> = found.pdos.iter().map(|pdo| pdo.index).collect();
        let declared = self.declaration.subdevices.get(config);
        declared.is_some_and(|declared| process_data::pdos(declared).any(|(_, pdo)| !listed.contains(&pdo.index)))
    }

    /// Whether the file names the modules of a declared SubDevice: start-up commands write their list (0xF030), which
    /// is compared with [`FoundNetwork::modules`](super::FoundNetwork::modules).
    pub fn declares_modules(&self, config: usize) -> bool {
        self.declaration.subdevices.get(config).is_some_and(modules::are_declared)
    }
}
