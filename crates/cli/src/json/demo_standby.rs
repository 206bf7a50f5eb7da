//! What `ringcat demo --standby --json` prints.

use serde::Serialize;

use super::demo::Check;

/// The demonstration of two controllers.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct DemoStandby {
    /// Cycle time, in nanoseconds
    pub cycle_ns: u64,
    /// Cycles without process data of the ACTIVE after which the other controller takes over
    pub time_out_cycles: u32,
    /// The controller that is ACTIVE at the end: `A` or `B`; null where none is
    pub active: Option<&'static str>,
    /// Incidents of controllers and ring in their order
    pub incidents: Vec<StandbyIncident>,
    /// Effects on each SubDevice, in the order of their positions; empty if not all reached OP
    pub subdevices: Vec<Noticed>,
    /// The checks at the end
    pub checks: Vec<Check>,
}

/// An incident, up to the next one.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct StandbyIncident {
    /// Virtual time of the incident, in nanoseconds since the beginning
    pub time_ns: u64,
    /// The incident in words, for people
    pub text: String,
    /// Longest time between outputs in a SubDevice, in nanoseconds
    pub longest_ns: u64,
    /// Longest time that is allowed, in nanoseconds
    pub limit_ns: u64,
}

/// Effects on a SubDevice.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Noticed {
    /// Index in the declaration, from 0
    pub subdevice: usize,
    /// Its name
    pub name: String,
    /// Longest time between outputs in each incident, or inputs without outputs, in nanoseconds; empty without both
    pub longest_ns: Vec<u64>,
    /// Changes of its state
    pub state_changes: u32,
    /// Watchdogs that expired
    pub expired_watchdogs: u32,
}
