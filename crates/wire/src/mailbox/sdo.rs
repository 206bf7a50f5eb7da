//! SDO upload and download, expedited, normal and in segments (protocol 6.3).
//!
//! In goes or out comes the payload of a mailbox message of protocol CoE: CoE header, command byte and what follows.
//! Which message may follow which, toggles and time limits are the engine's matter.

mod abort;
mod codec;
mod request;
mod response;

use core::fmt;

use super::coe::CoeService;

pub use abort::AbortCode;
pub use request::SdoRequest;
pub use response::SdoResponse;

/// Bytes of CoE header, command, index, subindex and size: all of an SDO message but the data of a normal transfer.
pub const INITIATE_LEN: usize = 10;
/// Bytes of CoE header and command: all of a segment but its data.
pub const SEGMENT_OVERHEAD: usize = 3;
/// Data bytes that every segment has; shorter data is padded.
pub const SEGMENT_MIN_DATA: usize = 7;
/// Most data of an expedited transfer.
pub const EXPEDITED_MAX_DATA: usize = 4;

/// Why bytes are not the SDO message that was expected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SdoError {
    /// Too short.
    Short {
        /// Bytes that such a message has at least.
        expected: usize,
        /// Bytes there.
        got: usize,
    },
    /// The CoE service is another one.
    Service {
        /// The service expected.
        expected: CoeService,
        /// The service found.
        got: CoeService,
    },
    /// The upper three bits of the command byte mean nothing here.
    Command {
        /// The command byte.
        got: u8,
    },
}

impl fmt::Display for SdoError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            SdoError::Short { expected, got } => {
                write!(f, "SDO message too short: expected at least {expected} bytes, got {got}")
            }
            SdoError::Service { expected, got } => write!(f, "expected {expected}, got {got}"),
            SdoError::Command { got } => write!(f, "unknown SDO command {got:#04x}"),
        }
    }
}

impl core::error::Error for SdoError {}

#[cfg(test)]
mod tests;
