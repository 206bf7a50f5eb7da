//! Why a bus cannot be got from a daemon, or given back.

use std::fmt;
use std::io;

use ringcat_control::client::ClientError;
use ringcat_control::connection::ReceiveError;
use ringcat_control::refusal::Refusal;
use ringcat_engine::knowledge::KnowledgeError;
use ringcat_link::LinkError;

use crate::error::Error;

/// Why a bus cannot be got from a daemon, or given back.
#[derive(Debug)]
#[non_exhaustive]
pub enum DaemonError {
    /// The daemon gives no answer, or refuses.
    Client(ClientError),
    /// The links cannot be used.
    Links(LinkError),
    /// The knowledge of the daemon cannot be used.
    Knowledge(KnowledgeError),
    /// The MainDevice reports an error.
    Bus(Error),
    /// The daemon has ended, or does not answer.
    Lost,
    /// The daemon has taken the bus back before.
    TakenBack {
        /// Reason of the daemon.
        cause: String,
    },
}

impl fmt::Display for DaemonError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            DaemonError::Client(error) => error.fmt(f),
            DaemonError::Links(error) => error.fmt(f),
            DaemonError::Knowledge(error) => write!(f, "knowledge of ringcatd about the segment: {error}"),
            DaemonError::Bus(error) => error.fmt(f),
            DaemonError::Lost => f.write_str("ringcatd has ended, or does not answer"),
            DaemonError::TakenBack { cause } => write!(f, "ringcatd has taken the bus back before: {cause}"),
        }
    }
}

impl std::error::Error for DaemonError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            DaemonError::Client(error) => Some(error),
            DaemonError::Links(error) => Some(error),
            DaemonError::Knowledge(error) => Some(error),
            DaemonError::Bus(error) => Some(error),
            DaemonError::Lost | DaemonError::TakenBack { .. } => None,
        }
    }
}

impl DaemonError {
    /// Whether no daemon answers at the socket.
    pub fn is_no_daemon(&self) -> bool {
        matches!(self, DaemonError::Client(ClientError::NoDaemon { .. }))
    }
}

macro_rules! from {
    ($($error:ty => $variant:ident,)*) => {$(
        impl From<$error> for DaemonError {
            fn from(error: $error) -> DaemonError {
                DaemonError::$variant(error.into())
            }
        }
    )*};
}

from! {
    ClientError => Client,
    ReceiveError => Client,
    io::Error => Client,
    LinkError => Links,
    KnowledgeError => Knowledge,
    Error => Bus,
}

impl From<Refusal> for DaemonError {
    fn from(refusal: Refusal) -> DaemonError {
        DaemonError::Client(ClientError::Refused(refusal))
    }
}
