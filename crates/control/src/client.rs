//! Questions to a daemon.

use std::fmt;
use std::io;
use std::ops::ControlFlow;
use std::os::fd::AsFd;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use ringcat_link::process::wait_readable;

use crate::connection::{Connection, ReceiveError};
use crate::message::{Answer, Content, Message, Numbered, Query, Right};
use crate::refusal::Refusal;
use crate::wire::{Limits, WireError};

/// The daemon answers to a greeting within this time.
const GREETING: Duration = Duration::from_secs(5);
/// Wait for an answer beyond the time that the query may take.
const BEYOND: Duration = Duration::from_secs(30);
/// Longest wait of a query while the master passes from one process to another.
const CHANGE: Duration = Duration::from_secs(5);
/// Interval of tries meanwhile.
const PAUSE: Duration = Duration::from_millis(5);

/// Why a daemon gave no answer.
#[derive(Debug)]
#[non_exhaustive]
pub enum ClientError {
    /// No daemon answers at this socket.
    NoDaemon {
        /// The socket.
        socket: PathBuf,
        /// The error of the system.
        cause: io::Error,
    },
    /// A daemon may be there, but this user may not connect to its socket.
    NotPermitted {
        /// The socket.
        socket: PathBuf,
        /// The error of the system.
        cause: io::Error,
    },
    /// The connection failed.
    Connection(ReceiveError),
    /// The daemon refuses.
    Refused(Refusal),
    /// The client did not wait for the answer.
    Ended,
}

impl fmt::Display for ClientError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ClientError::NoDaemon { socket, cause } => {
                write!(f, "no daemon answers at {}: {cause}; does ringcatd run? Start it with ", socket.display())?;
                f.write_str("'ethercatctl start' or 'systemctl start ethercat'")
            }
            ClientError::NotPermitted { socket, cause } => write!(
                f,
                "this user may not connect to {}: {cause}; --mode and --group of ringcatd decide which users may",
                socket.display()
            ),
            ClientError::Connection(error) => write!(f, "connection to ringcatd: {error}{}", hint(error)),
            ClientError::Refused(refusal) => write!(f, "ringcatd: {refusal}"),
            ClientError::Ended => f.write_str("the wait for ringcatd was ended"),
        }
    }
}

/// What to do after a failure of a connection.
fn hint(error: &ReceiveError) -> &'static str {
    match error {
        ReceiveError::Ended => {
            "; the daemon has ended: 'ethercatctl status' shows whether it runs, 'ethercatctl start' starts it"
        }
        ReceiveError::TimedOut => {
            "; the daemon does not answer: 'ethercatctl status' shows its state, 'ethercatctl restart' restarts it"
        }
        ReceiveError::Wire(_) | ReceiveError::Io(_) => "",
    }
}

impl std::error::Error for ClientError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        Some(match self {
            ClientError::NoDaemon { cause, .. } | ClientError::NotPermitted { cause, .. } => cause,
            ClientError::Connection(error) => error,
            ClientError::Refused(refusal) => refusal,
            ClientError::Ended => return None,
        })
    }
}

impl From<ReceiveError> for ClientError {
    fn from(error: ReceiveError) -> ClientError {
        match error {
            ReceiveError::Wire(WireError::Version { there }) => {
                ClientError::Refused(Refusal::Version { here: crate::VERSION, there })
            }
            error => ClientError::Connection(error),
        }
    }
}

impl From<io::Error> for ClientError {
    fn from(error: io::Error) -> ClientError {
        ClientError::Connection(error.into())
    }
}

/// A connection to a daemon.
#[derive(Debug)]
pub struct Client {
    connection: Connection,
    right: Right,
    daemon_pid: u32,
    next: u32,
}

impl Client {
    /// Connects to the daemon at this socket; `program` is the name that it logs.
    ///
    /// # Errors
    /// No daemon is there, it has another version, or it refuses.
    pub fn connect(socket: &Path, program: &str) -> Result<Client, ClientError> {
        let no_daemon = |cause: io::Error| match cause.kind() {
            io::ErrorKind::PermissionDenied => ClientError::NotPermitted { socket: socket.to_owned(), cause },
            _ => ClientError::NoDaemon { socket: socket.to_owned(), cause },
        };
        let connection = Connection::new(UnixStream::connect(socket).map_err(no_daemon)?)?;
        let hello: Message = Content::Hello { program: program.to_owned() }.into();
        // A daemon that refuses closes the connection, and has said why before.
        let sent = connection.send(&hello);
        match connection.receive(Limits::OWNER, Some(GREETING))?.content {
            Content::Welcome { right, pid } => {
                sent?;
                Ok(Client { connection, right, daemon_pid: pid, next: 0 })
            }
            Content::Refused(refusal) => Err(ClientError::Refused(refusal)),
            _ => Err(unexpected("a greeting")),
        }
    }

