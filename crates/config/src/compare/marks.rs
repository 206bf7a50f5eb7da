//! Which differences of places and identities prevent OP: the engine's own resolution of the declaration decides.

use ringcat_engine::config::{ConfigError, Resolution, SubDeviceConfig, resolve};
use ringcat_engine::info::SubDeviceInfo;
use ringcat_engine::main_device::Required;

use super::align::{Place, by_position};
use crate::configuration::Configuration;

/// What an activation does with the SubDevices that were found.
pub(super) struct Marks {
    /// By declaration.
    resolutions: Vec<Resolution>,
    required: Required,
    /// The last SubDevice whose declaration fails because it is at another position than declared.
    last_shifted: Option<usize>,
}

impl Marks {
    pub(super) fn of(configuration: &Configuration, found: &[SubDeviceInfo], places: &[Place]) -> Marks {
        let configs = &configuration.declaration.subdevices;
        let required = configuration.declaration.required;
        let mut marks = Marks { resolutions: resolve(configs, found), required, last_shifted: None };
        let shifted = places.iter().filter_map(|place| match *place {
            Place::Both { config, info, moved: false } => {
                marks.is_shifted(config, &configs[config], &found[info]).then_some(info)
            }
            _ => None,
        });
        marks.last_shifted = shifted.max();
        marks
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

    /// Whether a SubDevice that is missing prevents OP. With nothing required it does not: the engine finds the
    /// SubDevices behind it by their identities.
    pub(super) fn misses(&self, config: usize, declared: &SubDeviceConfig) -> bool {
        self.fails(config) || (!declared.optional && self.required != Required::Nothing)
    }

    /// Whether an additional SubDevice takes the position of a declared one, or moves those behind it.
    pub(super) fn shifts(&self, info: usize) -> bool {
        self.required != Required::Nothing && self.last_shifted.is_some_and(|last| info < last)
    }

    /// Whether a declaration by position fails, and not because of what its SubDevice is.
    fn is_shifted(&self, config: usize, declared: &SubDeviceConfig, info: &SubDeviceInfo) -> bool {
        let is_own = match self.resolutions.get(config) {
            Some(Resolution::Failed { error: ConfigError::Mismatch { position, .. }, .. }) => {
                *position == info.position
            }
            Some(Resolution::Failed { .. }) => false,
            _ => return false,
        };
        by_position(declared) && declared.group.is_none() && !is_own
    }
}
