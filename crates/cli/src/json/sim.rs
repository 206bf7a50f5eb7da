//! What `ringcat sim --json` prints.

use serde::Serialize;

/// A simulation that has ended.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Sim {
    /// SubDevices of the segment
    pub subdevices: usize,
    /// The network interfaces
    pub interfaces: Vec<Interface>,
    /// Wake-ups of the simulator that were later than 200 us
    pub late_wake_ups: LateWakeUps,
}

/// What an interface has carried.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Interface {
    /// `main` or `redundant`
    pub link: String,
    /// Frames that arrived
    pub received_frames: u64,
    /// Frames that found the receive ring full
    pub overrun_frames: u64,
    /// Frames that were too long
    pub truncated_frames: u64,
    /// Frames that left
    pub sent_frames: u64,
    /// Frames that the interface did not take
    pub unsent_frames: u64,
}

/// How well the simulator kept up with the clock.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct LateWakeUps {
    /// How many
    pub count: u64,
    /// The latest, in nanoseconds
    pub longest_ns: u64,
    /// All together, in nanoseconds
    pub total_ns: u64,
}
