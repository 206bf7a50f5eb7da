//! Whether the SubDevice at a place matches its declaration; finds an alias or identification.

use alloc::vec::Vec;
use core::borrow::Borrow;

use ringcat_wire::address::RegisterAddress;

use super::resolution::{ConfigError, Resolution};
use super::steps::step;
use super::{ConfigAddress, IdentityMismatch, SubDeviceConfig};
use crate::info::SubDeviceInfo;
use crate::order::InOrder;

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

/// What identifies a SubDevice at any place: its alias, identification or a data word.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Identifier {
    Alias(u16),
    Identification(u16),
    DataWord(RegisterAddress, u16),
}

impl Identifier {
    /// The identifier that an address refers to; `None` for a position, and for alias 0, which means a position.
    const fn of(address: ConfigAddress) -> Option<Identifier> {
        match address {
            ConfigAddress::Alias { alias: 0, .. } | ConfigAddress::Position(_) => None,
            ConfigAddress::Alias { alias, .. } => Some(Identifier::Alias(alias)),
            ConfigAddress::Identification { value, .. } => Some(Identifier::Identification(value)),
            ConfigAddress::DataWord { register, value, .. } => Some(Identifier::DataWord(register, value)),
        }
    }

    /// All identifiers of a SubDevice.
    fn all_of(info: &SubDeviceInfo) -> impl Iterator<Item = Identifier> {
        let alias = (info.alias != 0).then_some(Identifier::Alias(info.alias));
        let words = info.data_words.iter().map(|word| Identifier::DataWord(word.register, word.value));
        alias.into_iter().chain(info.identification.map(Identifier::Identification)).chain(words)
    }
}

/// The SubDevices of a scan by their aliases, identifications and data words.
#[derive(Clone, Debug)]
pub struct SubDevicesByIdentifier {
    /// In the order of identifiers, then of the SubDevices.
    identifiers: Vec<(Identifier, usize)>,
}

impl SubDevicesByIdentifier {
    /// Reads the identifiers of the SubDevices of a scan.
    pub fn new(infos: &[impl Borrow<SubDeviceInfo>]) -> SubDevicesByIdentifier {
        let indexed = infos.iter().map(Borrow::borrow).enumerate();
        let mut identifiers: Vec<(Identifier, usize)> =
            indexed.flat_map(|(at, info)| Identifier::all_of(info).map(move |identifier| (identifier, at))).collect();
        identifiers.put_in_order();
        SubDevicesByIdentifier { identifiers }
    }

    /// Indices of all SubDevices with the alias, identification or data word of an address, in their order. An
    /// activation uses the SubDevice if it is the only one, and refuses the declaration if there are several. Empty for
    /// a position and for alias 0, which means a position.
    pub fn all(&self, address: ConfigAddress) -> impl Iterator<Item = usize> {
        let identifier = Identifier::of(address);
        let first = self.identifiers.partition_point(|(other, _)| Some(*other) < identifier);
        self.identifiers[first..].iter().take_while(move |(other, _)| Some(*other) == identifier).map(|(_, at)| *at)
    }

    /// The only SubDevice with the alias, identification or data word of an address; the first one for alias 0.
    pub(super) fn find(&self, address: ConfigAddress, infos: &[&SubDeviceInfo]) -> Result<Option<usize>, ConfigError> {
        if matches!(address, ConfigAddress::Alias { alias: 0, .. }) {
            return Ok((!infos.is_empty()).then_some(0));
        }
        step();
        let mut all = self.all(address);
        match (all.next(), all.next()) {
            (Some(first), Some(second)) => {
                let [first, second] = [first, second].map(|at| infos[at].position);
                Err(ConfigError::Ambiguous { address, first, second })
            }
            (first, _) => Ok(first),
        }
    }
}
