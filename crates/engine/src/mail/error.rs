//! Why a request has no answer.

use core::fmt;
use core::time::Duration;

use ringcat_wire::mailbox::ErrorReply;

use crate::role::NotPermitted;
use crate::supervisor::BusError;

/// Why a request has no answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum MailboxError {
    /// The bus failed.
    Bus(BusError),
    /// Mail is refused in the present role.
    NotPermitted(NotPermitted),
    /// The mailbox is not in use: the SubDevice has none, is in INIT, or does not answer.
    Closed,
    /// The message is too long.
    TooLong {
        /// Bytes of the message.
        bytes: usize,
        /// Longest possible length.
        limit: usize,
    },
    /// The SubDevice did not empty its receive mailbox in time.
    Full {
        /// Time waited.
        limit: Duration,
    },
    /// No answer in time.
    NoAnswer {
        /// Time waited.
        limit: Duration,
    },
    /// The SubDevice answered with a mailbox error.
    Error(ErrorReply),
}

impl fmt::Display for MailboxError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            MailboxError::Bus(error) => error.fmt(f),
            MailboxError::NotPermitted(denied) => denied.fmt(f),
            MailboxError::Closed => {
                f.write_str("the mailbox is not in use: the SubDevice has none, is in INIT or does not answer")
            }
            MailboxError::TooLong { bytes, limit } => {
                write!(f, "message of {bytes} bytes, the mailbox takes {limit}")
            }
            MailboxError::Full { limit } => write!(f, "mailbox still full after {} ms", limit.as_millis()),
            MailboxError::NoAnswer { limit } => write!(f, "no answer within {} ms", limit.as_millis()),
            MailboxError::Error(reply) => match reply.detail_name() {
                Some(name) => write!(f, "mailbox error {:#06x}: {name}", reply.detail),
                None => write!(f, "mailbox error {:#06x}", reply.detail),
            },
        }
    }
}

impl core::error::Error for MailboxError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            MailboxError::Bus(error) => Some(error),
            MailboxError::NotPermitted(error) => Some(error),
            _ => None,
        }
    }
}

impl From<NotPermitted> for MailboxError {
    fn from(denied: NotPermitted) -> MailboxError {
        MailboxError::NotPermitted(denied)
    }
}

impl From<BusError> for MailboxError {
    fn from(error: BusError) -> MailboxError {
        MailboxError::Bus(error)
    }
}
