//! Which found SubDevice is which declared one: the longest common sequence of devices, then devices that moved.

use std::collections::BTreeMap;

use ringcat_engine::config::{ConfigAddress, Resolution, SubDeviceConfig, SubDevicesByIdentifier, resolve};
use ringcat_engine::info::SubDeviceInfo;

use super::alike::{Alike, DeviceKey, device, is_device, keys_of};
use super::difference::StatedProperties;
use super::moves::moves;
use crate::configuration::Configuration;

/// Maximum number of compared pairs between the common begin and end; beyond it SubDevices are compared by position.
const MAX_PAIRS: usize = 1 << 24;
/// Maximum number of SubDevices with one identifier that are tried for a declaration.
const MAX_IDENTICAL: usize = 64;

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
pub(super) fn align(configuration: &Configuration, found: &[SubDeviceInfo], stated: &[StatedProperties]) -> Vec<Place> {
    let configs = &configuration.declaration.subdevices;
    let mut info_of: Vec<Option<usize>> = vec![None; configs.len()];
    let mut moved = vec![false; configs.len()];
    let mut taken = vec![false; found.len()];
    for (config, info) in activated(configs, found, stated) {
        (info_of[config], taken[info]) = (Some(info), true);
    }
    by_mark(configs, (found, stated), &mut info_of, &mut taken);
    let alike = Alike::new(configs, found, stated);
    let mut declared: Vec<usize> = (0..configs.len()).filter(|config| by_position(&configs[*config])).collect();
    declared.sort_by_key(|config| position(&configs[*config]));
    let open: Vec<usize> = declared.iter().copied().filter(|config| info_of[*config].is_none()).collect();
    let free: Vec<usize> = (0..found.len()).filter(|info| !taken[*info]).collect();
    for (config, info) in common(&open, &free, &alike) {
        (info_of[config], taken[info]) = (Some(info), true);
    }
    // What is missing here and additional there has moved. A serial number that the file demands is found anywhere.
    for config in declared.iter().copied().filter(|config| info_of[*config].is_none()).collect::<Vec<_>>() {
        if let Some(info) = alike.serial_at(config).filter(|info| !taken[*info] && alike.is_own(config, *info)) {
            (info_of[config], taken[info], moved[config]) = (Some(info), true, true);
        }
    }
    let mut by_device = ByDevice::new(found);
    let has_serial = |config: usize| configs[config].expected.serial.is_some();
    let is_open = |config: &usize| info_of[*config].is_none() && !has_serial(*config);
    let mut open: Vec<usize> = declared.iter().copied().filter(is_open).collect();
    open.sort_by_key(|config| configs[*config].optional);
    for config in open {
        if let Some(info) = by_device.first(device(&configs[config], stated.get(config)), &taken) {
            (info_of[config], taken[info], moved[config]) = (Some(info), true, true);
        }
    }
    // Another device in the place of the declared one, between the same neighbours.
    let gaps: Vec<usize> = declared.iter().copied().filter(|config| info_of[*config].is_none()).collect();
    let before = before(&declared, configs.len());
    for config in gaps {
        let info = match before[config] {
            None => Some(0),
            Some(other) => info_of[other].map(|info| info + 1),
        };
        if let Some(info) = info.filter(|info| *info < found.len() && !taken[*info] && !alike.is_claimed(config, *info))
        {
            (info_of[config], taken[info]) = (Some(info), true);
        }
    }
    name_moves(configs, &info_of, &mut moved);
    if !taken.contains(&false) && !moved.contains(&true) {
        exact_positions(configs, &info_of, &mut moved);
    }
    in_order(&info_of, &moved, &taken)
}

/// Marks the SubDevices that are declared by position and were found at another place.
fn name_moves(configs: &[SubDeviceConfig], info_of: &[Option<usize>], moved: &mut [bool]) {
    let mut both: Vec<(usize, usize)> = (0..configs.len())
        .filter(|config| by_position(&configs[*config]))
        .filter_map(|config| Some((config, info_of[config]?)))
        .collect();
    both.sort_by_key(|(config, _)| position(&configs[*config]));
    let bus: Vec<usize> = both.iter().map(|(_, info)| *info).collect();
    for ((config, _), change) in both.into_iter().zip(moves(&bus)) {
        moved[config] = change.is_some();
    }
}

