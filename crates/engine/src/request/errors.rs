//! Texts of the errors of requests, without allocation: cyclic threads may get them.

use core::fmt;

use super::slot::{RequestFailure, RequestRefused};

impl fmt::Display for RequestRefused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            RequestRefused::Busy => f.write_str("the request is in progress"),
            RequestRefused::TooLong { bytes, limit } => {
                write!(f, "the memory of the request has {limit} bytes, got {bytes}")
            }
        }
    }
}

impl core::error::Error for RequestRefused {}

impl fmt::Display for RequestFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            RequestFailure::Aborted(code) => write!(f, "aborted by the SubDevice: {code}"),
            RequestFailure::Refused(code) => write!(f, "refused by the drive: {code}"),
            RequestFailure::Timeout => f.write_str("the request took longer than its timeout"),
            RequestFailure::TooLong => f.write_str("the read data is longer than the memory of the request"),
            RequestFailure::Failed => f.write_str("the SubDevice is absent, or its mailbox failed"),
            RequestFailure::Cancelled => f.write_str("the request was cancelled"),
        }
    }
}

impl core::error::Error for RequestFailure {}
