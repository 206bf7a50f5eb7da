//! Whether the SubDevice at a place matches its declaration; finds an alias or identification.

use alloc::vec::Vec;

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

/// The SubDevices by their aliases, identifications and data words, in their order.
pub(super) struct Marked {
    aliases: Vec<(u16, usize)>,
    identifications: Vec<(u16, usize)>,
    data_words: Vec<((RegisterAddress, u16), usize)>,
}

impl Marked {
    pub(super) fn new(infos: &[&SubDeviceInfo]) -> Marked {
        let indexed = || infos.iter().enumerate();
        let mut aliases: Vec<(u16, usize)> =
            indexed().filter(|(_, info)| info.alias != 0).map(|(at, info)| (info.alias, at)).collect();
        let mut identifications: Vec<(u16, usize)> =
            indexed().filter_map(|(at, info)| Some((info.identification?, at))).collect();
        let words = |(at, info): (usize, &&SubDeviceInfo)| {
            info.data_words.iter().map(move |word| ((word.register, word.value), at)).collect::<Vec<_>>()
        };
        let mut data_words: Vec<((RegisterAddress, u16), usize)> = indexed().flat_map(words).collect();
        aliases.put_in_order();
        identifications.put_in_order();
        data_words.put_in_order();
        Marked { aliases, identifications, data_words }
    }

    /// The only SubDevice with the alias, identification or data word of an address; the first one for alias 0.
    pub(super) fn find(&self, address: ConfigAddress, infos: &[&SubDeviceInfo]) -> Result<Option<usize>, ConfigError> {
        let found = match address {
            ConfigAddress::Alias { alias: 0, .. } => return Ok((!infos.is_empty()).then_some(0)),
            ConfigAddress::Alias { alias, .. } => first_two(&self.aliases, alias),
            ConfigAddress::Identification { value, .. } => first_two(&self.identifications, value),
            ConfigAddress::DataWord { register, value, .. } => first_two(&self.data_words, (register, value)),
            ConfigAddress::Position(_) => return Ok(None),
        };
        step();
        match found {
            [Some(first), Some(second)] => {
                let [first, second] = [first, second].map(|at| infos[at].position);
                Err(ConfigError::Ambiguous { address, first, second })
            }
            [first, _] => Ok(first),
        }
    }
}

/// The first two with a mark, of marks in order.
fn first_two<M: Ord + Copy>(marks: &[(M, usize)], mark: M) -> [Option<usize>; 2] {
    let first = marks.partition_point(|(other, _)| *other < mark);
    [first, first + 1].map(|at| marks.get(at).filter(|(other, _)| *other == mark).map(|(_, at)| *at))
}
