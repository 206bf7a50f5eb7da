//! The configuration of an application as digests with names, to be compared with that of the other MainDevice of a
//! ring (protocol MR-15, REQ010).
//!
//! In: the declaration, whatever file it comes from, and the options. Out: a digest of all of it, and one for each
//! item: parameters, clocks, domains, and the parts of each SubDevice's declaration.

use alloc::format;
use alloc::string::{String, ToString};
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::hash::{Hash, Hasher};
use core::time::Duration;

use super::standby_options::StandbyOptions;
use crate::config::{ConfigPart, Digest};
use crate::direction::Direction;
use crate::main_device::declaration::registered_area::RegisteredArea;
use crate::main_device::declaration::{Declaration, DomainConfig, DomainMember};
use crate::main_device::options::Options;

/// Items before those of SubDevices.
const COMMON: usize = 3;

/// Digests of a configuration.
#[derive(Clone, Debug, Default)]
pub(in crate::main_device) struct Configuration {
    items: Arc<[u32]>,
}

impl Configuration {
    /// The configuration of a declaration and the options.
    pub fn of(declaration: &Declaration, options: &Options) -> Configuration {
        let mut items = Vec::with_capacity(COMMON + ConfigPart::ALL.len() * declaration.subdevices.len());
        items.push(parameters(declaration, options));
        items.push(clocks(declaration));
        items.push(domains(&declaration.domains));
        let parts = declaration.subdevices.iter().flat_map(|config| ConfigPart::ALL.map(|part| config.digest(part)));
        items.extend(parts);
        Configuration { items: items.into() }
    }

    /// The digests of the items.
    pub fn items(&self) -> Arc<[u32]> {
        self.items.clone()
    }

    /// The digest of all of it.
    pub fn digest(&self) -> u64 {
        let mut digest = Digest::default();
        digest.write_usize(self.items.len());
        self.items.iter().for_each(|item| digest.write_u32(*item));
        digest.finish()
    }

    /// What an item is.
    pub fn name_of(&self, number: u16) -> String {
        match usize::from(number) {
            0 => "parameters of the MainDevice or sizes of master frames".to_string(),
            1 => "distributed clocks".to_string(),
            2 => "domains".to_string(),
            item => {
                let (subdevice, part) =
                    ((item - COMMON) / ConfigPart::ALL.len(), (item - COMMON) % ConfigPart::ALL.len());
                match ConfigPart::ALL.get(part).filter(|_| item < self.items.len()) {
                    Some(part) => format!("SubDevice {subdevice}: {}", part.name()),
                    None => unknown_item(number),
                }
            }
        }
    }
}

fn parameters(declaration: &Declaration, options: &Options) -> u32 {
    let mut digest = Digest::default();
    let default = StandbyOptions::default();
    let standby = options.standby.unwrap_or_default();
    digest.field(1, &standby.sizes.to_inactive, &default.sizes.to_inactive);
    digest.field(2, &standby.sizes.to_active, &default.sizes.to_active);
    digest.field(3, &standby.sizes.inputs, &default.sizes.inputs);
    digest.field(4, &standby.sizes.knowledge, &default.sizes.knowledge);
    digest.field(5, &options.supervision, &true);
    digest.field(6, &options.max_datagrams_per_frame, &None);
    digest.field(7, &format!("{:?}", declaration.lrw), &"Automatic".to_string());
    digest.field(8, &declaration.explicit_lrw.len(), &0);
    digest.field(9, &format!("{:?}", declaration.required), &"Mandatory".to_string());
    digest.short()
}

fn clocks(declaration: &Declaration) -> u32 {
    let mut digest = Digest::default();
    // The epoch contains the time at which a computer was started: it differs on each.
    let clocks = declaration.clocks.clone().map(|clocks| clocks.with_epoch(0));
    digest.field(1, &clocks, &None);
    digest.short()
}

fn domains(domains: &[DomainConfig]) -> u32 {
    let mut digest = Digest::default();
    for domain in domains {
        // Where the memory of a domain comes from may differ.
        let DomainConfig { period, under_way, sends_again, members, registered, memory: _ } = domain;
        digest.write_u16(0xD0);
        digest.field(1, period, &Duration::ZERO);
        digest.field(2, under_way, &1);
        digest.field(3, sends_again, &false);
        for DomainMember { subdevice, sync_managers } in members {
            (subdevice.0, sync_managers).hash(&mut digest);
        }
        for RegisteredArea { subdevice, sync_manager, direction, start, length } in registered {
            let is_input = *direction == Direction::Inputs;
            (subdevice.0, sync_manager, is_input, start, length).hash(&mut digest);
        }
    }
    digest.short()
}

/// A name of an item of the configuration that is not known.
fn unknown_item(number: u16) -> String {
    format!("item {number}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{ClockConfig, SubDeviceConfig};
    use ringcat_wire::frame::MacAddress;

    fn configuration(change: impl FnOnce(&mut Declaration, &mut Options)) -> Configuration {
        let mut declaration = Declaration::new(Duration::from_millis(1));
        (0..3).for_each(|position| {
            declaration.add(SubDeviceConfig::at_position(position));
        });
        let mut options = Options::new(MacAddress([0, 1, 2, 3, 4, 5]), Some(MacAddress([0, 1, 2, 3, 4, 6])));
        options.standby = Some(StandbyOptions::default());
        change(&mut declaration, &mut options);
        Configuration::of(&declaration, &options)
    }

    /// The names of the items that differ from those of the unchanged configuration.
    fn differing(change: impl FnOnce(&mut Declaration, &mut Options)) -> Vec<String> {
        let (before, after) = (configuration(|_, _| ()), configuration(change));
        let items =
            before.items().iter().zip(after.items().iter()).map(|(one, other)| one != other).collect::<Vec<_>>();
        assert_eq!(items.contains(&true), before.digest() != after.digest());
        (0..).zip(items).filter(|(_, differs)| *differs).map(|(number, _)| before.name_of(number)).collect()
    }

    // covers: REQ010, MR-15, standby
    #[test]
    fn each_difference_of_two_configurations_has_a_name() {
        assert!(differing(|_, _| ()).is_empty());
        let with_clocks = |epoch: u64| {
            move |it: &mut Declaration, _: &mut Options| it.clocks = Some(ClockConfig::default().with_epoch(epoch))
        };
        assert_eq!(
            configuration(with_clocks(1)).items(),
            configuration(with_clocks(2)).items(),
            "a computer's own time"
        );
        assert_eq!(differing(|it, _| it.subdevices[1].optional = true), ["SubDevice 1: place or identity"]);
        assert_eq!(differing(|it, _| it.subdevices[2].pdos = Some(Vec::new())), ["SubDevice 2: process data"]);
        assert_eq!(differing(|it, _| it.domains[0].period *= 2), ["domains"]);
        assert_eq!(differing(|it, _| it.clocks = Some(Default::default())), ["distributed clocks"]);
        let parameters = ["parameters of the MainDevice or sizes of master frames"];
        assert_eq!(differing(|_, options| options.supervision = false), parameters);
        let more = |options: &mut Options| options.standby.as_mut().unwrap().sizes.to_active = 4;
        assert_eq!(differing(|_, options| more(options)), parameters);
        assert_eq!(differing(|_, options| options.settle *= 2), [""; 0], "times of a scan may differ");
        assert_eq!(configuration(|_, _| ()).name_of(999), "item 999");
    }
}
