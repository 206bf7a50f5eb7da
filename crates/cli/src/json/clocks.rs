//! What `ringcat clocks --json` prints; a part of `ringcat run --json`.

use serde::Serialize;

use super::values::{SyncSignals, Times};

/// The distributed clocks of a segment.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Clocks {
    /// Whether all clocks were locked
    pub locked: bool,
    /// How far cycles began from their phase; null where they do not follow the reference clock
    pub phase_errors: Option<Times>,
    /// The clocks, in the order of their positions
    pub clocks: Vec<Clock>,
}

/// A clock.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Clock {
    /// Position of the SubDevice, from 0
    pub position: u16,
    /// Its station address
    pub station: u16,
    /// Its name
    pub name: String,
    /// Whether it is the reference clock
    pub reference: bool,
    /// Whether it is locked
    pub locked: bool,
    /// Whether OP requires that it is locked: it has SYNC signals, or follows the reference; a clock without SYNC
    /// upstream of the reference follows the estimate of the host
    pub required: bool,
    /// Propagation delay from the reference clock (register 0x0928), in nanoseconds; null where none was written
    pub delay_ns: Option<i64>,
    /// Bounds of a propagation delay that a fork without a clock hides; null without such a fork
    pub delay_hidden: Option<HiddenDelay>,
    /// Offset from its own time to system time (register 0x0920), in nanoseconds
    pub offset_ns: i64,
    /// Parts per billion that it would run faster than the reference by itself (register 0x0932)
    pub drift_ppb: i64,
    /// Difference to the reference when it was read last (register 0x092C), in nanoseconds; null before
    pub difference_ns: Option<i32>,
    /// Largest difference since it was locked, in nanoseconds
    pub worst_ns: u32,
    /// Its SYNC signals; null without
    pub sync: Option<SyncSignals>,
}

/// What is known of a propagation delay that cannot be measured.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct HiddenDelay {
    /// Position of the fork; null where it is not known
    pub fork: Option<u16>,
    /// The delay is not shorter, in nanoseconds; null where that is not known
    pub least_ns: Option<i64>,
    /// The delay is not longer, in nanoseconds; null where that is not known
    pub most_ns: Option<i64>,
    /// Whether the middle of both was written (--estimate-delays)
    pub estimated: bool,
}
