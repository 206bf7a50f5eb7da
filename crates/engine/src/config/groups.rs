//! Hot connect groups: consecutive SubDevices that may be present or absent, at any place of the segment.
//!
//! The first one, the head, is found by alias, explicit device identification or data word; the others follow it in the
//! order of the processing units. This module matches what the scan found; the procedures match groups that join later.

use alloc::collections::BTreeMap;
use alloc::vec::Vec;

use ringcat_wire::address::RegisterAddress;

use super::matching::{SubDevicesByIdentifier, at_place, missing};
use super::resolution::Resolution;
use super::{ConfigAddress, SubDeviceConfig};
use crate::declared::GroupId;
use crate::info::SubDeviceInfo;
use crate::order::InOrder;

/// A hot connect group.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Group {
    /// Head first.
    members: Vec<SubDeviceConfig>,
}

impl Group {
    /// A group of one: its head, declared [at an alias](SubDeviceConfig::at_alias) with offset 0 or [with an
    /// identification](SubDeviceConfig::at_identification) or [a data word](SubDeviceConfig::at_data_word).
    pub fn new(head: SubDeviceConfig) -> Group {
        Group { members: Vec::from([head]) }
    }

    /// Appends the next SubDevice. The address in its declaration is ignored.
    #[must_use]
    pub fn then(mut self, member: SubDeviceConfig) -> Group {
        self.members.push(member);
        self
    }

    /// The declarations of a group with this number: optional, with places behind the head.
    pub fn into_configs(self, number: GroupId) -> impl Iterator<Item = SubDeviceConfig> {
        let head = self.members.first().map(|head| head.address).unwrap_or(ConfigAddress::Position(0));
        (0..).zip(self.members).map(move |(offset, config)| SubDeviceConfig {
            address: head.behind(offset),
            optional: true,
            group: Some(number),
            ..config
        })
    }
}

/// Indices of the members of each group, head first.
pub fn groups<'a>(configs: impl IntoIterator<Item = &'a SubDeviceConfig>) -> Vec<Vec<usize>> {
    let mut groups: BTreeMap<GroupId, Vec<usize>> = BTreeMap::new();
    for (index, config) in configs.into_iter().enumerate() {
        if let Some(number) = config.group {
            groups.entry(number).or_default().push(index);
        }
    }
    groups.into_values().collect()
}

/// Finds a group in a scan: its head, then the following SubDevices as long as they match.
pub(super) fn find(
    configs: &[SubDeviceConfig],
    members: &[usize],
    (infos, by_identifier): (&[&SubDeviceInfo], &SubDevicesByIdentifier),
    resolutions: &mut [Option<Resolution>],
) {
    let head = members.first().map_or(Ok(None), |head| by_identifier.find(configs[*head].address, infos));
    let mut intact = true;
    for (offset, config) in members.iter().enumerate() {
        let resolution = match head {
            Ok(head) => at_place(configs, infos, *config, head.filter(|_| intact).map(|head| head + offset)),
            Err(error) => missing(&configs[*config], *config, error),
        };
        intact &= matches!(resolution, Resolution::Found { .. });
        resolutions[*config] = Some(resolution);
    }
}

/// The data words that declarations name, each once.
pub fn data_words<'a>(configs: impl IntoIterator<Item = &'a SubDeviceConfig>) -> Vec<RegisterAddress> {
    let mut words: Vec<RegisterAddress> = configs.into_iter().filter_map(|it| it.address.data_word()).collect();
    words.put_in_order();
    words.dedup();
    words
}

/// Whether a declaration can be the head of a group.
pub(crate) fn can_be_head(config: &SubDeviceConfig) -> bool {
    match config.address {
        ConfigAddress::Alias { alias, offset: 0 } => alias != 0,
        ConfigAddress::Identification { offset: 0, .. } | ConfigAddress::DataWord { offset: 0, .. } => true,
        ConfigAddress::Alias { .. }
        | ConfigAddress::Identification { .. }
        | ConfigAddress::DataWord { .. }
        | ConfigAddress::Position(_) => false,
    }
}
