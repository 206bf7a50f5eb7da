//! Errors of the library before and after the cycles.

use core::fmt;
use std::time::Duration;

use ringcat_engine::BusError;
use ringcat_engine::ScanError;
use ringcat_engine::ServiceError;
use ringcat_engine::StatesError;
use ringcat_engine::StopError;
use ringcat_engine::main_device::ActivateError;
#[cfg(feature = "sim")]
use ringcat_sim::segment::SegmentError;

use crate::mapped::{DoesNotFit, MapError, WriteError};
use crate::no_domain::NoDomain;
use crate::not_ready::NotReady;
use crate::subdevice::SubDeviceError;

/// An error of the public API.
#[derive(Debug)]
#[non_exhaustive]
pub enum Error {
    /// The scan failed.
    Scan(ScanError),
    /// The declaration cannot be activated.
    Activate(ActivateError),
    /// A service besides the mailbox protocols failed.
    Service(ServiceError),
    /// A service of one SubDevice failed.
    SubDevice(Box<SubDeviceError>),
    /// Not all SubDevices followed a state that was requested of all.
    States(StatesError),
    /// SubDevices did not reach their target states in time.
    NotReady(NotReady),
    /// An object is not mapped as the application expects.
    Map(MapError),
    /// A value has more bits than its place in the process data.
    DoesNotFit(DoesNotFit),
    /// Process data was not written.
    Write(WriteError),
    /// The declaration has no such domain.
    NoDomain(NoDomain),
    /// One of two MainDevices needs a redundant link.
    #[cfg(feature = "standby")]
    NeedsTwoLinks(crate::standby::NeedsTwoLinks),
    /// The other MainDevice has the same identity.
    #[cfg(feature = "standby")]
    SameIdentity(crate::standby::SameIdentity),
    /// A service did not end in time.
    TimedOut {
        /// The limit.
        limit: Duration,
    },
    /// The orderly stop failed.
    Stop(StopError),
    /// The simulated segment cannot be built.
    #[cfg(feature = "sim")]
    Segment(SegmentError),
    /// The system cannot start a thread.
    Thread(std::io::Error),
    /// The mailbox gateway cannot listen.
    #[cfg(feature = "gateway")]
    Gateway {
        /// The address of the gateway.
        address: std::net::SocketAddr,
        /// The error of the system.
        cause: std::io::Error,
    },
    /// The closure of the cycles has panicked, with this message.
    Panicked(String),
    /// The thread of the acyclic half has ended, or the MainDevice was stopped meanwhile.
    Gone,
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Error::Scan(error) => write!(f, "scan: {error}"),
            Error::Activate(error) => write!(f, "activation: {error}"),
            Error::Service(error) => error.fmt(f),
            Error::SubDevice(error) => error.fmt(f),
            Error::States(error) => error.fmt(f),
            Error::NotReady(error) => error.fmt(f),
            Error::Map(error) => error.fmt(f),
            Error::DoesNotFit(error) => error.fmt(f),
            Error::Write(error) => error.fmt(f),
            Error::NoDomain(error) => error.fmt(f),
            #[cfg(feature = "standby")]
            Error::NeedsTwoLinks(error) => error.fmt(f),
            #[cfg(feature = "standby")]
            Error::SameIdentity(error) => error.fmt(f),
            Error::TimedOut { limit } => write!(f, "not done within {} ms", limit.as_millis()),
            Error::Stop(error @ StopError::Bus(BusError::Lost { .. })) => write!(
                f,
                "stop: no frame comes back on any interface, so no SubDevice was brought down: they keep their \
                 states until their watchdogs expire. Are the cables of the host unplugged? ({error})"
            ),
            Error::Stop(error) => write!(f, "stop: {error}"),
            #[cfg(feature = "sim")]
            Error::Segment(error) => error.fmt(f),
            Error::Thread(error) => write!(f, "a thread cannot be started: {error}"),
            #[cfg(feature = "gateway")]
            Error::Gateway { address, cause } => write!(f, "mailbox gateway on {address}: {cause}"),
            Error::Panicked(message) => write!(f, "the application's closure has panicked: {message}"),
            Error::Gone => f.write_str("the supervisor thread has ended, or the MainDevice was stopped meanwhile"),
        }
    }
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Error::Scan(error) => Some(error),
            Error::Activate(error) => Some(error),
            Error::Service(error) => Some(error),
            Error::SubDevice(error) => Some(&**error),
            Error::States(error) => Some(error),
            Error::NotReady(error) => Some(error),
            Error::Map(error) => Some(error),
            Error::DoesNotFit(error) => Some(error),
            Error::Write(error) => Some(error),
            Error::NoDomain(error) => Some(error),
            Error::Stop(error) => Some(error),
            #[cfg(feature = "sim")]
            Error::Segment(error) => Some(error),
            #[cfg(feature = "standby")]
            Error::NeedsTwoLinks(error) => Some(error),
            #[cfg(feature = "standby")]
            Error::SameIdentity(error) => Some(error),
            Error::Thread(error) => Some(error),
            #[cfg(feature = "gateway")]
            Error::Gateway { cause, .. } => Some(cause),
            _ => None,
        }
    }
}

macro_rules! errors {
    ($($variant:ident($error:ty),)*) => {$(
        impl From<$error> for Error {
            fn from(error: $error) -> Error {
                Error::$variant(error)
            }
        }
    )*};
}

errors! {
    Scan(ScanError),
    Activate(ActivateError),
    Service(ServiceError),
    States(StatesError),
    NotReady(NotReady),
    Map(MapError),
    DoesNotFit(DoesNotFit),
    Write(WriteError),
    NoDomain(NoDomain),
    Stop(StopError),
}

#[cfg(feature = "standby")]
impl From<crate::standby::SameIdentity> for Error {
    fn from(error: crate::standby::SameIdentity) -> Error {
        Error::SameIdentity(error)
    }
}

#[cfg(feature = "standby")]
impl From<crate::standby::NeedsTwoLinks> for Error {
    fn from(error: crate::standby::NeedsTwoLinks) -> Error {
        Error::NeedsTwoLinks(error)
    }
}

impl From<SubDeviceError> for Error {
    fn from(error: SubDeviceError) -> Error {
        Error::SubDevice(Box::new(error))
    }
}

#[cfg(feature = "sim")]
impl From<SegmentError> for Error {
    fn from(error: SegmentError) -> Error {
        Error::Segment(error)
    }
}
