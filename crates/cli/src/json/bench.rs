//! What `ringcat bench ... --json` prints.

use serde::Serialize;

use super::values::Times;

/// The echo.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Echo {
    /// Frames that were sent back
    pub frames_answered: u64,
}

/// Round trips against a bare client.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct RoundTrip {
    /// Bytes of a frame without check sequence
    pub frame_bytes: usize,
    /// Pairs of blocks that were measured; 0 where the MainDevice ran alone
    pub blocks: usize,
    /// The client that only sends and receives; null where the MainDevice ran alone
    pub bare: Option<Measured>,
    /// The cyclic half of the MainDevice
    pub main_device: Measured,
    /// Median over the pairs of blocks of median cycle of the MainDevice over that of the bare client; null without
    pub median_ratio: Option<f64>,
}

/// Cycles of one client.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Measured {
    /// Cycle times; null where the command was ended before the first one
    pub cycle_times: Option<Times>,
    /// Frames that were lost or came back wrong
    pub failed_frames: usize,
}

/// From the first frame to OP.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct StartUp {
    /// SubDevices on the bus
    pub subdevices: usize,
    /// Time from the first frame to the end of the scan, in nanoseconds
    pub scanned_after_ns: u64,
    /// Time from the first frame to OP of the last SubDevice, in nanoseconds; null where not all reached OP
    pub op_after_ns: Option<u64>,
}

/// Cycles back to back.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Cycles {
    /// From the first frame to OP
    pub start_up: StartUp,
    /// Cycle times; null where none was measured
    pub cycle_times: Option<Times>,
    /// Rate of the measured cycles, in hertz; null where none was measured
    pub rate_hz: Option<f64>,
    /// Processor time per measured cycle, all threads of this process, in nanoseconds; null where none was measured
    pub cpu_ns_per_cycle: Option<u64>,
    /// Incomplete cycles among the measured ones; null where none was measured
    pub incomplete_cycles: Option<u64>,
    /// Frames that were sent again within their cycle (--resend always); null where none was measured
    pub resent_frames: Option<u64>,
}

/// The largest rate that is kept.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Rate {
    /// From the first frame to OP
    pub start_up: StartUp,
    /// Tries, in their order: ever shorter cycles
    pub tries: Vec<Try>,
    /// The shortest cycle time that was kept, in nanoseconds; null where none was
    pub shortest_cycle_ns: Option<u64>,
    /// The rate of that, in hertz; null where none was kept
    pub largest_rate_hz: Option<f64>,
}

/// One try of a cycle time.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Try {
    /// The cycle time, in nanoseconds
    pub cycle_ns: u64,
    /// Cycles that ran
    pub cycles: u64,
    /// Cycles that were left out because this program or the segment was too slow
    pub skipped_cycles: u64,
    /// Cycles that were left out in stalls of the machine
    pub stalled_cycles: u64,
    /// Longest delay of a cycle after the time at which it should begin, in nanoseconds
    pub longest_delay_ns: u64,
}
