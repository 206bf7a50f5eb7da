//! One TCP client: bytes of an incomplete message, answers that the client has not read yet.

use std::io::{self, ErrorKind, Read, Write};
use std::time::{Duration, Instant};

use mio::net::TcpStream;
use ringcat_wire::mailbox::gateway::{HEADER_LEN, frame_length};

/// Bytes per read; a message has at most 2,049.
const PIECE: usize = 4096;
/// Reads of one client in a row, so that the others are served too.
const PIECES: usize = 4;
/// Most bytes of unread answers before a client is disconnected.
const UNREAD: usize = 64 * 1024;
/// Time limit from the first byte of a message to its last.
const MESSAGE_LIMIT: Duration = Duration::from_secs(2);

/// State of a connection after a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Going {
    /// It waits for the client.
    On,
    /// More can be read.
    Again,
    /// The client has closed the connection.
    Closed,
    /// The client violates the protocol or a limit.
    CutOff,
}

/// A client.
#[derive(Debug)]
pub(super) struct Connection {
    pub stream: TcpStream,
    input: Vec<u8>,
    output: Vec<u8>,
    /// Since when a message is incomplete.
    begun: Option<Instant>,
    /// Time of the last received bytes.
    pub active: Instant,
}

impl Connection {
    pub(super) fn new(stream: TcpStream, now: Instant) -> Connection {
        Connection { stream, input: Vec::new(), output: Vec::new(), begun: None, active: now }
    }

    /// Reads bytes and passes on complete messages, as long as `take` has room for them.
    pub(super) fn read(&mut self, now: Instant, take: &mut impl FnMut(&[u8]) -> bool) -> Going {
        for _ in 0..PIECES {
            match self.hand_out(now, take) {
                Ok(true) => {}
                Ok(false) => return Going::Again,
                Err(()) => return Going::CutOff,
            }
            let mut piece = [0; PIECE];
            match self.stream.read(&mut piece) {
                Ok(0) => return Going::Closed,
                Ok(count) => {
                    self.active = now;
                    self.input.extend_from_slice(&piece[..count]);
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => return Going::On,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(_) => return Going::Closed,
            }
        }
        Going::Again
    }

    /// False where there is no room for the next message; an error where the bytes are no message.
    fn hand_out(&mut self, now: Instant, take: &mut impl FnMut(&[u8]) -> bool) -> Result<bool, ()> {
        let mut at = 0;
        let mut room = true;
        while let Some(header) = self.input.get(at..at + HEADER_LEN) {
            let length = frame_length([header[0], header[1]]).map_err(drop)?;
            let Some(message) = self.input.get(at..at + length) else { break };
            room = take(message);
            if !room {
                break;
            }
            at += length;
            self.begun = None;
        }
        self.input.drain(..at);
        if self.input.is_empty() || !room {
            self.begun = None;
        } else {
            self.begun.get_or_insert(now);
        }
        Ok(room)
    }

    /// Queues an answer.
    pub(super) fn answer(&mut self, bytes: &[u8]) -> Going {
        if self.output.len() + bytes.len() > UNREAD {
            return Going::CutOff;
        }
        self.output.extend_from_slice(bytes);
        self.write()
    }

    /// Sends as many bytes as the client takes.
    pub(super) fn write(&mut self) -> Going {
        while !self.output.is_empty() {
            match self.stream.write(&self.output) {
                Ok(0) => return Going::Closed,
                Ok(count) => drop(self.output.drain(..count)),
                Err(error) if error.kind() == ErrorKind::WouldBlock => return Going::On,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(_) => return Going::Closed,
            }
        }
        Going::On
    }

    /// Whether an incomplete message has exceeded its time limit.
    pub(super) fn is_overdue(&self, now: Instant) -> bool {
        self.begun.is_some_and(|begun| now.duration_since(begun) > MESSAGE_LIMIT)
    }

    /// Sends small answers without delay.
    pub(super) fn prepare(&self) -> io::Result<()> {
        self.stream.set_nodelay(true)
    }
}