/// Where each SubDevice has its counterpart in the order of positions, each has to be at its position: the file may
/// have gaps between them, and SubDevices that are declared by alias may have moved between them.
fn exact_positions(configs: &[SubDeviceConfig], info_of: &[Option<usize>], moved: &mut [bool]) {
    if configs.iter().any(|config| config.group.is_some()) || info_of.contains(&None) {
        return;
    }
    let placed = (0..configs.len()).filter(|config| by_position(&configs[*config]));
    let mut placed: Vec<(usize, usize, usize)> =
        placed.filter_map(|config| Some((position(&configs[config]), info_of[config]?, config))).collect();
    placed.sort_unstable();
    // Of neighbours that are shifted by as much, the first one stands for all.
    let mut before = 0;
    for (position, info, config) in placed {
        let shift = info as isize - position as isize;
        moved[config] |= shift != 0 && shift != before;
        before = shift;
    }
}

fn in_order(info_of: &[Option<usize>], moved: &[bool], taken: &[bool]) -> Vec<Place> {
    let places: Vec<Place> = info_of
        .iter()
        .enumerate()
        .map(|(config, info)| match info {
            Some(info) => Place::Both { config, info: *info, moved: moved[config] },
            None => Place::Missing { config },
        })
        .collect();
    // The declared SubDevice behind which an additional one is named: the last one in the file of those before it.
    let mut behind = vec![0; taken.len() + 1];
    for (at, place) in places.iter().enumerate() {
        if let Place::Both { info, moved: false, .. } = *place {
            behind[info + 1] = at + 1;
        }
    }
    let mut last = 0;
    let mut additional: Vec<(usize, usize)> = Vec::new();
    for (info, at) in behind.into_iter().take(taken.len()).enumerate() {
        last = last.max(at);
        if !taken[info] {
            additional.push((last, info));
        }
    }
    let mut additional = additional.into_iter().peekable();
    let mut ordered = Vec::with_capacity(places.len() + additional.len());
    for (at, place) in places.into_iter().enumerate() {
        while let Some((_, info)) = additional.next_if(|(behind, _)| *behind <= at) {
            ordered.push(Place::Additional { info });
        }
        ordered.push(place);
    }
    ordered.extend(additional.map(|(_, info)| Place::Additional { info }));
    ordered
}

/// The declaration before each one: of those with a lower index that with the last position.
fn before(declared: &[usize], count: usize) -> Vec<Option<usize>> {
    let mut ranks = vec![None; count];
    for (rank, config) in declared.iter().enumerate() {
        ranks[*config] = Some(rank);
    }
    let mut last: Option<usize> = None;
    let before_each = ranks.into_iter().map(|rank| {
        let before = last.map(|rank| declared[rank]);
        last = last.max(rank);
        before
    });
    before_each.collect()
}

/// The SubDevices that were found, by what a declaration can say of their device.
struct ByDevice {
    /// In reverse order. Those at the end of a list may have been taken meanwhile.
    places: BTreeMap<DeviceKey, Vec<usize>>,
}

impl ByDevice {
    fn new(found: &[SubDeviceInfo]) -> ByDevice {
        let mut places: BTreeMap<DeviceKey, Vec<usize>> = BTreeMap::new();
        for (at, info) in found.iter().enumerate().rev() {
            for key in keys_of(info) {
                places.entry(key).or_default().push(at);
            }
        }
        ByDevice { places }
    }

    /// The first one of a device that is not taken.
    fn first(&mut self, key: DeviceKey, taken: &[bool]) -> Option<usize> {
        let places = self.places.get_mut(&key)?;
        while places.last().is_some_and(|at| taken[*at]) {
            places.pop();
        }
        places.last().copied()
    }
}

/// Whether a SubDevice is declared by its position.
pub(super) const fn by_position(config: &SubDeviceConfig) -> bool {
    matches!(config.address, ConfigAddress::Position(_) | ConfigAddress::Alias { alias: 0, .. })
}

/// The position of a SubDevice that is declared by it.
pub(super) fn position(config: &SubDeviceConfig) -> usize {
    match config.address {
        ConfigAddress::Position(position) | ConfigAddress::Alias { alias: 0, offset: position } => position.into(),
        _ => usize::MAX,
    }
}

