//! Where questions about a master are answered: by the acyclic half in this process, or through a daemon by the process
//! that drives the master. The answers are the same.

use std::path::{Path, PathBuf};
use std::sync::Mutex;

use ringcat::SupervisorThread;
use ringcat::daemon::{Answer, Client, ClientError, Query, Refusal, SegmentOverview, ServiceFault, serving};

use crate::code::{Code, Outcome};
use crate::environment::program_name;
use crate::locks::locked;

/// Most data of a question through a daemon, in bytes.
const MOST_DATA: usize = 64 << 10;

/// Where questions about a master are answered.
#[derive(Debug)]
pub enum Responder {
    /// By the acyclic half in this process.
    Here(SupervisorThread),
    /// By a daemon, or the application that drives the master.
    Daemon(DaemonResponder),
}

/// A master of a daemon, for questions.
#[derive(Debug)]
pub struct DaemonResponder {
    socket: PathBuf,
    master: u32,
    /// Unused connections: several threads may send queries at once.
    idle: Mutex<Vec<Client>>,
}

impl DaemonResponder {
    /// Connects to the daemon at this socket.
    ///
    /// # Errors
    /// None answers, or it has no such master.
    pub fn open(socket: &Path, master: u32) -> Result<DaemonResponder, ClientError> {
        let mut client = Client::connect(socket, &program_name())?;
        let (answer, _) = client.ask(master, Query::Masters, Vec::new())?;
        let present = match answer {
            Answer::Masters(all) => all.into_iter().map(|state| state.master).collect(),
            _ => Vec::new(),
        };
        if !present.contains(&master) {
            return Err(ClientError::Refused(Refusal::NoMaster { master, present }));
        }
        Ok(DaemonResponder { socket: socket.to_owned(), master, idle: Mutex::new(vec![client]) })
    }

    /// The socket of the daemon.
    pub fn socket(&self) -> &Path {
        &self.socket
    }

    /// Number of the master.
    pub fn master(&self) -> u32 {
        self.master
    }

    fn ask(&self, what: &Query, bytes: &[u8]) -> Result<(Answer, Vec<u8>), Refusal> {
        if bytes.len() > MOST_DATA {
            let text = format!("expected at most {MOST_DATA} bytes of data, got {}", bytes.len());
            return Err(Refusal::Service { fault: ServiceFault::TooLong, text });
        }
        let failure = |error: ClientError| match error {
            ClientError::Refused(refusal) => refusal,
            error => Refusal::Failed(error.to_string()),
        };
        // A daemon that was started anew, or has ended an idle connection, is connected to again.
        let idle = locked(&self.idle).pop().filter(Client::is_open);
        let client = idle.map_or_else(|| Client::connect(&self.socket, &program_name()), Ok);
        let mut client = client.map_err(failure)?;
        let answered = client.ask_patiently(self.master, what, bytes);
        if matches!(answered, Ok(_) | Err(ClientError::Refused(_))) {
            locked(&self.idle).push(client);
        }
        answered.map_err(failure)
    }
}

impl Responder {
    /// Sends a query, and waits for the answer. `bytes` is data to write; with the answer comes data that was read.
    ///
    /// # Errors
    /// What [`code_of`] turns into a return code.
    pub fn ask(&self, what: Query, bytes: Vec<u8>) -> Result<(Answer, Vec<u8>), Refusal> {
        match self {
            Responder::Here(supervisor) => serving::answer(supervisor, what, bytes),
            Responder::Daemon(responder) => responder.ask(&what, &bytes),
        }
    }

    /// What a broadcast shows of all SubDevices now. A lost frame counts as no answer.
    ///
    /// # Errors
    /// The acyclic half has ended, or the daemon does not answer.
    pub fn overview(&self) -> Outcome<SegmentOverview> {
        match self.ask(Query::Overview, Vec::new()) {
            Ok((Answer::Overview(seen), _)) => Ok(seen),
            Ok(_) => Err(Code::IO),
            Err(refusal) => Err(code_of(&refusal)),
        }
    }
}

/// The return code of a refusal.
pub fn code_of(refusal: &Refusal) -> Code {
    match refusal {
        Refusal::ReadOnly => Code::NOT_RESERVED,
        Refusal::Owned { .. } | Refusal::Changing { .. } | Refusal::TooManyQueries { .. } => Code::BUSY,
        Refusal::NoMaster { .. } | Refusal::Fault { .. } => Code::GONE,
        Refusal::Silent { .. } => Code::TIMED_OUT,
        Refusal::Unexpected { .. } => Code::INVALID,
        Refusal::Service { fault, .. } => match fault {
            ServiceFault::NoSubDevice => Code::INVALID,
            ServiceFault::NoProtocol => Code::NO_PROTOCOL,
            ServiceFault::TooLong => Code::OVERFLOW,
            ServiceFault::NoAnswer => Code::TIMED_OUT,
            _ => Code::IO,
        },
        _ => Code::IO,
    }
}
