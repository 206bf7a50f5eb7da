//! SDO upload and download, expedited, normal and segmented (protocol 6.3).
//!
//! Converts the payload of a mailbox message of protocol CoE: CoE header, command byte and the rest of the message. The
//! engine handles sequences, toggle bits and time limits.

mod abort;
mod codec;
mod request;
mod response;

use core::fmt;

use super::coe::CoeService;

pub use abort::AbortCode;
pub use request::SdoRequest;
pub use response::SdoResponse;

/// Bytes of CoE header, command, index, subindex and size: an SDO message without the data of a normal transfer.
pub const INITIATE_LEN: usize = 10;
/// Bytes of CoE header and command: a segment without its data.
pub const SEGMENT_OVERHEAD: usize = 3;
/// Minimum number of data bytes of a segment; shorter data is padded.
pub const SEGMENT_MIN_DATA: usize = 7;
/// Maximum number of data bytes of an expedited transfer.
pub const EXPEDITED_MAX_DATA: usize = 4;

/// The reason for which bytes are not the expected SDO message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SdoError {
    /// Too short.
    Short {
        /// Minimum number of bytes of the message.
        expected: usize,
        /// Bytes available.
        got: usize,
    },
    /// The CoE service differs.
    Service {
        /// The service expected.
        expected: CoeService,
        /// The service found.
        got: CoeService,
    },
    /// The upper three bits of the command byte are invalid in this message.
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
