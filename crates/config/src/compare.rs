//! A network that was found, compared with a declared one: every difference, for people and programs.
//!
//! [`Configuration::compare`] follows the rules of an activation: it reports what the engine would refuse, by position.
//! [`Configuration::differences`] explains two networks: a SubDevice that is missing or additional is one difference,
//! not a wrong identity of all behind it.

mod activation;
mod align;
mod alike;
mod assignment;
mod cables;
mod contents;
mod difference;
mod marks;
mod modules;
mod moves;
mod order;
mod process_data;
mod properties;
mod replugged;
mod samples;
mod signals;
mod twins;
mod unlisted;
mod written;

use std::collections::BTreeSet;

use ringcat_engine::config::{ConfigError, Resolution, resolve};
use ringcat_engine::declared::SubDeviceId;
use ringcat_engine::info::SubDeviceInfo;
use ringcat_engine::main_device::Required;
use ringcat_wire::address::Position;

use crate::configuration::Configuration;
use align::Place;

pub use difference::{Difference, DifferenceKind, FoundNetwork, StatedProperties, StatedSyncManager};
#[cfg(feature = "network")]
pub(crate) use properties::ports;

impl Configuration {
    /// Names of the SubDevices for messages: name and station address of the file.
    pub fn names(&self) -> Vec<String> {
        let name = |facts: &crate::SubDeviceFacts| match facts.station {
            Some(station) => format!("{} ({station})", facts.name),
            None => facts.name.clone(),
        };
        self.subdevices.iter().map(name).collect()
    }

    /// The index of the found SubDevice that each declared one is, `None` where it is missing.
    pub fn places(&self, found: &[SubDeviceInfo]) -> Vec<Option<usize>> {
        let mut places = vec![None; self.declaration.subdevices.len()];
        for resolution in resolve(&self.declaration.subdevices, found) {
            if let Resolution::Found { config, info } = resolution {
                places[config] = Some(info);
            }
        }
        places
    }

    /// Compares the SubDevices of a scan with the file as an activation does. Returns each SubDevice that is missing,
    /// has another identity, or is not in the file.
    pub fn compare(&self, found: &[SubDeviceInfo]) -> Vec<Difference> {
        let names = self.names();
        let differs = |config: usize, prevents_op: bool, error: &ConfigError| {
            let (kind, position) = match error {
                ConfigError::Mismatch { position, field, .. } => (DifferenceKind::of_field(*field), Some(*position)),
                ConfigError::Ambiguous { first, .. } => (DifferenceKind::Ambiguous, Some(*first)),
                _ => (DifferenceKind::Missing, None),
            };
            let name = names.get(config).cloned().unwrap_or_default();
            let text = format!("SubDevice {config} \"{name}\" of the file: {error}");
            Difference { subdevice: Some(SubDeviceId(config)), position, kind, prevents_op, text }
        };
        let required = self.declaration.required;
        let mut differences = Vec::new();
        // A SubDevice of another identity is reported once.
        let mut reported = BTreeSet::new();
        for resolution in resolve(&self.declaration.subdevices, found) {
            match resolution {
                Resolution::Found { .. } => {}
                Resolution::Absent { config, error } => {
                    reported.extend(in_its_place(&error));
                    differences.push(differs(config, required == Required::All, &error));
                }
                Resolution::Failed { config, error } => {
                    reported.extend(in_its_place(&error));
                    differences.push(differs(config, required != Required::Nothing, &error));
                }
                Resolution::Extra { info } if reported.contains(&found[info].position) => {}
                Resolution::Extra { info } => differences.push(additional(&found[info], false)),
            }
        }
        differences
    }

