//! Values that several commands print.

use serde::Serialize;

use crate::selection::state_name;

/// A link of the MainDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Link {
    /// The first one.
    Main,
    /// That at the other end of a ring.
    Redundant,
}

impl Link {
    /// Both, in their order.
    pub const BOTH: [Link; 2] = [Link::Main, Link::Redundant];

    /// One of both.
    pub fn of(is_redundant: bool) -> Link {
        if is_redundant { Link::Redundant } else { Link::Main }
    }
}

/// Direction of process data.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Direction {
    /// The MainDevice writes.
    Outputs,
    /// The MainDevice reads.
    Inputs,
}

impl Direction {
    /// One of both.
    pub fn of(is_output: bool) -> Direction {
        if is_output { Direction::Outputs } else { Direction::Inputs }
    }
}

/// An AL state by its name; `None` without an answer, and for a number that is no state.
pub fn state(status: Option<u16>) -> Option<&'static str> {
    status.and_then(state_name)
}
