//! The status of one clock, for the application.

use ringcat_wire::address::{Position, StationAddress};

use crate::clocks::DelayRange;
use crate::declared::SubDeviceId;

/// Status of the clock of one SubDevice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct ClockStatus {
    /// Position in the scan, or at which it was found later.
    pub position: Position,
    /// Its station address.
    pub station: StationAddress,
    /// Index in the declaration.
    pub subdevice: Option<SubDeviceId>,
    /// It is the reference of the segment.
    pub is_reference: bool,
    /// Delay in nanoseconds from the reference of its part of the segment (0x0928).
    pub delay_ns: i64,
    /// Why the delay cannot be measured.
    pub hidden: Option<HiddenDelay>,
    /// System time minus local time at the set-up (0x0920).
    pub offset_ns: i64,
    /// Drift against the reference without its control loop, in parts per billion (positive: faster): from the first
    /// milliseconds of the measurement, accurate to some tens of thousands; once it was locked, the deviation
    /// compensated by its control loop (0x0932).
    pub drift_ppb: i64,
    /// Its time minus that of the reference in nanoseconds (0x092C); `None` before the first read.
    pub difference_ns: Option<i32>,
    /// Largest magnitude of the difference since it was locked.
    pub worst_ns: u32,
    /// It was within the window for as many samples as configured.
    pub is_locked: bool,
    /// Whether OP requires that the clock is locked: it has SYNC signals or follows the reference. A clock without SYNC
    /// signals upstream of the reference follows the host's estimate of the time, and no SubDevice waits for it.
    pub is_required: bool,
}

impl ClockStatus {
    /// Whether OP requires that the clock is locked, and it is not.
    pub const fn is_awaited(&self) -> bool {
        self.is_required && !self.is_locked && !self.is_reference
    }
}

/// Why the delay of a SubDevice is unknown (protocol 7.1): it is behind a fork without a clock, and the latched receive
/// times show only the sum of that fork's branches.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct HiddenDelay {
    /// Position of the fork; `None` if the SubDevices between this one and the reference are unknown.
    pub fork: Option<Position>,
    /// Limits of the delay from the reference; `None` if they are unknown.
    pub range: Option<DelayRange>,
    /// The middle of that range was written
    /// ([`ClockConfig::estimated_delays`](crate::config::ClockConfig::estimated_delays)); otherwise no delay was
    /// written.
    pub is_estimated: bool,
}
