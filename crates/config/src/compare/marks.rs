//! Which differences of places and identities prevent OP: the engine's own resolution of the declaration decides.

use ringcat_engine::config::{ConfigError, Resolution, SubDeviceConfig, resolve};
use ringcat_engine::info::SubDeviceInfo;
use ringcat_engine::main_device::Required;

use super::align::{Place, by_position};
use crate::configuration::Configuration;

/// What an activation does with the SubDevices that were found.
pub(super) struct Marks {
    /// Results of the engine's resolution.
    resolutions: Vec<Resolution>,
    required: Required,
    /// The SubDevices whose declarations fail because they are at other positions than declared: index in the file,
    /// index in the scan.
    shifted: Vec<(usize, usize)>,
}

impl Marks {
    pub(super) fn of(configuration: &Configuration, found: &[SubDeviceInfo], places: &[Place]) -> Marks {
        let configs = &configuration.declaration.subdevices;
        let required = configuration.declaration.required;
        let mut marks = Marks { resolutions: resolve(configs, found), required, shifted: Vec::new() };
        let shifted = places.iter().filter_map(|place| match *place {
            Place::Both { config, info, moved: false } => {
                marks.is_shifted(config, &configs[config], &found[info]).then_some((config, info))
            }
            _ => None,
        });
        marks.shifted = shifted.collect();
        marks
    }

    /// The declarations without a SubDevice, each with the reason.
    pub(super) fn errors(&self) -> impl Iterator<Item = (usize, &ConfigError)> {
        self.resolutions.iter().filter_map(|resolution| match resolution {
            Resolution::Failed { config, error } | Resolution::Absent { config, error } => Some((*config, error)),
            Resolution::Found { .. } | Resolution::Extra { .. } => None,
        })
    }

    /// The first declaration with which the activation fails.
    pub(super) fn first_failing(&self) -> Option<(usize, &ConfigError)> {
        self.errors().find(|(config, _)| self.fails(*config))
    }

    /// The SubDevices whose declarations fail because of their positions, in the order of the file.
    pub(super) fn shifted(&self) -> impl Iterator<Item = (usize, usize)> {
        self.shifted.iter().copied()
    }

    /// Whether the activation fails because of this declaration; never with nothing required.
    pub(super) fn fails(&self, config: usize) -> bool {
        match (self.resolutions.get(config), self.required) {
            (_, Required::Nothing) => false,
            (Some(Resolution::Failed { .. }), _) => true,
            (Some(Resolution::Absent { .. }), required) => required == Required::All,
            _ => false,
        }
    }

    /// Whether the activation goes on without the SubDevice of this declaration, also if the SubDevice is at another
    /// position.
    pub(super) fn is_absent(&self, config: usize) -> bool {
        matches!(self.resolutions.get(config), Some(Resolution::Absent { .. })) && !self.fails(config)
    }

    /// Whether a SubDevice that is missing prevents OP: unless it is optional, and no declaration behind it is shifted.
    /// Never if the engine finds all declared SubDevices: then the engine takes another SubDevice as the absent one.
    pub(super) fn misses(&self, config: usize, declared: &SubDeviceConfig) -> bool {
        let shifts = self.shifted.iter().any(|(other, _)| *other > config);
        self.first_failing().is_some() && (self.fails(config) || !declared.optional || shifts)
    }

    /// Whether an additional SubDevice takes the position of a declared one, or moves those behind it.
    pub(super) fn shifts(&self, info: usize) -> bool {
        self.shifted.iter().any(|(_, last)| info < *last)
    }

    /// Whether a declaration by position fails, and not because of what its SubDevice is.
    fn is_shifted(&self, config: usize, declared: &SubDeviceConfig, info: &SubDeviceInfo) -> bool {
        let is_own = match self.resolutions.get(config) {
            Some(Resolution::Failed { error, .. } | Resolution::Absent { error, .. }) if self.fails(config) => {
                matches!(error, ConfigError::Mismatch { position, .. } if *position == info.position)
            }
            _ => return false,
        };
        by_position(declared) && declared.group.is_none() && !is_own
    }
}
