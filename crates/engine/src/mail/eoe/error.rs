//! Errors of reading and setting IP parameters or the address filter.

use core::fmt;

use ringcat_wire::mailbox::eoe::EoeResult;

use crate::mail::MailboxError;

/// Why IP parameters or the filter of a SubDevice were not set or read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct EoeError {
    /// Port of the SubDevice.
    pub port: u8,
    /// The cause.
    pub cause: EoeFailure,
}

/// Cause of a failed request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum EoeFailure {
    /// The mailbox failed.
    Mailbox(MailboxError),
    /// The SubDevice refused.
    Refused(EoeResult),
    /// A name is longer than 32 bytes.
    LongName {
        /// Bytes of the name.
        bytes: usize,
    },
}

impl fmt::Display for EoeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "EoE port {}: {}", self.port, self.cause)
    }
}

impl fmt::Display for EoeFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            EoeFailure::Mailbox(error) => error.fmt(f),
            EoeFailure::Refused(result) => write!(f, "the SubDevice refused: {result}"),
            EoeFailure::LongName { bytes } => write!(f, "a name of {bytes} bytes, at most 32 are possible"),
        }
    }
}

impl core::error::Error for EoeError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        Some(&self.cause)
    }
}

impl From<MailboxError> for EoeFailure {
    fn from(error: MailboxError) -> EoeFailure {
        EoeFailure::Mailbox(error)
    }
}

impl core::error::Error for EoeFailure {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            EoeFailure::Mailbox(error) => Some(error),
            _ => None,
        }
    }
}
