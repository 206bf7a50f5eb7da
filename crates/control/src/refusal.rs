//! Why something is not done: what was expected, what is so, and what helps, in one sentence.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::owner::Owner;

/// Why a query has no answer, or a connection ends.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Refusal {
    /// The versions differ.
    Version {
        /// Version of the side that refuses.
        here: u16,
        /// Version of the message.
        there: u16,
    },
    /// The client may only read.
    ReadOnly,
    /// There is no such master.
    NoMaster {
        /// The requested number.
        master: u32,
        /// Numbers of the masters that exist.
        present: Vec<u32>,
    },
    /// Another application drives the master.
    Owned {
        /// Number of the master.
        master: u32,
        /// The application.
        by: Owner,
    },
    /// The owner of the master does not answer.
    Silent {
        /// Number of the master.
        master: u32,
        /// The owner.
        owner: Owner,
        /// Time for which it has not answered.
        limit_ms: u32,
    },
    /// The master passes from one process to another at this moment.
    Changing {
        /// Number of the master.
        master: u32,
    },
    /// The master is not driven at present.
    Fault {
        /// Number of the master.
        master: u32,
        /// Reason why it is not driven.
        cause: String,
    },
    /// The request was carried out and failed; the reason.
    Failed(String),
    /// A message of another kind was expected.
    Unexpected {
        /// The expected message.
        expected: String,
    },
    /// The maximum number of clients is connected.
    TooManyClients {
        /// This maximum.
        limit: usize,
    },
    /// The owner of the master has the maximum number of pending queries, or of bytes in them.
    TooManyQueries {
        /// Number of the master.
        master: u32,
        /// The owner.
        owner: Owner,
    },
    /// A service of a SubDevice has failed.
    Service {
        /// Kind of the failure.
        fault: ServiceFault,
        /// What happened, in one sentence.
        text: String,
    },
}

/// How a service of a SubDevice has failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum ServiceFault {
    /// There is no SubDevice at this position.
    NoSubDevice,
    /// The SubDevice has no mailbox, or does not support the protocol.
    NoProtocol,
    /// The SubDevice has refused with this code: an abort code of an SDO, an error code of an IDN.
    Aborted(u32),
    /// The data is too long.
    TooLong,
    /// The SubDevice did not answer in time.
    NoAnswer,
    /// Something else.
    Other,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Refusal::Version { here, there } => {
                write!(f, "expected control version {here}, got {there}: install ringcatd and library of one release")
            }
            Refusal::ReadOnly => f.write_str(
                "this user may read only; --mode and --group of ringcatd say which users may change the bus",
            ),
            Refusal::NoMaster { master, present } => {
                let present: Vec<String> = present.iter().map(u32::to_string).collect();
                write!(f, "there is no master {master}; there are: {}", present.join(", "))
            }
            Refusal::Owned { master, by } => write!(f, "master {master} is driven by {by}"),
            Refusal::Silent { master, owner, limit_ms } => {
                write!(f, "master {master}: {owner} drives it and has not answered for {limit_ms} ms")
            }
            Refusal::Changing { master } => {
                write!(f, "master {master} passes from one process to another now: ask again")
            }
            Refusal::Fault { master, cause } => write!(f, "master {master} is not driven: {cause}"),
            Refusal::Failed(cause) => f.write_str(cause),
            Refusal::Unexpected { expected } => write!(f, "expected {expected}"),
            Refusal::TooManyClients { limit } => write!(f, "ringcatd has the maximum number of clients: {limit}"),
            Refusal::TooManyQueries { master, owner } => {
                write!(f, "master {master}: {owner} drives it and has the maximum number of pending queries or bytes")
            }
            Refusal::Service { text, .. } => f.write_str(text),
        }
    }
}

impl std::error::Error for Refusal {}