/// SubDevices that are declared by alias, identification or data word. If several have one identifier, the activation
/// uses none of them; here the first one that is the declared device is compared.
fn by_mark(
    configs: &[SubDeviceConfig],
    (found, stated): (&[SubDeviceInfo], &[StatedProperties]),
    info_of: &mut [Option<usize>],
    taken: &mut [bool],
) {
    let by_identifier = SubDevicesByIdentifier::new(found);
    for (config, declared) in configs.iter().enumerate() {
        if info_of[config].is_some() {
            continue;
        }
        let heads = by_identifier.all(declared.address);
        let places = heads.map(|head| head + declared.address.offset()).take(MAX_IDENTICAL);
        let free: Vec<usize> = places.filter(|info| taken.get(*info) == Some(&false)).collect();
        let own = free.iter().copied().find(|info| is_device(declared, stated.get(config), &found[*info]));
        if let Some(info) = own.or(free.first().copied()) {
            (info_of[config], taken[info]) = (Some(info), true);
        }
    }
}

/// The pairs of an activation that refuses no declaration, in a file with optional SubDevices: the engine decides which
/// of two SubDevices of one type is absent. Empty if the engine would take another device than the file states.
fn activated(configs: &[SubDeviceConfig], found: &[SubDeviceInfo], stated: &[StatedProperties]) -> Vec<(usize, usize)> {
    if configs.iter().all(|config| !config.optional) {
        return Vec::new();
    }
    let mut pairs = Vec::new();
    for resolution in resolve(configs, found) {
        match resolution {
            Resolution::Found { config, info } if is_device(&configs[config], stated.get(config), &found[info]) => {
                pairs.push((config, info));
            }
            Resolution::Found { .. } | Resolution::Failed { .. } => return Vec::new(),
            Resolution::Absent { .. } | Resolution::Extra { .. } => {}
        }
    }
    pairs
}

/// The best common sequence; by position where the networks are too large and too different for it.
fn common(configs: &[usize], infos: &[usize], alike: &Alike<'_>) -> Vec<(usize, usize)> {
    let is_best = |(config, info): &(usize, usize)| alike.is_best(*config, *info);
    let both = configs.iter().copied().zip(infos.iter().copied());
    let head = both.take_while(is_best).count();
    let (rest_configs, rest_infos) = (&configs[head..], &infos[head..]);
    let both = rest_configs.iter().rev().copied().zip(rest_infos.iter().rev().copied());
    let tail = both.take_while(is_best).count();
    let (middle, between) = (&rest_configs[..rest_configs.len() - tail], &rest_infos[..rest_infos.len() - tail]);
    let mut pairs: Vec<(usize, usize)> = configs.iter().copied().zip(infos.iter().copied()).take(head).collect();
    if middle.len().saturating_mul(between.len()) <= MAX_PAIRS {
        pairs.extend(best(middle, between, &|config, info| alike.degree(config, info)));
    } else {
        let same = middle.iter().copied().zip(between.iter().copied());
        pairs.extend(same.filter(|(config, info)| alike.degree(*config, *info) > 0));
    }
    let ends = rest_configs[middle.len()..].iter().copied().zip(rest_infos[between.len()..].iter().copied());
    pairs.extend(ends);
    pairs
}

/// The sequence with the most pairs that have all that the file demands, then with the most pairs of the same device;
/// of several, the one that leaves the fewest mandatory declarations without a SubDevice, then the one in which each
/// SubDevice is at its own place.
fn best(configs: &[usize], infos: &[usize], degree: &impl Fn(usize, usize) -> u32) -> Vec<(usize, usize)> {
    let width = infos.len() + 1;
    let mut sums = vec![0u32; (configs.len() + 1) * width];
    for row in (0..configs.len()).rev() {
        for column in (0..infos.len()).rev() {
            let both = sums[(row + 1) * width + column + 1] + degree(configs[row], infos[column]);
            let one = sums[(row + 1) * width + column].max(sums[row * width + column + 1]);
            sums[row * width + column] = both.max(one);
        }
    }
    let in_place = || configs.iter().copied().zip(infos.iter().copied());
    let degrees = in_place().map(|(config, info)| degree(config, info));
    if configs.len() == infos.len() && degrees.sum::<u32>() == sums[0] {
        return in_place().filter(|(config, info)| degree(*config, *info) > 0).collect();
    }
    let (mut row, mut column) = (0, 0);
    let mut pairs = Vec::new();
    while row < configs.len() && column < infos.len() {
        let (below, right) = (sums[(row + 1) * width + column], sums[row * width + column + 1]);
        let degree = degree(configs[row], infos[column]);
        if degree > 0 && sums[row * width + column] == sums[(row + 1) * width + column + 1] + degree {
            pairs.push((configs[row], infos[column]));
            (row, column) = (row + 1, column + 1);
        } else if below >= right {
            row += 1;
        } else {
            column += 1;
        }
    }
    pairs
}
