//! Why a SubDevice is not configured.

use alloc::string::String;
use alloc::vec::Vec;
use core::fmt;

use super::register_error::{Hex, RegisterCommandError};
use crate::config::Transition;
use crate::mail::MailboxError;
use crate::mail::aoe::AoeError;
use crate::mail::coe::{SdoAddress, SdoError};
use crate::mail::eoe::EoeError;
use crate::mail::foe::FoeError;
use crate::mail::soe::{SoeAddress, SoeError};
use crate::procedures::al_state::StateError;
use crate::procedures::clocks::{NotLocked, SignalsError};
use crate::role::NotPermitted;
use crate::segment::setup::SetupError;
use crate::supervisor::BusError;

/// Why a SubDevice is not configured.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum ConfigureError {
    /// The bus failed.
    Bus(BusError),
    /// A state was not reached.
    State(StateError),
    /// An SDO of the PDO assignment or mapping failed.
    Sdo(SdoError),
    /// A start-up command failed.
    Startup {
        /// Number of the command in the declaration, from 0.
        number: usize,
        /// The transition to which it belongs.
        transition: Transition,
        /// Its purpose, as commented in the declaration.
        comment: Option<String>,
        /// The error.
        error: StartupError,
    },
    /// A clock did not lock.
    NotLocked(NotLocked),
    /// State requests are refused in the present role.
    NotPermitted(NotPermitted),
    /// It was never present, so its configuration is unknown.
    NoSetup,
    /// Its SII cannot be set up as declared.
    Unfit(SetupError),
    /// It has no boot loader: its SII contains no mailboxes for BOOT.
    NoBoot,
    /// It does not answer. It is brought to the requested state when it comes back.
    Absent,
    /// Another state was requested meanwhile, or it was lost.
    Interrupted,
}

/// Why a start-up command failed.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum StartupError {
    /// CoE.
    Sdo(SdoError),
    /// SoE.
    Soe(SoeError),
    /// EoE.
    Eoe(EoeError),
    /// An object holds another value than required.
    Value {
        /// The object.
        object: SdoAddress,
        /// The required value.
        expected: Vec<u8>,
        /// The value read.
        got: Vec<u8>,
    },
    /// AoE.
    Aoe(AoeError),
    /// VoE.
    Voe(MailboxError),
    /// FoE.
    Foe(FoeError),
    /// An IDN holds other data than required.
    IdnValue {
        /// The elements that were read.
        address: SoeAddress,
        /// The required data.
        expected: Vec<u8>,
        /// The data read.
        got: Vec<u8>,
    },
    /// A register.
    Register(RegisterCommandError),
}

impl fmt::Display for ConfigureError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ConfigureError::Bus(error) => error.fmt(f),
            ConfigureError::State(error) => error.fmt(f),
            ConfigureError::Sdo(error) => error.fmt(f),
            ConfigureError::Startup { number, transition, comment: None, error } => {
                write!(f, "start-up command {number} ({transition}): {error}")
            }
            ConfigureError::Startup { number, transition, comment: Some(comment), error } => {
                write!(f, "start-up command {number} ({transition}) \"{comment}\": {error}")
            }
            ConfigureError::NotLocked(error) => error.fmt(f),
            ConfigureError::Unfit(error) => error.fmt(f),
            ConfigureError::NotPermitted(denied) => denied.fmt(f),
            ConfigureError::NoSetup => f.write_str("nothing is known about this SubDevice yet"),
            ConfigureError::NoBoot => f.write_str("its SII gives no mailboxes for BOOT"),
            ConfigureError::Absent => f.write_str("it does not answer"),
            ConfigureError::Interrupted => f.write_str("it was lost, or another state was requested"),
        }
    }
}

impl fmt::Display for StartupError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            StartupError::Sdo(error) => error.fmt(f),
            StartupError::Soe(error) => error.fmt(f),
            StartupError::Eoe(error) => error.fmt(f),
            StartupError::Value { object, expected, got } => {
                write!(f, "SDO {object}: expected {}, got {}", Hex(expected), Hex(got))
            }
            StartupError::IdnValue { address, expected, got } => {
                write!(f, "SoE {address}: expected {}, got {}", Hex(expected), Hex(got))
            }
            StartupError::Aoe(error) => error.fmt(f),
            StartupError::Voe(error) => write!(f, "VoE: {error}"),
            StartupError::Foe(error) => error.fmt(f),
            StartupError::Register(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for ConfigureError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            ConfigureError::Bus(error) => Some(error),
            ConfigureError::State(error) => Some(error),
            ConfigureError::Sdo(error) => Some(error),
            ConfigureError::Startup { error, .. } => Some(error),
            ConfigureError::NotLocked(error) => Some(error),
            ConfigureError::NotPermitted(error) => Some(error),
            ConfigureError::Unfit(error) => Some(error),
            _ => None,
        }
    }
}

impl From<NotPermitted> for ConfigureError {
    fn from(denied: NotPermitted) -> ConfigureError {
        ConfigureError::NotPermitted(denied)
    }
}

impl core::error::Error for StartupError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            StartupError::Sdo(error) => Some(error),
            StartupError::Soe(error) => Some(error),
            StartupError::Eoe(error) => Some(error),
            StartupError::Aoe(error) => Some(error),
            StartupError::Voe(error) => Some(error),
            StartupError::Foe(error) => Some(error),
            StartupError::Register(error) => Some(error),
            _ => None,
        }
    }
}

impl From<BusError> for ConfigureError {
    fn from(error: BusError) -> ConfigureError {
        ConfigureError::Bus(error)
    }
}

impl From<StateError> for ConfigureError {
    fn from(error: StateError) -> ConfigureError {
        match error {
            StateError::Bus(error) => ConfigureError::Bus(error),
            error => ConfigureError::State(error),
        }
    }
}

impl From<SdoError> for ConfigureError {
    fn from(error: SdoError) -> ConfigureError {
        ConfigureError::Sdo(error)
    }
}

impl From<SignalsError> for ConfigureError {
    fn from(error: SignalsError) -> ConfigureError {
        match error {
            SignalsError::Bus(error) => ConfigureError::Bus(error),
            SignalsError::NotLocked(error) => ConfigureError::NotLocked(error),
        }
    }
}
