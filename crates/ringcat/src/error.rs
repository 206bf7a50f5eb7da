//! What can go wrong before cycles run.

use core::fmt;

use ringcat_engine::main_device::ActivateError;
use ringcat_engine::procedures::scan::ScanError;
use ringcat_sim::segment::SegmentError;

/// An error of the public API.
#[derive(Debug)]
pub enum Error {
    /// The scan failed.
    Scan(ScanError),
    /// The declaration cannot be activated.
    Activate(ActivateError),
    /// The simulated segment cannot be built.
    Segment(SegmentError),
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Error::Scan(error) => write!(f, "scan: {error}"),
            Error::Activate(error) => write!(f, "activation: {error}"),
            Error::Segment(error) => error.fmt(f),
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

impl From<SegmentError> for Error {
    fn from(error: SegmentError) -> Error {
        Error::Segment(error)
    }
}
