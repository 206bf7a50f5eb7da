//! Why a command could not be carried out.

use std::fmt;

use ringcat::sim::segment::SegmentError;
use ringcat::{Error, ScanError};
use ringcat_link::LinkError;

/// Why a command could not be carried out, in words that say what to do. The first line is the reason.
#[derive(Debug)]
pub struct Failure(String);

impl Failure {
    /// A failure with these words.
    pub fn new(text: impl Into<String>) -> Failure {
        Failure(text.into())
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl From<LinkError> for Failure {
    fn from(error: LinkError) -> Failure {
        Failure(error.to_string())
    }
}

impl From<SegmentError> for Failure {
    fn from(error: SegmentError) -> Failure {
        Failure(error.to_string())
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Failure {
        let advice = match &error {
            Error::Scan(ScanError::NoSubDevices) => {
                "; something sends the frames back unchanged: is this the cable to the SubDevices?"
            }
            Error::Scan(ScanError::Unsettled { .. }) => {
                "; look for a loose cable or a power supply that comes and goes"
            }
            _ => "",
        };
        Failure(format!("{error}{advice}"))
    }
}
