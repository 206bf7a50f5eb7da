//! What can go wrong before and after the cycles.

use core::fmt;

use ringcat_engine::mail::coe::SdoError;
use ringcat_engine::main_device::ActivateError;
use ringcat_engine::procedures::configure::ConfigureError;
use ringcat_engine::procedures::scan::ScanError;
use ringcat_engine::procedures::services::ServiceError;
use ringcat_engine::procedures::stop::StopError;
use ringcat_engine::supervisor::BusError;
#[cfg(feature = "sim")]
use ringcat_sim::segment::SegmentError;

/// An error of the public API.
#[derive(Debug)]
#[non_exhaustive]
pub enum Error {
    /// The scan failed.
    Scan(ScanError),
    /// The declaration cannot be activated.
    Activate(ActivateError),
    /// A SubDevice could not be brought to a state before activation.
    Configure(ConfigureError),
    /// An SDO transfer failed.
    Sdo(SdoError),
    /// A service besides the mailbox protocols failed.
    Service(ServiceError),
    /// The segment could not be stopped in order.
    Stop(StopError),
    /// The simulated segment cannot be built.
    #[cfg(feature = "sim")]
    Segment(SegmentError),
    /// The system has no more threads.
    Thread(std::io::Error),
    /// The mailbox gateway cannot listen.
    #[cfg(feature = "gateway")]
    Gateway {
        /// Where.
        address: std::net::SocketAddr,
        /// The system's answer.
        cause: std::io::Error,
    },
    /// The closure that the cycles ran has panicked, with this message.
    Panicked(String),
    /// The thread of the acyclic half has ended.
    Gone,
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Error::Scan(error) => write!(f, "scan: {error}"),
            Error::Activate(error) => write!(f, "activation: {error}"),
            Error::Configure(error) => error.fmt(f),
            Error::Sdo(error) => error.fmt(f),
            Error::Service(error) => error.fmt(f),
            Error::Stop(StopError::Bus(BusError::Lost { .. })) => f.write_str(
                "stop: no frame comes back on any interface, so SubDevices were not taken to INIT: they keep their state \
                 until their watchdogs expire. Are the cables of the host unplugged?",
            ),
            Error::Stop(error) => write!(f, "stop: {error}"),
            #[cfg(feature = "sim")]
            Error::Segment(error) => error.fmt(f),
            Error::Thread(error) => write!(f, "a thread cannot be started: {error}"),
            #[cfg(feature = "gateway")]
            Error::Gateway { address, cause } => write!(f, "mailbox gateway on {address}: {cause}"),
            Error::Panicked(message) => write!(f, "the application's closure has panicked: {message}"),
            Error::Gone => f.write_str("the supervisor thread has ended"),
        }
    }
}

impl std::error::Error for Error {}

impl From<ScanError> for Error {
    fn from(error: ScanError) -> Error {
        Error::Scan(error)
    }
}

impl From<ActivateError> for Error {
    fn from(error: ActivateError) -> Error {
        Error::Activate(error)
    }
}

impl From<ConfigureError> for Error {
    fn from(error: ConfigureError) -> Error {
        Error::Configure(error)
    }
}

impl From<SdoError> for Error {
    fn from(error: SdoError) -> Error {
        Error::Sdo(error)
    }
}

impl From<ServiceError> for Error {
    fn from(error: ServiceError) -> Error {
        Error::Service(error)
    }
}

impl From<StopError> for Error {
    fn from(error: StopError) -> Error {
        Error::Stop(error)
    }
}

#[cfg(feature = "sim")]
impl From<SegmentError> for Error {
    fn from(error: SegmentError) -> Error {
        Error::Segment(error)
    }
}
