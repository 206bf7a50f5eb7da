//! How well a found SubDevice matches a declared one: its device type, and the identity that the file demands.

use std::collections::BTreeMap;

use ringcat_engine::config::SubDeviceConfig;
use ringcat_engine::info::SubDeviceInfo;

use super::difference::StatedProperties;

/// Degree of a SubDevice that has all that the file demands. It is more than any sum of [`SAME_DEVICE`] and
/// [`MANDATORY`]: a sequence has at most 4,096 pairs.
const OWN: u32 = 1 << 14;
/// Degree of a SubDevice of the same vendor and product that the file refuses, for example for its serial number.
const SAME_DEVICE: u32 = 2;
/// What is added to the degree of a mandatory declaration in a file with optional ones: of two SubDevices of one type
/// the optional one is absent.
const MANDATORY: u32 = 1;

/// Vendor, product, serial number.
type Unit = (u32, u32, u32);

/// The SubDevices of a file and of a bus, which are compared.
pub(super) struct Alike<'a> {
    configs: &'a [SubDeviceConfig],
    found: &'a [SubDeviceInfo],
    stated: &'a [StatedProperties],
    /// The first found SubDevice of each unit that the file demands.
    found_units: BTreeMap<Unit, usize>,
    /// The units that the file demands, with their declarations.
    declared_units: BTreeMap<Unit, usize>,
    /// Some declarations are optional.
    has_optional: bool,
}

impl<'a> Alike<'a> {
    pub(super) fn new(
        configs: &'a [SubDeviceConfig],
        found: &'a [SubDeviceInfo],
        stated: &'a [StatedProperties],
    ) -> Alike<'a> {
        let declared =
            (0..configs.len()).filter_map(|config| Some((unit(&configs[config], stated.get(config))?, config)));
        let declared_units: BTreeMap<Unit, usize> = declared.collect();
        let units = found.iter().enumerate().rev().map(|(info, it)| (unit_of(it), info));
        let found_units = units.filter(|(unit, _)| declared_units.contains_key(unit)).collect();
        let has_optional = configs.iter().any(|config| config.optional);
        Alike { configs, found, stated, found_units, declared_units, has_optional }
    }

    /// Whether a found SubDevice has all that the file demands.
    pub(super) fn is_own(&self, config: usize, info: usize) -> bool {
        self.degree(config, info) >= OWN
    }

    /// Whether no pair has a higher degree.
    pub(super) fn is_best(&self, config: usize, info: usize) -> bool {
        self.degree(config, info) == OWN + u32::from(self.has_optional) * MANDATORY
    }

    /// How well both match: 0 for another vendor or product, and if the serial number of one of them is elsewhere on
    /// the other side.
    pub(super) fn degree(&self, config: usize, info: usize) -> u32 {
        let declared = &self.configs[config];
        if !is_device(declared, self.stated.get(config), &self.found[info]) {
            return 0;
        }
        let more = if self.has_optional && !declared.optional { MANDATORY } else { 0 };
        match declared.expected.mismatch(&self.found[info]) {
            None => OWN + more,
            Some(_) if self.is_claimed(config, info) => 0,
            Some(_) => SAME_DEVICE + more,
        }
    }

    /// Whether the serial number of one of them is elsewhere on the other side.
    pub(super) fn is_claimed(&self, config: usize, info: usize) -> bool {
        let (demanded, own) = (unit(&self.configs[config], self.stated.get(config)), unit_of(&self.found[info]));
        demanded != Some(own)
            && (demanded.is_some_and(|unit| self.found_units.contains_key(&unit))
                || self.declared_units.contains_key(&own))
    }

    /// Where the serial number that the file demands was found.
    pub(super) fn serial_at(&self, config: usize) -> Option<usize> {
        self.found_units.get(&unit(&self.configs[config], self.stated.get(config))?).copied()
    }
}

fn unit(declared: &SubDeviceConfig, stated: Option<&StatedProperties>) -> Option<Unit> {
    let (vendor, product) = device(declared, stated);
    Some((vendor?, product?, declared.expected.serial?))
}

const fn unit_of(info: &SubDeviceInfo) -> Unit {
    (info.identity.vendor_id, info.identity.product_code, info.identity.serial)
}

/// Vendor and product; `None` matches any.
pub(super) type DeviceKey = (Option<u32>, Option<u32>);

/// Vendor and product of a declared SubDevice.
pub(super) fn device(config: &SubDeviceConfig, stated: Option<&StatedProperties>) -> DeviceKey {
    let stated = stated.and_then(|stated| stated.device);
    let vendor = config.expected.vendor_id.or(stated.map(|device| device.0));
    (vendor, config.expected.product_code.or(stated.map(|device| device.1)))
}

/// What a declaration can say of the device of a found SubDevice.
pub(super) const fn keys_of(found: &SubDeviceInfo) -> [DeviceKey; 4] {
    let (vendor, product) = (Some(found.identity.vendor_id), Some(found.identity.product_code));
    [(vendor, product), (vendor, None), (None, product), (None, None)]
}

/// Whether a found SubDevice has the vendor and the product of a declared one.
pub(super) fn is_device(config: &SubDeviceConfig, stated: Option<&StatedProperties>, info: &SubDeviceInfo) -> bool {
    let (vendor, product) = device(config, stated);
    vendor.is_none_or(|vendor| vendor == info.identity.vendor_id)
        && product.is_none_or(|product| product == info.identity.product_code)
}
