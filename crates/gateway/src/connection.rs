//! One TCP client: bytes that are not a whole message yet, answers that it has not read yet.

use std::io::{self, ErrorKind, Read, Write};
use std::time::{Duration, Instant};

use mio::net::TcpStream;
use ringcat_wire::mailbox::gateway::{HEADER_LEN, frame_length};

/// Bytes that are read in one go; a message has at most 2,049.
const PIECE: usize = 4096;
/// Pieces of one client in one go, so that the others have their turn.
const PIECES: usize = 4;
/// A client that leaves so many bytes of answers unread is cut off.
const UNREAD: usize = 64 * 1024;
/// A message that has begun has to be complete within.
const MESSAGE_LIMIT: Duration = Duration::from_secs(2);

/// Whether a connection goes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Going {
    /// It waits for the client.
    On,
    /// There is more to read.
    Again,
    /// The client has closed it.
    Closed,
    /// The client does what it must not.
    CutOff,
}

/// A client.
#[derive(Debug)]
pub(super) struct Connection {
    pub stream: TcpStream,
    input: Vec<u8>,
    output: Vec<u8>,
    /// Since when a message is not complete.
    begun: Option<Instant>,
    /// When something came last.
    pub active: Instant,
}

impl Connection {
    pub(super) fn new(stream: TcpStream, now: Instant) -> Connection {
        Connection { stream, input: Vec::new(), output: Vec::new(), begun: None, active: now }
    }

    /// Takes in what has come and hands out whole messages, as long as `take` has room for them.
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

    /// False where there is no room for the next message; an error where the client sends what is none.
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

    /// Sends what the client takes.
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

    /// It has had its time to complete a message.
    pub(super) fn is_overdue(&self, now: Instant) -> bool {
        self.begun.is_some_and(|begun| now.duration_since(begun) > MESSAGE_LIMIT)
    }

    /// Small answers are sent at once.
    pub(super) fn prepare(&self) -> io::Result<()> {
        self.stream.set_nodelay(true)
    }
}