    /// Every difference between the network of a scan and the file: SubDevices that are missing, additional or at
    /// another place, several with one alias or identification, revision, serial number, PDOs, modules, mailboxes,
    /// SyncManagers, ports, cables, clocks, rings. `stated` are the [`StatedProperties`] by the index of the
    /// SubDevice; it may be empty.
    pub fn differences(&self, network: FoundNetwork<'_>, stated: &[StatedProperties]) -> Vec<Difference> {
        let FoundNetwork { subdevices: found, topology, firmware, modules, .. } = network;
        let names = self.names();
        let mut differences = Vec::new();
        let mut pairs = Vec::new();
        let places = align::align(self, found, stated);
        let marks = marks::Marks::of(self, found, &places);
        let order = order::Order::of(self, found, &places);
        for place in places {
            match place {
                Place::Both { config, info, moved } => {
                    differences.extend(order.difference(config, &names, &marks, &found[info]).filter(|_| moved));
                    let both = contents::Both {
                        config,
                        declared: &self.declaration.subdevices[config],
                        name: &names[config],
                        stated: stated.get(config),
                        info: &found[info],
                        firmware: firmware.get(info).and_then(Option::as_deref),
                        modules: modules.get(info).and_then(Option::as_deref),
                        fails: marks.fails(config),
                    };
                    let before = differences.len();
                    both.compare(&mut differences);
                    if marks.is_absent(config) {
                        differences[before..].iter_mut().for_each(|it| it.prevents_op = false);
                    }
                    pairs.push((config, info));
                }
                Place::Missing { config } => {
                    let prevents_op = marks.misses(config, &self.declaration.subdevices[config]);
                    differences.push(self.missing(config, &names, prevents_op));
                }
                Place::Additional { info } => differences.push(additional(&found[info], marks.shifts(info))),
            }
        }
        differences.extend(twins::differences(self, found, &names, &marks));
        self.settle(&marks, &order, found, &mut differences);
        if !differences.iter().any(|difference| difference.kind == DifferenceKind::Order) {
            differences.extend(cables::compare(self, &pairs, found, topology));
        }
        let position_of = |subdevice: SubDeviceId| {
            let (_, info) = pairs.iter().find(|(config, _)| *config == subdevice.0)?;
            Some(found[*info].position)
        };
        differences.extend(activation::differences(self, &network, &names, position_of));
        differences
    }

    /// An activation that fails has a difference that says so. SubDevices by alias that are missing or at other places
    /// can shift those by position without being marked themselves.
    fn settle(
        &self,
        marks: &marks::Marks,
        order: &order::Order,
        found: &[SubDeviceInfo],
        differences: &mut Vec<Difference>,
    ) {
        let Some((config, error)) = marks.first_failing() else { return };
        if differences.iter().any(|difference| difference.prevents_op) {
            return;
        }
        let names = self.names();
        let text = |(config, info): (usize, usize)| Some((config, found[info].position, order.text(config, &names)?));
        if let Some((config, position, text)) = marks.shifted().find_map(text) {
            let (subdevice, position) = (Some(SubDeviceId(config)), Some(position));
            differences.push(Difference { subdevice, position, kind: DifferenceKind::Order, prevents_op: true, text });
            return;
        }
        for of_places in [&[DifferenceKind::Order][..], &[DifferenceKind::Missing, DifferenceKind::Additional]] {
            if differences.iter().any(|it| of_places.contains(&it.kind)) {
                let causes = differences.iter_mut().filter(|it| of_places.contains(&it.kind));
                causes.for_each(|it| it.prevents_op = true);
                return;
            }
        }
        let text = format!("\"{}\": {error}", names[config]);
        let (subdevice, kind) = (Some(SubDeviceId(config)), DifferenceKind::Order);
        differences.push(Difference { subdevice, position: in_its_place(error), kind, prevents_op: true, text });
    }

    fn missing(&self, config: usize, names: &[String], prevents_op: bool) -> Difference {
        let declared = &self.declaration.subdevices[config];
        let (expected, place) = (&declared.expected, declared.address);
        let device = match (expected.vendor_id, expected.product_code) {
            (Some(vendor), Some(product)) => format!(", vendor {vendor:#010x}, product {product:#010x}"),
            _ => String::new(),
        };
        let optional = if declared.optional { ", which is optional" } else { "" };
        Difference {
            subdevice: Some(SubDeviceId(config)),
            position: None,
            kind: DifferenceKind::Missing,
            prevents_op,
            text: format!("\"{}\" ({place}{device}) is missing{optional}", names[config]),
        }
    }
}

fn additional(info: &SubDeviceInfo, prevents_op: bool) -> Difference {
    let SubDeviceInfo { position, name, identity, .. } = info;
    let text = format!(
        "position {position} \"{name}\" is not in the file: vendor {:#010x}, product {:#010x}",
        identity.vendor_id, identity.product_code
    );
    Difference { subdevice: None, position: Some(*position), kind: DifferenceKind::Additional, prevents_op, text }
}

/// Position of a SubDevice with another identity than expected.
const fn in_its_place(error: &ConfigError) -> Option<Position> {
    match error {
        ConfigError::Mismatch { position, .. } => Some(*position),
        _ => None,
    }
}
