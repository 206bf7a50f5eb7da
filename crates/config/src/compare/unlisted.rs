//! PDOs of a file that a SubDevice does not list in its SII: those of modules in its slots.

use std::collections::{BTreeMap, BTreeSet};

use ringcat_engine::info::SubDeviceInfo;

use super::alike::{DeviceKey, device, keys_of};
use super::difference::Stated;
use super::process_data;
use crate::configuration::Configuration;

/// The PDOs that a file assigns, by the vendor and product of their SubDevices.
#[derive(Clone, Debug)]
pub struct DeclaredPdos {
    pdos: BTreeMap<DeviceKey, BTreeSet<u16>>,
}

impl Configuration {
    /// The PDOs that the file assigns to each type of SubDevice. `stated` is that of [`Configuration::differences`].
    pub fn declared_pdos(&self, stated: &[Stated]) -> DeclaredPdos {
        let mut pdos: BTreeMap<DeviceKey, BTreeSet<u16>> = BTreeMap::new();
        for (config, declared) in self.declaration.subdevices.iter().enumerate() {
            let own = process_data::pdos(declared).map(|(_, pdo)| pdo.index);
            pdos.entry(device(declared, stated.get(config))).or_default().extend(own);
        }
        DeclaredPdos { pdos }
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
}
