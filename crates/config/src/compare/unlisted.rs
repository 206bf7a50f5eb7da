//! PDOs of a file that a SubDevice does not list in its SII: those of modules in its slots.

use std::collections::{BTreeMap, BTreeSet};

use ringcat_engine::info::SubDeviceInfo;

use super::alike::{DeviceKey, device, keys_of};
use super::difference::Stated;
use super::modules;
use super::process_data;
use crate::configuration::Configuration;

/// The PDOs that a file assigns, by the vendor and product of their SubDevices.
#[derive(Clone, Debug)]
pub struct DeclaredPdos {
    pdos: BTreeMap<DeviceKey, BTreeSet<u16>>,
    /// SubDevices for which the file has the modules in their slots.
    modular: BTreeSet<DeviceKey>,
}

impl Configuration {
    /// The PDOs that the file assigns to each type of SubDevice. `stated` is that of [`Configuration::differences`].
    pub fn declared_pdos(&self, stated: &[Stated]) -> DeclaredPdos {
        let mut pdos: BTreeMap<DeviceKey, BTreeSet<u16>> = BTreeMap::new();
        let mut modular = BTreeSet::new();
        for (config, declared) in self.declaration.subdevices.iter().enumerate() {
            let own = process_data::pdos(declared).map(|(_, pdo)| pdo.index);
            let key = device(declared, stated.get(config));
            pdos.entry(key).or_default().extend(own);
            if modules::are_declared(declared) {
                modular.insert(key);
            }
        }
        DeclaredPdos { pdos, modular }
    }
}

impl DeclaredPdos {
    /// Whether the file assigns PDOs to a SubDevice of this vendor and product that its SII does not list: it may have
    /// modules in slots ([`Stated::modular`]).
    pub fn are_unlisted(&self, found: &SubDeviceInfo) -> bool {
        let listed: BTreeSet<u16> = found.pdos.iter().map(|pdo| pdo.index).collect();
        let mut declared = keys_of(found).into_iter().filter_map(|key| self.pdos.get(&key));
        // At most one more is looked at than are listed.
        declared.any(|pdos| pdos.iter().any(|index| !listed.contains(index)))
    }

    /// Whether the file names the modules of a SubDevice of this vendor and product: start-up commands write their list
    /// (0xF030), which is compared with [`FoundNetwork::modules`](super::FoundNetwork::modules).
    pub fn have_modules(&self, found: &SubDeviceInfo) -> bool {
        keys_of(found).iter().any(|key| self.modular.contains(key))
    }
}