    /// What this client may do.
    pub fn right(&self) -> Right {
        self.right
    }

    /// Process id of the daemon.
    pub fn daemon_pid(&self) -> u32 {
        self.daemon_pid
    }

    /// Sends a query about a master; `bytes` is data to write. Returns the answer, and data that was read.
    ///
    /// # Errors
    /// The daemon refuses, or does not answer in time: within a minute, or 10 minutes where flash memory is written.
    pub fn ask(&mut self, master: u32, what: Query, bytes: Vec<u8>) -> Result<(Answer, Vec<u8>), ClientError> {
        let limit = what.limit() + BEYOND;
        self.ask_meanwhile(master, what, bytes, (limit, &mut || ControlFlow::Continue(())))
    }

    /// As [`Client::ask`]; `meanwhile` is called after each interval `every` without a message, and may end the wait.
    ///
    /// # Errors
    /// As [`Client::ask`]; `meanwhile` has ended it.
    pub fn ask_meanwhile(
        &mut self,
        master: u32,
        what: Query,
        bytes: Vec<u8>,
        (every, meanwhile): (Duration, &mut dyn FnMut() -> ControlFlow<()>),
    ) -> Result<(Answer, Vec<u8>), ClientError> {
        self.next = self.next.wrapping_add(1);
        let limit = what.limit() + BEYOND;
        let content = Content::Query(Numbered { id: self.next, master, what });
        self.connection.send(&Message { content, bytes })?;
        loop {
            let (begin, mut left) = (Instant::now(), limit);
            while wait_readable(&[self.connection.as_fd()], every.min(left)) == 0 && !left.is_zero() {
                if meanwhile().is_break() {
                    return Err(ClientError::Ended);
                }
                left = limit.saturating_sub(begin.elapsed());
            }
            let message = self.connection.receive(Limits::OWNER, Some(left.max(PAUSE)))?;
            match message.content {
                Content::Answer(answer) if answer.id == self.next => {
                    return answer.what.map(|answer| (answer, message.bytes)).map_err(ClientError::Refused);
                }
                Content::Answer(_) | Content::Underway { .. } => {}
                Content::Refused(refusal) => return Err(ClientError::Refused(refusal)),
                _ => return Err(unexpected("an answer")),
            }
        }
    }

    /// As [`Client::ask`]. While the master passes from one process to another, or its owner has as many queries as
    /// it may have, the query is repeated, for up to 5 s.
    ///
    /// # Errors
    /// As [`Client::ask`].
    pub fn ask_patiently(&mut self, master: u32, what: &Query, bytes: &[u8]) -> Result<(Answer, Vec<u8>), ClientError> {
        let every = what.limit() + BEYOND;
        self.ask_patiently_meanwhile(master, what, bytes, (every, &mut || ControlFlow::Continue(())))
    }

    /// As [`Client::ask_patiently`] and [`Client::ask_meanwhile`].
    ///
    /// # Errors
    /// As [`Client::ask`].
    pub fn ask_patiently_meanwhile(
        &mut self,
        master: u32,
        what: &Query,
        bytes: &[u8],
        (every, meanwhile): (Duration, &mut dyn FnMut() -> ControlFlow<()>),
    ) -> Result<(Answer, Vec<u8>), ClientError> {
        let begin = Instant::now();
        loop {
            match self.ask_meanwhile(master, what.clone(), bytes.to_vec(), (every, &mut *meanwhile)) {
                Err(ClientError::Refused(Refusal::Changing { .. } | Refusal::TooManyQueries { .. }))
                    if begin.elapsed() < CHANGE =>
                {
                    if meanwhile().is_break() {
                        return Err(ClientError::Ended);
                    }
                    std::thread::sleep(PAUSE);
                }
                answered => return answered,
            }
        }
    }

    /// Whether the daemon has neither ended the connection nor sent a message without a query: between two queries it
    /// sends nothing but why it ends the connection.
    pub fn is_open(&self) -> bool {
        wait_readable(&[self.connection.as_fd()], Duration::ZERO) == 0
    }

    /// The connection, to take a master on it.
    pub fn into_connection(self) -> Connection {
        self.connection
    }
}

fn unexpected(expected: &str) -> ClientError {
    ClientError::Refused(Refusal::Unexpected { expected: expected.to_owned() })
}

#[cfg(test)]
mod tests {
    use std::os::unix::net::UnixListener;

