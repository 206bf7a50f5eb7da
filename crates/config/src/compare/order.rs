//! SubDevices at another place than in the file. Two that are swapped are one difference, which names both.

use std::collections::BTreeMap;

use ringcat_engine::config::ConfigAddress;
use ringcat_engine::info::SubDeviceInfo;

use super::align::{Place, position};
use crate::configuration::Configuration;

/// The places of all SubDevices that were found.
pub(super) struct Order {
    /// The place in the file and on the bus, and whether the first one is another one than the second; by declaration.
    places: BTreeMap<usize, (ConfigAddress, usize, bool)>,
    /// The declaration of each place in the file that is a position.
    at: BTreeMap<usize, usize>,
}

impl Order {
    pub(super) fn of(configuration: &Configuration, found: &[SubDeviceInfo], places: &[Place]) -> Order {
        let configs = &configuration.declaration.subdevices;
        let mut order = Order { places: BTreeMap::new(), at: BTreeMap::new() };
        for place in places {
            let Place::Both { config, info, moved } = *place else { continue };
            order.places.insert(config, (configs[config].address, found[info].position.0.into(), moved));
            if let place @ 0..=0xFFFF = position(&configs[config]) {
                order.at.insert(place, config);
            }
        }
        order
    }

    /// Where a SubDevice is, and where the file has it; `None` if it is there after all, or was named with the one that
    /// it is swapped with.
    pub(super) fn text(&self, config: usize, names: &[String]) -> Option<String> {
        let (address, bus, _) = *self.places.get(&config)?;
        if self.at.get(&bus) == Some(&config) {
            return None;
        }
        let is = format!("\"{}\" is at position {bus}", names[config]);
        let Some((other, moved)) = self.swapped_with(config) else {
            return Some(format!("{is}, the file has it at {address}"));
        };
        let (other_address, other_bus, _) = *self.places.get(&other)?;
        (!moved || config < other).then(|| {
            format!(
                "{is} instead of {address}, and \"{}\" at position {other_bus} instead of {other_address}",
                names[other]
            )
        })
    }

    /// The SubDevice that is at the place of this one and has its place on the bus, and whether it has moved too.
    fn swapped_with(&self, config: usize) -> Option<(usize, bool)> {
        let (_, bus, _) = *self.places.get(&config)?;
        let other = *self.at.get(&bus)?;
        let (_, other_bus, moved) = *self.places.get(&other)?;
        (other != config && self.at.get(&other_bus) == Some(&config)).then_some((other, moved))
    }
}
