//! Errors of services of one SubDevice.

use std::error::Error as StdError;
use std::fmt;
use std::time::Duration;

use ringcat_engine::ConfigureError;
use ringcat_engine::ServiceError;
use ringcat_engine::mail::MailboxError;
use ringcat_engine::mail::aoe::AoeError;
use ringcat_engine::mail::coe::SdoError;
use ringcat_engine::mail::coe::information::InformationError;
use ringcat_engine::mail::coe::pdo_mail::PdoMailError;
use ringcat_engine::mail::eoe::EoeError;
use ringcat_engine::mail::foe::FoeError;
use ringcat_engine::mail::soe::SoeError;

use super::name::SubDeviceName;

/// A service of a SubDevice failed.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct SubDeviceError {
    /// The SubDevice.
    pub subdevice: SubDeviceName,
    /// The cause.
    pub failure: SubDeviceFailure,
}

/// The cause.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum SubDeviceFailure {
    /// The segment has not been scanned.
    NotScanned,
    /// The SubDevice is named by its index in the declaration, and no declaration is active.
    NotActive,
    /// The SubDevice is named by its position, and a declaration is active.
    Active,
    /// The declaration has no SubDevice with this index.
    NotDeclared {
        /// Number of declared SubDevices; indices count from 0.
        declared: usize,
    },
    /// The scan found no SubDevice at this position.
    NoPosition {
        /// Number of SubDevices found; positions count from 0.
        scanned: usize,
    },
    /// It has no mailbox.
    NoMailbox,
    /// The object or register has another number of bytes than the type.
    Size {
        /// The object or register.
        what: String,
        /// Bytes of the type.
        expected: usize,
        /// Bytes that came.
        got: usize,
    },
    /// The whole service took longer than [`SubDevice::within`](super::SubDevice::within) allows.
    TimedOut {
        /// The limit.
        limit: Duration,
    },
    /// An SDO transfer failed.
    Sdo(SdoError),
    /// An SDO information request failed.
    Information(InformationError),
    /// A file transfer failed.
    Foe(FoeError),
    /// An access to an IDN failed.
    Soe(SoeError),
    /// An ADS request failed.
    Aoe(AoeError),
    /// A PDO by mailbox failed.
    Pdo(PdoMailError),
    /// IP parameters or an address filter were not read or set.
    Eoe(EoeError),
    /// A message of a vendor, or one that the application has composed, failed.
    Mailbox(MailboxError),
    /// A state was not reached.
    State(ConfigureError),
    /// A service besides the mailbox protocols failed.
    Service(ServiceError),
}

impl fmt::Display for SubDeviceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.subdevice, self.failure)
    }
}

impl fmt::Display for SubDeviceFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SubDeviceFailure::NotScanned => f.write_str("the segment has not been scanned: scan first"),
            SubDeviceFailure::NotActive => {
                f.write_str("no declaration is active: before activation name SubDevices by their positions")
            }
            SubDeviceFailure::Active => {
                f.write_str("a declaration is active: name SubDevices by their indices in the declaration")
            }
            SubDeviceFailure::NotDeclared { declared } => {
                write!(f, "not declared: the declaration has {declared} SubDevices, from 0")
            }
            SubDeviceFailure::NoPosition { scanned } => {
                write!(f, "the scan found no such position: it found {scanned} SubDevices, from 0")
            }
            SubDeviceFailure::NoMailbox => f.write_str("it has no mailbox"),
            SubDeviceFailure::Size { what, expected, got } => {
                write!(f, "{what}: expected {expected} bytes, got {got}")
            }
            SubDeviceFailure::TimedOut { limit } => write!(f, "not done within {} ms", limit.as_millis()),
            SubDeviceFailure::Sdo(error) => error.fmt(f),
            SubDeviceFailure::Information(error) => error.fmt(f),
            SubDeviceFailure::Foe(error) => error.fmt(f),
            SubDeviceFailure::Soe(error) => error.fmt(f),
            SubDeviceFailure::Aoe(error) => error.fmt(f),
            SubDeviceFailure::Pdo(error) => error.fmt(f),
            SubDeviceFailure::Eoe(error) => error.fmt(f),
            SubDeviceFailure::Mailbox(error) => error.fmt(f),
            SubDeviceFailure::State(error) => error.fmt(f),
            SubDeviceFailure::Service(error) => error.fmt(f),
        }
    }
}

impl StdError for SubDeviceError {
    fn source(&self) -> Option<&(dyn StdError + 'static)> {
        Some(&self.failure)
    }
}

impl StdError for SubDeviceFailure {
    fn source(&self) -> Option<&(dyn StdError + 'static)> {
        match self {
            SubDeviceFailure::Sdo(error) => Some(error),
            SubDeviceFailure::Information(error) => Some(error),
            SubDeviceFailure::Foe(error) => Some(error),
            SubDeviceFailure::Soe(error) => Some(error),
            SubDeviceFailure::Aoe(error) => Some(error),
            SubDeviceFailure::Pdo(error) => Some(error),
            SubDeviceFailure::Eoe(error) => Some(error),
            SubDeviceFailure::Mailbox(error) => Some(error),
            SubDeviceFailure::State(error) => Some(error),
            SubDeviceFailure::Service(error) => Some(error),
            _ => None,
        }
    }
}

macro_rules! failures {
    ($($variant:ident($error:ty),)*) => {$(
        impl From<$error> for SubDeviceFailure {
            fn from(error: $error) -> SubDeviceFailure {
                SubDeviceFailure::$variant(error)
            }
        }
    )*};
}

failures! {
    Sdo(SdoError),
    Information(InformationError),
    Foe(FoeError),
    Soe(SoeError),
    Aoe(AoeError),
    Pdo(PdoMailError),
    Eoe(EoeError),
    Mailbox(MailboxError),
    State(ConfigureError),
    Service(ServiceError),
}
