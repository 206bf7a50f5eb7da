//! Which declaration belongs to which SubDevice of a scan.

use alloc::vec;
use alloc::vec::Vec;
use core::fmt;

use ringcat_wire::address::Position;

use super::{ConfigAddress, SubDeviceConfig};
use crate::info::SubDeviceInfo;

/// A field of the identity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum IdentityField {
    /// Vendor id.
    VendorId,
    /// Product code.
    ProductCode,
    /// Revision.
    Revision,
    /// Serial number.
    Serial,
}

impl fmt::Display for IdentityField {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            IdentityField::VendorId => "vendor id",
            IdentityField::ProductCode => "product code",
            IdentityField::Revision => "revision",
            IdentityField::Serial => "serial number",
        })
    }
}

/// Why a declaration has no SubDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ConfigError {
    /// Another SubDevice is at its place.
    Mismatch {
        /// Position of the SubDevice.
        position: Position,
        /// The field that differs.
        field: IdentityField,
        /// Declared value.
        expected: u32,
        /// Value of the SubDevice.
        got: u32,
    },
    /// No SubDevice is at its place.
    Missing {
        /// The place.
        address: ConfigAddress,
        /// SubDevices in the segment.
        present: usize,
    },
    /// Several SubDevices have the alias.
    AmbiguousAlias {
        /// The alias.
        alias: u16,
        /// Position of the first one.
        first: Position,
        /// Position of the second one.
        second: Position,
    },
    /// An earlier declaration has the SubDevice already.
    DeclaredTwice {
        /// Position of the SubDevice.
        position: Position,
        /// Number of the earlier declaration.
        first: usize,
    },
}

impl fmt::Display for ConfigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ConfigError::Mismatch { position, field, expected, got } => {
                write!(f, "SubDevice {position}: expected {field} {expected:#010x}, got {got:#010x}")
            }
            ConfigError::Missing { address, present } => {
                write!(f, "no SubDevice at {address}; {present} are present")
            }
            ConfigError::AmbiguousAlias { alias, first, second } => {
                write!(f, "alias {alias} belongs to SubDevice {first} and to SubDevice {second}")
            }
            ConfigError::DeclaredTwice { position, first } => {
                write!(f, "SubDevice {position} is declared by declaration {first} already")
            }
        }
    }
}

impl core::error::Error for ConfigError {}

/// What became of a declaration, or of a SubDevice that nobody declared. Both are named by their index in the slices
/// given to [`resolve`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Resolution {
    /// The declaration has its SubDevice.
    Found {
        /// The declaration.
        config: usize,
        /// The SubDevice.
        info: usize,
    },
    /// An optional SubDevice is not there.
    Absent {
        /// The declaration.
        config: usize,
    },
    /// The declaration has no SubDevice though it needs one.
    Failed {
        /// The declaration.
        config: usize,
        /// Why.
        error: ConfigError,
    },
    /// Nobody declared the SubDevice.
    Extra {
        /// The SubDevice.
        info: usize,
    },
}

/// Two SubDevices with one alias.
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
        write!(f, "SubDevice {} and SubDevice {} have the same alias {}", self.first, self.second, self.alias)
    }
}

