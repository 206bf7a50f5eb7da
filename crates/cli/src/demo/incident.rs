//! Incidents of the segment in the demonstration, and their cost.

use ringcat::sim::cable::{CableId, DeviceIndex};
use ringcat::text::Names;

/// What happens to the segment.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Incident {
    /// Nothing.
    Calm,
    /// The cable between two SubDevices is cut.
    Cut {
        /// The cable.
        cable: CableId,
        /// Positions of its ends.
        ends: (usize, usize),
    },
    /// The cable that was cut is repaired.
    Heal {
        /// The cable.
        cable: CableId,
        /// Positions of its ends.
        ends: (usize, usize),
    },
    /// A SubDevice loses its power.
    PowerOff {
        /// The device.
        device: DeviceIndex,
        /// Its position.
        position: usize,
    },
    /// The SubDevice has power again.
    PowerOn {
        /// The device.
        device: DeviceIndex,
        /// Its position.
        position: usize,
    },
}

impl Incident {
    /// Cable edges: each may cost one cycle.
    pub fn edges(&self, cables_of_device: usize) -> u64 {
        match self {
            Incident::Calm => 0,
            Incident::Cut { .. } | Incident::Heal { .. } => 1,
            Incident::PowerOff { .. } | Incident::PowerOn { .. } => cables_of_device as u64,
        }
    }

    /// In a few words, with positions only.
    pub fn summarize(&self) -> String {
        match self {
            Incident::Calm => "OP".to_owned(),
            Incident::Cut { ends: (a, b), .. } => format!("cut {a}-{b}"),
            Incident::Heal { ends: (a, b), .. } => format!("repair {a}-{b}"),
            Incident::PowerOff { position, .. } => format!("{position} off"),
            Incident::PowerOn { position, .. } => format!("{position} on"),
        }
    }

    /// In words, with names.
    pub fn describe(&self, names: &Names) -> String {
        let name = |position: usize| match names.0.get(position) {
            Some(name) => format!("{position} \"{name}\""),
            None => position.to_string(),
        };
        match self {
            Incident::Calm => "all are in OP".to_owned(),
            Incident::Cut { ends: (a, b), .. } => format!("cutting the cable between {} and {}", name(*a), name(*b)),
            Incident::Heal { ends: (a, b), .. } => format!("repairing the cable between {} and {}", name(*a), name(*b)),
            Incident::PowerOff { position, .. } => format!("switching off SubDevice {}", name(*position)),
            Incident::PowerOn { position, .. } => format!("switching SubDevice {} on again", name(*position)),
        }
    }
}
