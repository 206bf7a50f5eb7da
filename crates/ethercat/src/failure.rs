//! Why a command ends with exit code 1.

use std::io;

use ringcat_control::client::ClientError;
use ringcat_control::refusal::{Refusal, ServiceFault};

/// Why a command ends with exit code 1.
#[derive(Debug)]
#[non_exhaustive]
pub enum Failure {
    /// It was called in a wrong way: the help of the command follows.
    Usage(String),
    /// A text as it is.
    Message(String),
    /// The output was closed: no further message is written.
    Closed,
    /// The daemon gave no answer, or refuses.
    Asked(ClientError),
}

impl Failure {
    /// What was done failed.
    pub fn failed(text: impl Into<String>) -> Failure {
        Failure::Message(text.into() + "\n")
    }

    /// The command was called in a wrong way.
    pub fn usage(text: impl Into<String>) -> Failure {
        Failure::Usage(text.into())
    }

    /// The code with which a SubDevice has refused.
    pub fn aborted(&self) -> Option<u32> {
        match self {
            Failure::Asked(ClientError::Refused(Refusal::Service { fault: ServiceFault::Aborted(code), .. })) => {
                Some(*code)
            }
            _ => None,
        }
    }

    /// The refusal if nothing drives the master: it waits for its interface, or leaves the bus to another MainDevice.
    pub const fn not_driven(&self) -> Option<&Refusal> {
        match self {
            Failure::Asked(ClientError::Refused(refusal @ Refusal::Fault { .. })) => Some(refusal),
            _ => None,
        }
    }

    /// How a service of a SubDevice has failed.
    pub fn fault(&self) -> Option<ServiceFault> {
        match self {
            Failure::Asked(ClientError::Refused(Refusal::Service { fault, .. })) => Some(*fault),
            _ => None,
        }
    }

    /// With the help of the command where it was called in a wrong way.
    #[must_use]
    pub fn with_help(self, help: impl FnOnce() -> String) -> Failure {
        match self {
            Failure::Usage(text) => Failure::Message(format!("{text}\n\n{}", help())),
            other => other,
        }
    }

    /// What the standard error gets.
    pub fn text(&self) -> String {
        match self {
            Failure::Usage(text) => format!("{text}\n"),
            Failure::Message(text) => text.clone(),
            Failure::Closed => String::new(),
            Failure::Asked(error @ ClientError::NoDaemon { .. }) => {
                format!("{error}; --main INTERFACE and --sim FILE do without it.\n")
            }
            // The SubDevice has failed, not the daemon.
            Failure::Asked(ClientError::Refused(refusal @ (Refusal::Service { .. } | Refusal::Failed(_)))) => {
                format!("{refusal}\n")
            }
            Failure::Asked(error) => format!("{error}\n"),
        }
    }
}

/// What has failed of several SubDevices: a command goes on with the others.
#[derive(Debug, Default)]
pub struct Failures(Vec<String>);

impl Failures {
    /// Keeps a failure of the SubDevice at a position, if it is one.
    ///
    /// # Errors
    /// It is not the SubDevice that has failed: the others would fail too.
    pub fn keep(&mut self, master: u32, position: u16, done: Result<(), Failure>) -> Result<(), Failure> {
        match done {
            Err(failure) if failure.not_driven().is_some() => Err(failure),
            Err(Failure::Asked(ClientError::Refused(refusal))) => {
                self.0.push(format!("Master {master}, slave {position}: {refusal}"));
                Ok(())
            }
            other => other,
        }
    }

    /// All that has failed.
    ///
    /// # Errors
    /// Something has.
    pub fn all(self) -> Result<(), Failure> {
        if self.0.is_empty() { Ok(()) } else { Err(Failure::failed(self.0.join("\n"))) }
    }
}

/// The daemon gives an answer of another kind; a daemon of this version does not.
pub fn unexpected() -> Failure {
    Failure::failed("The daemon has answered another question.")
}

impl From<ClientError> for Failure {
    fn from(error: ClientError) -> Failure {
        Failure::Asked(error)
    }
}

/// The output cannot be written.
impl From<io::Error> for Failure {
    fn from(error: io::Error) -> Failure {
        match error.kind() {
            io::ErrorKind::BrokenPipe => Failure::Closed,
            _ => Failure::failed(format!("Failed to write the output: {error}")),
        }
    }
}
