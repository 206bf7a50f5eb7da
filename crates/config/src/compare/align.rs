//! Which found SubDevice is which declared one: the longest common sequence of devices, then devices that moved.

use std::collections::BTreeMap;

use ringcat_engine::config::{ConfigAddress, SubDeviceConfig};
use ringcat_engine::info::SubDeviceInfo;

use super::difference::Stated;
use crate::configuration::Configuration;

/// Maximum number of compared pairs between the common begin and end; beyond it SubDevices are compared by position.
const MAX_PAIRS: usize = 1 << 24;

/// The counterpart of a SubDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Place {
    /// A declared SubDevice was found.
    Both {
        /// Index in the file.
        config: usize,
        /// Index in the scan.
        info: usize,
        /// It is at another place than in the file.
        moved: bool,
    },
    /// A declared SubDevice was not found.
    Missing {
        /// Index in the file.
        config: usize,
    },
    /// A SubDevice is not in the file.
    Additional {
        /// Index in the scan.
        info: usize,
    },
}

/// Pairs all SubDevices, in the order of the file, the additional ones at their places on the bus.
pub(super) fn align(configuration: &Configuration, found: &[SubDeviceInfo], stated: &[Stated]) -> Vec<Place> {
    let configs = &configuration.declaration.subdevices;
    let mut info_of: Vec<Option<usize>> = vec![None; configs.len()];
    let mut moved = vec![false; configs.len()];
    let mut taken = vec![false; found.len()];
    by_mark(configs, found, &mut info_of, &mut taken);
    let is_device = |config: usize, info: usize| is_device(&configs[config], stated.get(config), &found[info]);
    let mut declared: Vec<usize> = (0..configs.len()).filter(|config| by_position(&configs[*config])).collect();
    declared.sort_by_key(|config| position(&configs[*config]));
    let free: Vec<usize> = (0..found.len()).filter(|info| !taken[*info]).collect();
    for (config, info) in common(&declared, &free, &is_device) {
        (info_of[config], taken[info]) = (Some(info), true);
    }
    // What is missing here and additional there has moved.
    for config in declared.iter().copied().filter(|config| info_of[*config].is_none()).collect::<Vec<_>>() {
        if let Some(info) = (0..found.len()).find(|info| !taken[*info] && is_device(config, *info)) {
            (info_of[config], taken[info], moved[config]) = (Some(info), true, true);
        }
    }
    // Another device in the place of the declared one, between the same neighbours.
    let gaps: Vec<usize> = declared.iter().copied().filter(|config| info_of[*config].is_none()).collect();
    for config in gaps {
        let before = declared.iter().rev().find(|other| **other < config).map(|other| info_of[*other]);
        let info = match before {
            None => Some(0),
            Some(info) => info.map(|info| info + 1),
        };
        if let Some(info) = info.filter(|info| *info < found.len() && !taken[*info]) {
            (info_of[config], taken[info]) = (Some(info), true);
        }
    }
    if !taken.contains(&false) && !moved.contains(&true) {
        exact_positions(configs, &info_of, &mut moved);
    }
    in_order(&info_of, &moved, &taken)
}

/// Where each SubDevice has its counterpart in the order of positions, each has to be at its position: the file may
/// have gaps between them.
fn exact_positions(configs: &[SubDeviceConfig], info_of: &[Option<usize>], moved: &mut [bool]) {
    let is_plain = |config: &SubDeviceConfig| by_position(config) && config.group.is_none();
    if !configs.iter().all(is_plain) || info_of.contains(&None) {
        return;
    }
    for (config, info) in info_of.iter().enumerate() {
        moved[config] |= *info != Some(position(&configs[config]));
    }
}

fn in_order(info_of: &[Option<usize>], moved: &[bool], taken: &[bool]) -> Vec<Place> {
    let mut places: Vec<Place> = info_of
        .iter()
        .enumerate()
        .map(|(config, info)| match info {
            Some(info) => Place::Both { config, info: *info, moved: moved[config] },
            None => Place::Missing { config },
        })
        .collect();
    for info in (0..taken.len()).filter(|info| !taken[*info]) {
        let is_before = |place: &Place| match place {
            Place::Both { info: other, moved, .. } => !moved && *other < info,
            Place::Additional { info: other } => *other < info,
            Place::Missing { .. } => false,
        };
        let at = places.iter().rposition(is_before).map_or(0, |at| at + 1);
        places.insert(at, Place::Additional { info });
    }
    places
}

