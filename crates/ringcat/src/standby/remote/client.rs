//! A client of remote access.

use std::error::Error;
use std::fmt;
use std::io::{self, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};

use ringcat_control::remote::{LONGEST_ANSWER, RemoteAnswer, RemoteQuery, RemoteRole, RemoteState, decode, encode};

use super::token::RemoteToken;

/// Bytes that are read at once.
const PART: usize = 4 << 10;

/// Why there is no answer.
#[derive(Debug)]
#[non_exhaustive]
pub enum RemoteError {
    /// The connection has failed, or its answer did not come in time.
    Connection(io::Error),
    /// What came is no answer of this version.
    Message(String),
    /// The server has refused it.
    Refused(String),
}

impl fmt::Display for RemoteError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            RemoteError::Connection(error) => error.fmt(f),
            RemoteError::Message(what) => f.write_str(what),
            RemoteError::Refused(why) => write!(f, "refused: {why}"),
        }
    }
}

impl Error for RemoteError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match self {
            RemoteError::Connection(error) => Some(error),
            RemoteError::Message(_) | RemoteError::Refused(_) => None,
        }
    }
}

impl From<io::Error> for RemoteError {
    fn from(error: io::Error) -> RemoteError {
        RemoteError::Connection(error)
    }
}

/// A connection to a [`RemoteServer`](super::RemoteServer).
#[derive(Debug)]
pub struct RemoteClient {
    stream: TcpStream,
    arrived: Vec<u8>,
    program: String,
    /// Longest time until an answer is complete.
    limit: Duration,
}

impl RemoteClient {
    /// Connects, and sends the token. `limit`: longest time of the connection and of each answer.
    ///
    /// # Errors
    /// [`RemoteError`].
    pub fn connect(
        address: impl ToSocketAddrs,
        token: &RemoteToken,
        limit: Duration,
    ) -> Result<RemoteClient, RemoteError> {
        let mut last = io::Error::new(io::ErrorKind::NotFound, "the name has no address");
        let connected = address
            .to_socket_addrs()?
            .find_map(|address| TcpStream::connect_timeout(&address, limit).map_err(|error| last = error).ok());
        let Some(stream) = connected else { return Err(last.into()) };
        stream.set_nodelay(true)?;
        stream.set_write_timeout(Some(limit))?;
        let mut client = RemoteClient { stream, arrived: Vec::new(), program: String::new(), limit };
        match client.ask(&RemoteQuery::Hello { token: token.text().to_owned() })? {
            RemoteAnswer::Welcome(program) => client.program = program,
            other => return Err(unexpected(&other)),
        }
        Ok(client)
    }

    /// Version of the program of the server.
    pub fn program(&self) -> &str {
        &self.program
    }

    /// State of the MainDevice.
    ///
    /// # Errors
    /// [`RemoteError`].
    pub fn state(&mut self) -> Result<RemoteState, RemoteError> {
        match self.ask(&RemoteQuery::State)? {
            RemoteAnswer::State(state) => Ok(*state),
            other => Err(unexpected(&other)),
        }
    }

    /// Requests a role, which takes effect with the next cycle, or is refused then; `force`: also while a write into
    /// the memory of a SubDevice is under way.
    ///
    /// # Errors
    /// [`RemoteError`].
    pub fn request(&mut self, role: RemoteRole, force: bool) -> Result<(), RemoteError> {
        self.order(&RemoteQuery::Request { role, force })
    }

    /// Permanent standby on, which also requests the role INACTIVE, or off. Where a write keeps the role, permanent
    /// standby does not begin.
    ///
    /// # Errors
    /// [`RemoteError`].
    pub fn hold(&mut self, held: bool, force: bool) -> Result<(), RemoteError> {
        self.order(&RemoteQuery::Hold { held, force })
    }

    fn order(&mut self, query: &RemoteQuery) -> Result<(), RemoteError> {
        match self.ask(query)? {
            RemoteAnswer::Done => Ok(()),
            other => Err(unexpected(&other)),
        }
    }

    fn ask(&mut self, query: &RemoteQuery) -> Result<RemoteAnswer, RemoteError> {
        let message = |error: ringcat_control::WireError| RemoteError::Message(error.to_string());
        self.stream.write_all(&encode(query).map_err(message)?)?;
        let (mut part, end) = ([0; PART], Instant::now() + self.limit);
        loop {
            if let Some((answer, length)) = decode(&self.arrived, LONGEST_ANSWER).map_err(message)? {
                self.arrived.drain(..length);
                return match answer {
                    RemoteAnswer::Refused(why) => Err(RemoteError::Refused(why)),
                    answer => Ok(answer),
                };
            }
            // The limit is for the whole answer, however many parts it has.
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Err(io::Error::from(io::ErrorKind::TimedOut).into());
            }
            self.stream.set_read_timeout(Some(left))?;
            match self.stream.read(&mut part)? {
                0 => return Err(io::Error::from(io::ErrorKind::UnexpectedEof).into()),
                read => self.arrived.extend_from_slice(&part[..read]),
            }
        }
    }
}

fn unexpected(answer: &RemoteAnswer) -> RemoteError {
    let kind = match answer {
        RemoteAnswer::Welcome(_) => "a welcome",
        RemoteAnswer::State(_) => "a state",
        _ => "another answer",
    };
    RemoteError::Message(format!("{kind} that was not requested"))
}
