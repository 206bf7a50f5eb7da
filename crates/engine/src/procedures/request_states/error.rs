//! Why SubDevices did not follow a state that was requested of all.

use alloc::vec::Vec;
use core::fmt;
use core::time::Duration;

use ringcat_wire::al::{AlState, AlStatus, AlStatusCode};

use crate::declared::Address;
use crate::procedures::configure::ConfigureError;
use crate::role::NotPermitted;

/// A SubDevice that did not follow.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct NotFollowed {
    /// The SubDevice.
    pub subdevice: Address,
    /// Reason why it did not follow.
    pub reason: NotFollowedReason,
}

/// Why a SubDevice did not follow.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum NotFollowedReason {
    /// It refused the state, or its configuration failed; it goes back to the state before.
    Refused(ConfigureError),
    /// It does not answer. It is brought to the state when it comes.
    Absent,
    /// It is in BOOT, which only a request for this SubDevice ends.
    InBoot,
    /// Another state was requested of it meanwhile.
    Overtaken,
    /// It had not reached the state at the time limit; the request continues.
    Late {
        /// Its AL status at the limit.
        status: AlStatus,
        /// Its AL status code.
        code: AlStatusCode,
    },
}

/// Why not all SubDevices are in the requested state.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum StatesError {
    /// State requests are refused in the present role.
    NotPermitted(NotPermitted),
    /// BOOT is a state of single SubDevices.
    Boot,
    /// Nothing is declared, and no SubDevice was found.
    NoSubDevices,
    /// Some SubDevices did not follow.
    NotFollowed {
        /// The requested state.
        state: AlState,
        /// The time limit.
        limit: Duration,
        /// In the order of the declaration, or of positions.
        subdevices: Vec<NotFollowed>,
    },
}

impl fmt::Display for NotFollowedReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            NotFollowedReason::Refused(error) => error.fmt(f),
            NotFollowedReason::Absent => f.write_str("it does not answer"),
            NotFollowedReason::InBoot => f.write_str("it is in BOOT"),
            NotFollowedReason::Overtaken => f.write_str("another state was requested"),
            NotFollowedReason::Late { status, code } => write!(f, "AL status is {status}, code {code}"),
        }
    }
}

impl fmt::Display for NotFollowed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.subdevice, self.reason)
    }
}

impl fmt::Display for StatesError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            StatesError::NotPermitted(denied) => denied.fmt(f),
            StatesError::Boot => f.write_str("BOOT is a state of single SubDevices"),
            StatesError::NoSubDevices => f.write_str("no SubDevice is declared or was found"),
            StatesError::NotFollowed { state, limit, subdevices } => {
                write!(f, "{} SubDevices not in {state} within {} ms", subdevices.len(), limit.as_millis())?;
                subdevices.iter().try_for_each(|subdevice| write!(f, "; {subdevice}"))
            }
        }
    }
}

impl core::error::Error for StatesError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            StatesError::NotPermitted(error) => Some(error),
            _ => None,
        }
    }
}

impl From<NotPermitted> for StatesError {
    fn from(denied: NotPermitted) -> StatesError {
        StatesError::NotPermitted(denied)
    }
}
