//! Whether the SubDevice at a place matches its declaration; finds an alias or identification.

use super::resolution::{ConfigError, Resolution};
use super::{ConfigAddress, IdentityMismatch, SubDeviceConfig};
use crate::info::SubDeviceInfo;

/// Resolution of a declaration with the SubDevice at `place`, an index in `infos`.
pub(super) fn at_place(
    configs: &[SubDeviceConfig],
    infos: &[&SubDeviceInfo],
    config: usize,
    place: Option<usize>,
) -> Resolution {
    let declared = &configs[config];
    let Some((index, info)) = place.and_then(|place| Some((place, infos.get(place)?))) else {
        return missing(declared, config, missing_error(declared, infos));
    };
    match declared.expected.mismatch(info) {
        None => Resolution::Found { config, info: index },
        Some(IdentityMismatch { field, expected, got }) => {
            let error = ConfigError::Mismatch { position: info.position, field, expected, got };
            missing(declared, config, error)
        }
    }
}

/// The error that no SubDevice is at the place.
pub(super) fn missing_error(declared: &SubDeviceConfig, infos: &[&SubDeviceInfo]) -> ConfigError {
    ConfigError::Missing { address: declared.address, present: infos.len() }
}

pub(super) fn missing(declared: &SubDeviceConfig, config: usize, error: ConfigError) -> Resolution {
    if declared.optional { Resolution::Absent { config, error } } else { Resolution::Failed { config, error } }
}

/// The only SubDevice with the alias or identification of an address; the first of the segment for alias 0.
pub(super) fn find_marked(address: ConfigAddress, infos: &[&SubDeviceInfo]) -> Result<Option<usize>, ConfigError> {
    if matches!(address, ConfigAddress::Alias { alias: 0, .. }) {
        return Ok((!infos.is_empty()).then_some(0));
    }
    let mut marked = infos.iter().enumerate().filter(|(_, info)| address.is_mark_of(info));
    match (marked.next(), marked.next()) {
        (Some((_, first)), Some((_, second))) => {
            Err(ConfigError::Ambiguous { address, first: first.position, second: second.position })
        }
        (first, _) => Ok(first.map(|(index, _)| index)),
    }
}