    use super::*;

    // covers: daemon
    #[test]
    fn a_daemon_that_has_ended_or_does_not_answer_is_named_with_what_to_do() {
        let said = |kind: io::ErrorKind| ClientError::from(io::Error::from(kind)).to_string();
        let ended = said(io::ErrorKind::BrokenPipe);
        assert!(ended.contains("the daemon has ended: ") && ended.contains("'ethercatctl start'"), "{ended}");
        assert_eq!([said(io::ErrorKind::ConnectionReset), said(io::ErrorKind::UnexpectedEof)], [&*ended, &*ended]);
        let silent = said(io::ErrorKind::TimedOut);
        assert!(
            silent.contains("the daemon does not answer: ") && silent.contains("'ethercatctl restart'"),
            "{silent}"
        );
    }

    /// A daemon that refuses this many questions before it answers one; the number of questions that it got.
    fn refusing(refusals: Vec<Refusal>) -> (PathBuf, std::thread::JoinHandle<usize>) {
        static NUMBER: std::sync::atomic::AtomicU32 = std::sync::atomic::AtomicU32::new(0);
        let number = NUMBER.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        let socket = std::env::temp_dir().join(format!("ringcat-client-{}-{number}", std::process::id()));
        let listener = UnixListener::bind(&socket).expect("it is free");
        let daemon = std::thread::spawn(move || {
            let connection = Connection::new(listener.accept().expect("a client").0).expect("it is open");
            connection.receive(Limits::OWNER, Some(GREETING)).expect("a greeting");
            let welcome = Content::Welcome { right: Right::Change, pid: std::process::id() };
            connection.send(&welcome.into()).expect("the client listens");
            let (mut refusals, mut questions) = (refusals.into_iter(), 0);
            while let Ok(message) = connection.receive(Limits::OWNER, Some(GREETING)) {
                let Content::Query(Numbered { id, master, .. }) = message.content else { panic!("{message:?}") };
                questions += 1;
                let what = refusals.next().map_or_else(|| Ok(Answer::Masters(Vec::new())), Err);
                connection.send(&Content::Answer(Numbered { id, master, what }).into()).expect("the client listens");
            }
            questions
        });
        (socket, daemon)
    }

    fn ask(refusals: Vec<Refusal>) -> (Result<(Answer, Vec<u8>), ClientError>, usize) {
        let (socket, daemon) = refusing(refusals);
        let mut client = Client::connect(&socket, "test").expect("it listens");
        let answered = client.ask_patiently(0, &Query::Masters, &[]);
        drop(client);
        std::fs::remove_file(socket).expect("it is there");
        (answered, daemon.join().expect("it ends"))
    }

    // covers: daemon
    #[test]
    fn a_question_is_asked_again_while_the_master_changes_hands() {
        let (answered, questions) = ask(vec![Refusal::Changing { master: 0 }; 3]);
        assert!(matches!(answered, Ok((Answer::Masters(_), _))), "{answered:?}");
        assert_eq!(questions, 4);
    }

    // covers: daemon
    #[test]
    fn a_wait_for_an_answer_calls_back_meanwhile() {
        let (near, far) = UnixStream::pair().expect("a pair");
        let connection = Connection::new(near).expect("it is open");
        let mut client = Client { connection, right: Right::Read, daemon_pid: 0, next: 0 };
        let daemon = Connection::new(far).expect("it is open");
        let mut calls = 0;
        let mut meanwhile = || {
            calls += 1;
            if calls == 3 {
                let what = Ok(Answer::Masters(Vec::new()));
                daemon.send(&Content::Answer(Numbered { id: 1, master: 0, what }).into()).expect("the client listens");
            }
            ControlFlow::Continue(())
        };
        let answered = client.ask_meanwhile(0, Query::Masters, Vec::new(), (PAUSE, &mut meanwhile));
        assert!(matches!(answered, Ok((Answer::Masters(_), _))), "{answered:?}");
        assert_eq!(calls, 3);
        let ended = client.ask_patiently_meanwhile(0, &Query::Masters, &[], (PAUSE, &mut || ControlFlow::Break(())));
        assert!(matches!(ended, Err(ClientError::Ended)), "{ended:?}");
    }

    // covers: daemon
    #[test]
    fn other_refusals_are_final() {
        let fault = || Refusal::Fault { master: 0, cause: "no interface".to_owned() };
        let (answered, questions) = ask(vec![Refusal::Changing { master: 0 }, fault()]);
        assert!(matches!(answered, Err(ClientError::Refused(refusal)) if refusal == fault()));
        assert_eq!(questions, 2);
    }
}
