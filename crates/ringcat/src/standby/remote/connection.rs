//! One client of remote access: bytes that have arrived, bytes that are still to be sent, and the time limit.

use std::io::{self, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use ringcat_control::remote::{LONGEST_QUERY, RemoteAnswer, RemoteQuery, decode, encode};

use super::token::RemoteToken;

/// A client that has not sent the token within this time is disconnected.
const HELLO: Duration = Duration::from_secs(2);
/// A client that does not receive an answer within this time is disconnected.
const TAKES: Duration = Duration::from_secs(5);
/// Bytes of a query that are kept at most: its header and content.
const MOST: usize = LONGEST_QUERY + 64;

/// What the client may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// It has not sent the token.
    Unknown,
    /// Its queries are answered.
    Admitted,
    /// It gets its last answer, and is then disconnected.
    Ends,
}

/// A connection.
#[derive(Debug)]
pub(super) struct Connection {
    stream: TcpStream,
    stage: Stage,
    arrived: Vec<u8>,
    leaving: Vec<u8>,
    /// The time at which it is disconnected; later after each message.
    limit: Instant,
    silence: Duration,
}

impl Connection {
    /// A client that has connected. `silence`: how long it may be idle.
    pub fn new(stream: TcpStream, silence: Duration, now: Instant) -> io::Result<Connection> {
        stream.set_nonblocking(true)?;
        stream.set_nodelay(true)?;
        let (arrived, leaving) = (Vec::new(), Vec::new());
        Ok(Connection { stream, stage: Stage::Unknown, arrived, leaving, limit: now + HELLO, silence })
    }

    /// Whether it has sent the token.
    pub fn is_admitted(&self) -> bool {
        self.stage == Stage::Admitted
    }

    /// One turn: at most one query is answered. False if the connection ends.
    pub fn work(
        &mut self,
        token: &RemoteToken,
        now: Instant,
        answer: impl FnOnce(RemoteQuery) -> RemoteAnswer,
    ) -> bool {
        self.turn(token, now, answer).unwrap_or(false) && now < self.limit
    }

    fn turn(
        &mut self,
        token: &RemoteToken,
        now: Instant,
        answer: impl FnOnce(RemoteQuery) -> RemoteAnswer,
    ) -> io::Result<bool> {
        if !self.flush(now)? {
            return Ok(true);
        }
        if self.stage == Stage::Ends || !self.fill()? {
            return Ok(false);
        }
        let query = match decode::<RemoteQuery>(&self.arrived, LONGEST_QUERY) {
            Ok(Some((query, length))) => {
                self.arrived.drain(..length);
                Ok(query)
            }
            Ok(None) => return Ok(true),
            Err(error) => Err(error.to_string()),
        };
        let answer = match (query, self.stage) {
            (Ok(RemoteQuery::Hello { token: shown }), Stage::Unknown) if token.is(&shown) => {
                self.stage = Stage::Admitted;
                RemoteAnswer::Welcome(env!("CARGO_PKG_VERSION").to_owned())
            }
            (Ok(query), Stage::Admitted) => answer(query),
            (Ok(_), _) => self.refuse("another token".to_owned()),
            (Err(error), _) => self.refuse(error),
        };
        self.leaving = encode(&answer).map_err(io::Error::other)?;
        self.limit = now + TAKES;
        self.flush(now)?;
        Ok(true)
    }

    fn refuse(&mut self, why: String) -> RemoteAnswer {
        self.stage = Stage::Ends;
        RemoteAnswer::Refused(why)
    }

    /// Sends what is left of an answer; true if all of it has left.
    fn flush(&mut self, now: Instant) -> io::Result<bool> {
        if self.leaving.is_empty() {
            return Ok(true);
        }
        match self.stream.write(&self.leaving) {
            Ok(sent) => {
                self.leaving.drain(..sent);
            }
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
            Err(error) => return Err(error),
        }
        if self.leaving.is_empty() {
            self.leaving = Vec::new();
            self.limit = now + self.silence;
        }
        Ok(self.leaving.is_empty())
    }

    /// Takes what has arrived; false if the client has ended.
    fn fill(&mut self) -> io::Result<bool> {
        let mut part = [0; MOST];
        let room = MOST.saturating_sub(self.arrived.len());
        if room == 0 {
            return Ok(true);
        }
        match self.stream.read(&mut part[..room]) {
            Ok(0) => Ok(false),
            Ok(read) => {
                self.arrived.extend_from_slice(&part[..read]);
                Ok(true)
            }
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => Ok(true),
            Err(error) => Err(error),
        }
    }
}
