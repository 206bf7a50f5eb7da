//! Why an SDO transfer failed.

use core::fmt;

use ringcat_wire::mailbox::sdo::AbortCode;

use super::address::SdoAddress;
use crate::mail::MailboxError;
use crate::mail::stream::Overflow;

/// Why an SDO transfer failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct SdoError {
    /// The object.
    pub object: SdoAddress,
    /// The cause.
    pub cause: SdoFailure,
}

/// Cause of a failed SDO transfer. Except for the SubDevice's own abort, the MainDevice aborted the transfer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SdoFailure {
    /// The mailbox failed.
    Mailbox(MailboxError),
    /// The SubDevice aborted.
    Aborted(AbortCode),
    /// The SubDevice did not alternate the toggle bit.
    Toggle,
    /// The SubDevice sent an empty segment that was not the last one.
    EmptySegment,
    /// The SubDevice announced another size than it sent.
    Size {
        /// Announced bytes.
        announced: u64,
        /// Bytes received until the announced size was exceeded or the last segment was received.
        got: u64,
    },
    /// The receiver does not accept this size.
    TooLong(Overflow),
    /// The size of the data to write is unknown, or exceeds 32 bits.
    UnknownSize,
    /// The source ended before its announced size.
    SourceEnded {
        /// Bytes that it delivered.
        got: u64,
        /// Announced bytes.
        announced: u64,
    },
}

impl SdoError {
    /// Whether the SubDevice has no such object.
    pub(crate) fn is_missing_object(&self) -> bool {
        self.cause == SdoFailure::Aborted(AbortCode::OBJECT_DOES_NOT_EXIST)
    }

    /// Whether frames were lost, or the mailbox was closed.
    pub(crate) fn is_interrupted(&self) -> bool {
        matches!(self.cause, SdoFailure::Mailbox(MailboxError::Bus(_) | MailboxError::Closed))
    }
}

impl fmt::Display for SdoError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "SDO {}: {}", self.object, self.cause)
    }
}

impl fmt::Display for SdoFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SdoFailure::Mailbox(error) => error.fmt(f),
            SdoFailure::Aborted(code) => write!(f, "aborted by the SubDevice: {code}"),
            SdoFailure::Toggle => f.write_str("the SubDevice did not alternate the toggle bit"),
            SdoFailure::EmptySegment => f.write_str("the SubDevice sent an empty segment that was not the last one"),
            SdoFailure::Size { announced, got } => {
                write!(f, "the SubDevice announced {announced} bytes and sent {got}")
            }
            SdoFailure::TooLong(Overflow { bytes, limit }) => {
                write!(f, "{bytes} bytes, at most {limit} were expected")
            }
            SdoFailure::UnknownSize => f.write_str("an SDO download needs a size, up to 4 GiB"),
            SdoFailure::SourceEnded { got, announced } => {
                write!(f, "expected {announced} bytes to write, the source had {got}")
            }
        }
    }
}

impl core::error::Error for SdoError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        Some(&self.cause)
    }
}

impl core::error::Error for SdoFailure {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            SdoFailure::Mailbox(error) => Some(error),
            _ => None,
        }
    }
}
