//! Assigns declarations to the SubDevices of a scan.

use alloc::vec;
use alloc::vec::Vec;
use core::borrow::Borrow;
use core::fmt;

use ringcat_wire::address::Position;

use super::groups::{self, groups};
use super::matching::{SubDevicesByIdentifier, at_place, missing_error};
use super::resolution::{ConfigError, Resolution};
use super::steps::step;
use super::{ConfigAddress, SubDeviceConfig};
use crate::declared::SubDeviceId;
use crate::info::SubDeviceInfo;
use crate::order::InOrder;

/// Limit up to which all combinations are compared: declarations by position times optional ones among them. Each
/// combination takes a byte.
const MAX_COMBINATIONS: usize = 1 << 24;

/// Two SubDevices with the same alias.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DuplicateAlias {
    /// The alias.
    pub alias: u16,
    /// Position of the first SubDevice that has it.
    pub first: Position,
    /// Position of another SubDevice that has it.
    pub second: Position,
}

impl fmt::Display for DuplicateAlias {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "positions {} and {} have the same alias {}", self.first, self.second, self.alias)
    }
}

/// All SubDevices with the alias of an earlier one.
pub fn duplicate_aliases(infos: &[SubDeviceInfo]) -> Vec<DuplicateAlias> {
    let mut by_alias: Vec<&SubDeviceInfo> = infos.iter().filter(|info| info.alias != 0).collect();
    by_alias.put_in_order_by_key(|info| info.alias);
    let mut duplicates = Vec::new();
    for group in by_alias.chunk_by(|a, b| a.alias == b.alias) {
        let first = group[0].position;
        duplicates.extend(group[1..].iter().map(|info| DuplicateAlias {
            alias: info.alias,
            first,
            second: info.position,
        }));
    }
    duplicates
}

/// Finds the SubDevice of each declaration: one [`Resolution`] per declaration in their order, then the SubDevices
/// without a declaration.
///
/// Groups are found first, at any place; positions count the SubDevices that belong to no group. If an optional
/// SubDevice is absent, the following declarations by position are searched one place nearer to the start. Of several
/// combinations of absent optional SubDevices, that with the fewest errors is taken. With more than 2^24 combinations
/// an optional SubDevice counts as absent where it does not fit. Alias 0 counts all SubDevices.
pub fn resolve(configs: &[SubDeviceConfig], infos: &[impl Borrow<SubDeviceInfo>]) -> Vec<Resolution> {
    let infos: Vec<&SubDeviceInfo> = infos.iter().map(Borrow::borrow).collect();
    let infos = &infos[..];
    let by_identifier = SubDevicesByIdentifier::new(infos);
    let mut resolutions = vec![None; configs.len()];
    for members in groups(configs) {
        groups::find(configs, &members, (infos, &by_identifier), &mut resolutions);
    }
    let mut is_grouped = vec![false; infos.len()];
    for resolution in &resolutions {
        step();
        if let Some(Resolution::Found { info, .. }) = *resolution {
            is_grouped[info] = true;
        }
    }
    let places = (0..infos.len()).filter(|at| !is_grouped[*at]).collect();
    let segment = Segment { infos, places };
    let by_position = by_position(configs);
    let absences = Absences::new(&by_position, configs, &segment);
    let mut absent = 0;
    for (n, (position, config)) in by_position.iter().enumerate() {
        let declared = &configs[*config];
        let fits = || segment.fits(declared, *position, absent);
        let is_absent = declared.optional && absences.is_better(n, absent, fits);
        resolutions[*config] = Some(if is_absent {
            absent += 1;
            Resolution::Absent { config: *config, error: missing_error(declared, infos) }
        } else {
            at_place(configs, infos, *config, position.checked_sub(absent).and_then(|place| segment.at(place)))
        });
    }
    for (config, resolution) in resolutions.iter_mut().enumerate().filter(|(_, resolution)| resolution.is_none()) {
        *resolution = Some(resolve_identifier(configs, infos, &by_identifier, config));
    }
    claim(resolutions.into_iter().flatten().collect(), infos)
}

/// The SubDevices that positions count.
struct Segment<'a> {
    infos: &'a [&'a SubDeviceInfo],
    places: Vec<usize>,
}