/// All SubDevices that have the alias of an earlier one.
pub fn duplicate_aliases(infos: &[SubDeviceInfo]) -> Vec<DuplicateAlias> {
    let mut by_alias: Vec<&SubDeviceInfo> = infos.iter().filter(|info| info.alias != 0).collect();
    by_alias.sort_by_key(|info| info.alias);
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

/// Finds the SubDevice of each declaration: one [`Resolution`] per declaration in their order, then the SubDevices that
/// nobody declared.
///
/// Where an optional SubDevice is absent, declarations by position that come behind it are looked for one place
/// nearer to the start. With several ways to leave optional ones out, the one with the fewest errors counts.
pub fn resolve(configs: &[SubDeviceConfig], infos: &[SubDeviceInfo]) -> Vec<Resolution> {
    let mut resolutions = vec![None; configs.len()];
    let by_position = by_position(configs);
    let skips = Skips::new(&by_position, configs, infos);
    let mut absent = 0;
    for (n, (position, config)) in by_position.iter().enumerate() {
        let skip = configs[*config].optional && skips.better_absent(n, absent);
        resolutions[*config] = Some(if skip {
            absent += 1;
            Resolution::Absent { config: *config }
        } else {
            at_place(configs, infos, *config, position.checked_sub(absent))
        });
    }
    for (config, resolution) in resolutions.iter_mut().enumerate() {
        if let ConfigAddress::Alias { alias, offset } = configs[config].address
            && alias != 0
        {
            *resolution = Some(by_alias(configs, infos, config, alias, offset));
        }
    }
    claim(resolutions.into_iter().flatten().collect(), infos)
}

/// Declarations by position, in that order: position and index.
fn by_position(configs: &[SubDeviceConfig]) -> Vec<(usize, usize)> {
    let mut found: Vec<_> = configs
        .iter()
        .enumerate()
        .filter_map(|(index, config)| match config.address {
            ConfigAddress::Position(position) | ConfigAddress::Alias { alias: 0, offset: position } => {
                Some((usize::from(position), index))
            }
            ConfigAddress::Alias { .. } => None,
        })
        .collect();
    found.sort_unstable();
    found
}

/// For declaration n of those by position and `absent` optional ones left out before it: the fewest errors that are
/// still to come.
struct Skips {
    /// Cost of taking declaration n as present, and as absent.
    costs: Vec<[u32; 2]>,
    width: usize,
}

impl Skips {
    fn new(by_position: &[(usize, usize)], configs: &[SubDeviceConfig], infos: &[SubDeviceInfo]) -> Skips {
        let optional = by_position.iter().filter(|(_, config)| configs[*config].optional).count();
        let width = optional + 1;
        let mut costs = vec![[0, u32::MAX]; by_position.len() * width];
        let mut behind = vec![0u32; width];
        for (n, (position, config)) in by_position.iter().enumerate().rev() {
            let config = &configs[*config];
            let mut here = vec![0u32; width];
            for absent in 0..width {
                let info = position.checked_sub(absent).and_then(|place| infos.get(place));
                let fits = info.is_some_and(|info| config.expected.mismatch(&info.identity).is_none());
                let present = behind[absent].saturating_add(u32::from(!fits));
                let skipped = match behind.get(absent + 1) {
                    Some(cost) if config.optional => *cost,
                    _ => u32::MAX,
                };
                costs[n * width + absent] = [present, skipped];
                here[absent] = present.min(skipped);
            }
            behind = here;
        }
        Skips { costs, width }
    }

    fn better_absent(&self, n: usize, absent: usize) -> bool {
        let [present, skipped] = self.costs[n * self.width + absent];
        skipped < present
    }
}

fn at_place(configs: &[SubDeviceConfig], infos: &[SubDeviceInfo], config: usize, place: Option<usize>) -> Resolution {
    let declared = &configs[config];
    let Some((index, info)) = place.and_then(|place| Some((place, infos.get(place)?))) else {
        let error = ConfigError::Missing { address: declared.address, present: infos.len() };
        return missing(declared, config, error);
    };
    match declared.expected.mismatch(&info.identity) {
        None => Resolution::Found { config, info: index },
        Some((field, expected, got)) => {
            let error = ConfigError::Mismatch { position: info.position, field, expected, got };
            missing(declared, config, error)
        }
    }
}

fn missing(declared: &SubDeviceConfig, config: usize, error: ConfigError) -> Resolution {
    if declared.optional { Resolution::Absent { config } } else { Resolution::Failed { config, error } }
}

fn by_alias(
    configs: &[SubDeviceConfig],
    infos: &[SubDeviceInfo],
    config: usize,
    alias: u16,
    offset: u16,
) -> Resolution {
    let mut bearers = infos.iter().enumerate().filter(|(_, info)| info.alias == alias);
    match (bearers.next(), bearers.next()) {
        (Some((_, first)), Some((_, second))) => {
            let error = ConfigError::AmbiguousAlias { alias, first: first.position, second: second.position };
            Resolution::Failed { config, error }
        }
        (first, _) => {
            let place = first.map(|(index, _)| index + usize::from(offset));
            at_place(configs, infos, config, place)
        }
    }
}

/// Gives each SubDevice to one declaration only and appends those that nobody declared.
fn claim(mut resolutions: Vec<Resolution>, infos: &[SubDeviceInfo]) -> Vec<Resolution> {
    let mut owners: Vec<Option<usize>> = vec![None; infos.len()];
    for resolution in &mut resolutions {
        if let Resolution::Found { config, info } = *resolution {
            match owners[info] {
                None => owners[info] = Some(config),
                Some(first) => {
                    let error = ConfigError::DeclaredTwice { position: infos[info].position, first };
                    *resolution = Resolution::Failed { config, error };
                }
            }
        }
    }
    let extra = owners.iter().enumerate().filter(|(_, owner)| owner.is_none());
    resolutions.extend(extra.map(|(info, _)| Resolution::Extra { info }));
    resolutions
}
