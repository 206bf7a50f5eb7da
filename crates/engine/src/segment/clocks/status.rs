//! The status of one clock, for the application.

use ringcat_wire::address::{Position, StationAddress};

use crate::declared::SubDeviceId;

/// What is known about the clock of one SubDevice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ClockStatus {
    /// Position in the scan, or where it was found later.
    pub position: u16,
    /// Its station address.
    pub station: StationAddress,
    /// Index in the declaration.
    pub subdevice: Option<SubDeviceId>,
    /// It is the reference of the segment.
    pub is_reference: bool,
    /// Nanoseconds from the reference of its part of the segment (0x0928).
    pub delay_ns: i64,
    /// That cannot be measured where it is, and why.
    pub hidden: Option<HiddenDelay>,
    /// System time less local time when it was set up (0x0920).
    pub offset_ns: i64,
    /// How much faster than the reference it would run by itself, in parts per billion: as it ran within the
    /// milliseconds of the first measurement, to some tens of thousands; once it was locked, what its control loop
    /// makes up for (0x0932).
    pub drift_ppb: i64,
    /// Its time less that of the reference in nanoseconds (0x092C); `None` before it was read.
    pub difference_ns: Option<i32>,
    /// Largest magnitude of that since it was locked.
    pub worst_ns: u32,
    /// It was within the window for as many samples as configured.
    pub is_locked: bool,
}

/// Why the delay of a SubDevice is not known (protocol 7.1): it is behind a fork without a clock, and the latched
/// receive times show only the sum of that fork's branches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HiddenDelay {
    /// Position of the fork; `None` where the SubDevices between this one and the reference are not known.
    pub fork: Option<Position>,
    /// The least and the most that it may be away from the reference, in nanoseconds; `None` where nothing is known.
    pub range_ns: Option<(i64, i64)>,
    /// The middle of that range was written
    /// ([`ClockConfig::estimated_delays`](crate::config::ClockConfig::estimated_delays)); otherwise no delay was.
    pub is_estimated: bool,
}