const fn by_position(config: &SubDeviceConfig) -> bool {
    matches!(config.address, ConfigAddress::Position(_) | ConfigAddress::Alias { alias: 0, .. })
}

/// The position of a SubDevice that is declared by it.
pub(super) fn position(config: &SubDeviceConfig) -> usize {
    match config.address {
        ConfigAddress::Position(position) | ConfigAddress::Alias { alias: 0, offset: position } => position.into(),
        _ => usize::MAX,
    }
}

/// SubDevices that are declared by alias or identification.
fn by_mark(configs: &[SubDeviceConfig], found: &[SubDeviceInfo], info_of: &mut [Option<usize>], taken: &mut [bool]) {
    let aliases: BTreeMap<u16, usize> = (0..found.len()).rev().map(|at| (found[at].alias, at)).collect();
    let marks: BTreeMap<u16, usize> =
        (0..found.len()).rev().filter_map(|at| Some((found[at].identification?, at))).collect();
    for (config, declared) in configs.iter().enumerate() {
        let head = match declared.address {
            ConfigAddress::Alias { alias, offset } if alias != 0 => {
                aliases.get(&alias).map(|at| at + usize::from(offset))
            }
            ConfigAddress::Identification { value, offset } => marks.get(&value).map(|at| at + usize::from(offset)),
            _ => None,
        };
        if let Some(info) = head.filter(|info| *info < found.len() && !taken[*info]) {
            (info_of[config], taken[info]) = (Some(info), true);
        }
    }
}

/// Whether a found SubDevice has the vendor and the product of a declared one.
pub(super) fn is_device(config: &SubDeviceConfig, stated: Option<&Stated>, info: &SubDeviceInfo) -> bool {
    let stated = stated.and_then(|stated| stated.device);
    let vendor = config.expected.vendor_id.or(stated.map(|device| device.0));
    let product = config.expected.product_code.or(stated.map(|device| device.1));
    vendor.is_none_or(|vendor| vendor == info.identity.vendor_id)
        && product.is_none_or(|product| product == info.identity.product_code)
}

/// The longest common sequence; by position where the networks are too large and too different for it.
fn common(configs: &[usize], infos: &[usize], is_device: &impl Fn(usize, usize) -> bool) -> Vec<(usize, usize)> {
    let both = configs.iter().copied().zip(infos.iter().copied());
    let head = both.take_while(|(config, info)| is_device(*config, *info)).count();
    let (rest_configs, rest_infos) = (&configs[head..], &infos[head..]);
    let both = rest_configs.iter().rev().copied().zip(rest_infos.iter().rev().copied());
    let tail = both.take_while(|(config, info)| is_device(*config, *info)).count();
    let (middle, between) = (&rest_configs[..rest_configs.len() - tail], &rest_infos[..rest_infos.len() - tail]);
    let mut pairs: Vec<(usize, usize)> = configs.iter().copied().zip(infos.iter().copied()).take(head).collect();
    if middle.len().saturating_mul(between.len()) <= MAX_PAIRS {
        pairs.extend(longest(middle, between, is_device));
    } else {
        let same = middle.iter().copied().zip(between.iter().copied());
        pairs.extend(same.filter(|(config, info)| is_device(*config, *info)));
    }
    let ends = rest_configs[middle.len()..].iter().copied().zip(rest_infos[between.len()..].iter().copied());
    pairs.extend(ends);
    pairs
}

fn longest(configs: &[usize], infos: &[usize], is_device: &impl Fn(usize, usize) -> bool) -> Vec<(usize, usize)> {
    let width = infos.len() + 1;
    let mut lengths = vec![0u32; (configs.len() + 1) * width];
    for row in (0..configs.len()).rev() {
        for column in (0..infos.len()).rev() {
            lengths[row * width + column] = if is_device(configs[row], infos[column]) {
                lengths[(row + 1) * width + column + 1] + 1
            } else {
                lengths[(row + 1) * width + column].max(lengths[row * width + column + 1])
            };
        }
    }
    let (mut row, mut column) = (0, 0);
    let mut pairs = Vec::new();
    while row < configs.len() && column < infos.len() {
        if is_device(configs[row], infos[column]) {
            pairs.push((configs[row], infos[column]));
            (row, column) = (row + 1, column + 1);
        } else if lengths[(row + 1) * width + column] >= lengths[row * width + column + 1] {
            row += 1;
        } else {
            column += 1;
        }
    }
    pairs
}
