//! Why a file transfer failed.

use alloc::string::String;
use core::fmt;
use core::time::Duration;

use ringcat_wire::mailbox::foe::FoeErrorCode;

use crate::mail::MailboxError;
use crate::mail::stream::Overflow;

/// Why a file transfer failed.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct FoeError {
    /// Name of the file.
    pub file: String,
    /// The cause.
    pub cause: FoeFailure,
}

/// Cause of a failed file transfer.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum FoeFailure {
    /// The mailbox failed.
    Mailbox(MailboxError),
    /// The SubDevice refused or aborted.
    Refused {
        /// Error code.
        code: FoeErrorCode,
        /// Error text; may be empty.
        text: String,
    },
    /// A packet had another number than expected.
    Packet {
        /// Expected.
        expected: u32,
        /// Received.
        got: u32,
    },
    /// The SubDevice was busy without progress.
    BusyForTooLong {
        /// Duration.
        limit: Duration,
    },
    /// The receiver does not accept this size.
    TooLong(Overflow),
    /// The mailbox is too small for data.
    SmallMailbox,
}

impl fmt::Display for FoeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "FoE \"{}\": {}", self.file, self.cause)
    }
}

impl fmt::Display for FoeFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            FoeFailure::Mailbox(error) => error.fmt(f),
            FoeFailure::Refused { code, text } if text.is_empty() => write!(f, "refused by the SubDevice: {code}"),
            FoeFailure::Refused { code, text } => write!(f, "refused by the SubDevice: {code}: {text}"),
            FoeFailure::Packet { expected, got } => write!(f, "expected packet {expected}, got packet {got}"),
            FoeFailure::BusyForTooLong { limit } => {
                write!(f, "the SubDevice was busy for {} ms without progress", limit.as_millis())
            }
            FoeFailure::TooLong(Overflow { bytes, limit }) => {
                write!(f, "{bytes} bytes or more, at most {limit} were expected")
            }
            FoeFailure::SmallMailbox => f.write_str("the mailbox is too small for data"),
        }
    }
}

impl core::error::Error for FoeError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        Some(&self.cause)
    }
}

impl core::error::Error for FoeFailure {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            FoeFailure::Mailbox(error) => Some(error),
            _ => None,
        }
    }
}

impl From<MailboxError> for FoeFailure {
    fn from(error: MailboxError) -> FoeFailure {
        FoeFailure::Mailbox(error)
    }
}
