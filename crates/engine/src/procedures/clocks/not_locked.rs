//! A clock that is not accurate enough for SYNC signals (protocol 7.3).

use core::fmt;
use core::time::Duration;

use crate::segment::clocks::HiddenDelay;
use crate::supervisor::BusError;

/// A clock did not reach its window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct NotLocked {
    /// The time limit.
    pub waited: Duration,
    /// The last difference to the reference.
    pub difference_ns: Option<i32>,
    /// The window.
    pub window_ns: u32,
    /// The position of another clock of the segment, if that is the cause.
    pub other: Option<u16>,
    /// Its delay is unknown.
    pub hidden: Option<HiddenDelay>,
}

impl fmt::Display for NotLocked {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(hidden) = self.hidden {
            f.write_str("its propagation delay is not known, ")?;
            return match hidden.fork {
                Some(fork) => write!(f, "since the fork at position {fork} has no clock"),
                None => f.write_str("since the SubDevices between it and the reference clock are unknown"),
            };
        }
        match self.other {
            Some(position) => write!(f, "the clock of position {position}")?,
            None => f.write_str("its clock")?,
        }
        write!(f, " did not lock within {} ms: ", self.waited.as_millis())?;
        match self.difference_ns {
            Some(ns) => write!(f, "expected a difference of at most {} ns, got {ns} ns", self.window_ns),
            None => f.write_str("its difference to the reference clock could not be read"),
        }
    }
}

impl core::error::Error for NotLocked {}

/// Why SYNC signals were not started.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::procedures) enum SignalsError {
    Bus(BusError),
    NotLocked(NotLocked),
}

impl From<BusError> for SignalsError {
    fn from(error: BusError) -> SignalsError {
        SignalsError::Bus(error)
    }
}