impl Segment<'_> {
    /// Index of the SubDevice at a position.
    fn at(&self, position: usize) -> Option<usize> {
        self.places.get(position).copied()
    }

    /// Whether a declaration fits its place with this number of absent ones before it.
    fn fits(&self, config: &SubDeviceConfig, position: usize, absent: usize) -> bool {
        let info = position.checked_sub(absent).and_then(|place| self.infos.get(self.at(place)?));
        info.is_some_and(|info| config.expected.mismatch(info).is_none())
    }
}

/// Declarations by position, sorted: position and index.
fn by_position(configs: &[SubDeviceConfig]) -> Vec<(usize, usize)> {
    let mut found: Vec<_> = configs
        .iter()
        .enumerate()
        .filter(|(_, config)| config.group.is_none())
        .filter_map(|(index, config)| match config.address {
            ConfigAddress::Position(position) => Some((usize::from(position), index)),
            ConfigAddress::Alias { .. } | ConfigAddress::Identification { .. } | ConfigAddress::DataWord { .. } => None,
        })
        .collect();
    found.put_in_order();
    found
}

/// Which optional SubDevices count as absent.
enum Absences {
    /// Whether absence gives fewer errors: by declaration of those by position, and by the number of absent ones before
    /// it.
    Best { is_better: Vec<bool>, width: usize },
    /// Too many combinations: an optional SubDevice that does not fit its place is absent.
    Simple,
}

impl Absences {
    fn new(by_position: &[(usize, usize)], configs: &[SubDeviceConfig], segment: &Segment<'_>) -> Absences {
        let optional = by_position.iter().filter(|(_, config)| configs[*config].optional).count();
        let width = optional + 1;
        if by_position.len().saturating_mul(width) > MAX_COMBINATIONS {
            return Absences::Simple;
        }
        let mut is_better = vec![false; by_position.len() * width];
        // The smallest number of errors behind a declaration, by the number of absent ones up to it.
        let mut behind = vec![0u32; width];
        for (n, (position, config)) in by_position.iter().enumerate().rev() {
            let config = &configs[*config];
            let mut here = vec![0u32; width];
            for absent in 0..width {
                step();
                let present_cost = behind[absent].saturating_add(u32::from(!segment.fits(config, *position, absent)));
                let absent_cost = match behind.get(absent + 1) {
                    Some(cost) if config.optional => *cost,
                    _ => u32::MAX,
                };
                is_better[n * width + absent] = absent_cost < present_cost;
                here[absent] = present_cost.min(absent_cost);
            }
            behind = here;
        }
        Absences::Best { is_better, width }
    }

    /// Whether optional declaration n of those by position counts as absent.
    fn is_better(&self, n: usize, absent: usize, fits: impl FnOnce() -> bool) -> bool {
        match self {
            Absences::Best { is_better, width } => is_better[n * width + absent],
            Absences::Simple => !fits(),
        }
    }
}

/// Finds a SubDevice by alias or identification, or by its exact position with alias 0.
fn resolve_identifier(
    configs: &[SubDeviceConfig],
    infos: &[&SubDeviceInfo],
    by_identifier: &SubDevicesByIdentifier,
    config: usize,
) -> Resolution {
    let address = configs[config].address;
    match by_identifier.find(address, infos) {
        Ok(place) => at_place(configs, infos, config, place.map(|place| place + address.offset())),
        Err(error) => Resolution::Failed { config, error },
    }
}

/// Gives each SubDevice to one declaration only, and appends the SubDevices without a declaration.
fn claim(mut resolutions: Vec<Resolution>, infos: &[&SubDeviceInfo]) -> Vec<Resolution> {
    let mut owners: Vec<Option<usize>> = vec![None; infos.len()];
    for resolution in &mut resolutions {
        if let Resolution::Found { config, info } = *resolution {
            match owners[info] {
                None => owners[info] = Some(config),
                Some(first) => {
                    let error =
                        ConfigError::DeclaredTwice { position: infos[info].position, first: SubDeviceId(first) };
                    *resolution = Resolution::Failed { config, error };
                }
            }
        }
    }
    let extra = owners.iter().enumerate().filter(|(_, owner)| owner.is_none());
    resolutions.extend(extra.map(|(info, _)| Resolution::Extra { info }));
    resolutions
}
