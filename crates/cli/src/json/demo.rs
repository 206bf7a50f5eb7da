//! What `ringcat demo --json` prints.

use serde::Serialize;

use super::scan::SubDevice;
use super::values::State;

/// The demonstration.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Demo {
    /// Cycle time, in nanoseconds
    pub cycle_ns: u64,
    /// The SubDevices, in the order of their positions
    pub subdevices: Vec<SubDevice>,
    /// Their states at the end
    pub states: Vec<State>,
    /// Time from power-on to OP of the last SubDevice, in nanoseconds; null where not all reached OP
    pub op_after_ns: Option<u64>,
    /// Incidents in the segment in their order, and the cycles that each one cost
    pub incidents: Vec<Incident>,
    /// The checks at the end
    pub checks: Vec<Check>,
}

/// An incident, and the cycles from there to the next one.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Incident {
    /// The incident in words, for people
    pub text: String,
    /// Cycles
    pub cycles: u64,
    /// Cycles in which SubDevices that have power did not answer
    pub incomplete_cycles: u64,
    /// How many of them the incident may cost: one per edge of a cable
    pub allowed_cycles: u64,
    /// Cycles in which inputs were held back until it was known which SubDevice is missing
    pub held_back_cycles: u64,
    /// Cycles that lack only the SubDevice without power
    pub lacking_one_cycles: u64,
}

/// Something that was checked.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Check {
    /// Whether it held
    pub held: bool,
    /// What was checked, for people
    pub text: String,
}
