//! The direction of process data.

use ringcat_wire::sii::PdoDirection;

/// The direction of process data, from the point of view of the MainDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Direction {
    /// From the MainDevice to the SubDevice.
    Outputs,
    /// From the SubDevice to the MainDevice.
    Inputs,
}

impl core::fmt::Display for Direction {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Direction::Outputs => "outputs",
            Direction::Inputs => "inputs",
        })
    }
}

impl From<PdoDirection> for Direction {
    fn from(direction: PdoDirection) -> Direction {
        match direction {
            PdoDirection::Rx => Direction::Outputs,
            PdoDirection::Tx => Direction::Inputs,
        }
    }
}
