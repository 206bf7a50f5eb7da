//! Messages and descriptors over a Unix socket.
//!
//! A side that sends half a message loses its connection after a limit. Memory grows with what has arrived, not with
//! what was announced.

use std::fmt;
use std::io::{self, Read, Write};
use std::os::fd::{AsFd, BorrowedFd, OwnedFd, RawFd};
use std::os::unix::net::UnixStream;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use ringcat_link::descriptors;

use crate::message::Message;
use crate::wire::{self, HEADER, Header, Limits, WireError};

/// A message that has begun arrives within this time.
const WHOLE: Duration = Duration::from_secs(5);
/// A message leaves within this time.
const LEAVES: Duration = Duration::from_secs(5);
/// Bytes that are read at once.
const PART: usize = 64 << 10;

/// Why no message was received.
#[derive(Debug)]
#[non_exhaustive]
pub enum ReceiveError {
    /// The other side has closed the connection.
    Ended,
    /// Nothing came in time.
    TimedOut,
    /// What came is no message.
    Wire(WireError),
    /// The system reports an error.
    Io(io::Error),
}

impl fmt::Display for ReceiveError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ReceiveError::Ended => f.write_str("the other side has closed the connection"),
            ReceiveError::TimedOut => f.write_str("no whole message came in time"),
            ReceiveError::Wire(error) => error.fmt(f),
            ReceiveError::Io(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for ReceiveError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            ReceiveError::Wire(error) => Some(error),
            ReceiveError::Io(error) => Some(error),
            ReceiveError::Ended | ReceiveError::TimedOut => None,
        }
    }
}

impl From<io::Error> for ReceiveError {
    fn from(error: io::Error) -> ReceiveError {
        match error.kind() {
            io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut => ReceiveError::TimedOut,
            io::ErrorKind::UnexpectedEof | io::ErrorKind::ConnectionReset => ReceiveError::Ended,
            _ => ReceiveError::Io(error),
        }
    }
}

impl From<WireError> for ReceiveError {
    fn from(error: WireError) -> ReceiveError {
        ReceiveError::Wire(error)
    }
}

/// One end of a connection. One thread receives; any thread sends.
#[derive(Debug)]
pub struct Connection {
    stream: UnixStream,
    /// Held while a message leaves, so that no other one comes between its parts.
    sending: Mutex<()>,
}

impl Connection {
    /// Messages over this socket.
    ///
    /// # Errors
    /// The system reports one.
    pub fn new(stream: UnixStream) -> io::Result<Connection> {
        stream.set_write_timeout(Some(LEAVES))?;
        Ok(Connection { stream, sending: Mutex::new(()) })
    }

    /// The socket.
    pub fn stream(&self) -> &UnixStream {
        &self.stream
    }

    /// Ends the connection in both directions; a thread that receives finds its end.
    pub fn shut_down(&self) {
        // It may be closed already.
        let _ = self.stream.shutdown(std::net::Shutdown::Both);
    }

    /// Sends a message.
    ///
    /// # Errors
    /// The other side has closed the connection, or does not read.
    pub fn send(&self, message: &Message) -> io::Result<()> {
        self.send_with(message, &[])
    }

    /// Sends a message with duplicates of descriptors.
    ///
    /// # Errors
    /// As [`Connection::send`].
    pub fn send_with(&self, message: &Message, descriptors: &[RawFd]) -> io::Result<()> {
        let bytes = wire::encode(message).map_err(|error| io::Error::new(io::ErrorKind::InvalidInput, error))?;
        let _held = self.sending.lock().unwrap_or_else(PoisonError::into_inner);
        // The header is short: it leaves at once, with the descriptors.
        while let Err(error) = descriptors::send(&self.stream, &bytes[..HEADER], descriptors) {
            if error.kind() != io::ErrorKind::Interrupted {
                return Err(error);
            }
        }
        (&self.stream).write_all(&bytes[HEADER..])
    }

    /// Receives a message, whose first byte comes within `limit`, and its descriptors.
    ///
    /// # Errors
    /// See [`ReceiveError`]. Nothing more can be received then, except after a time-out before the first byte.
    pub fn receive(&self, limits: Limits, limit: Option<Duration>) -> Result<(Message, Vec<OwnedFd>), ReceiveError> {
        self.stream.set_read_timeout(limit)?;
        let mut header = [0; HEADER];
        let (mut filled, descriptors) = loop {
            match descriptors::receive(&self.stream, &mut header) {
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                received => break received?,
            }
        };
        if filled == 0 {
            return Err(ReceiveError::Ended);
        }
        let until = Instant::now() + WHOLE;
        while filled < HEADER {
            filled += self.read(&mut header[filled..], until)?;
        }
        let header = Header::decode(&header, limits)?;
        let content = self.read_all(header.content, until)?;
        let bytes = self.read_all(header.bytes, until)?;
        Ok((Message { content: wire::decode_content(&content)?, bytes }, descriptors))
    }

    fn read_all(&self, length: usize, until: Instant) -> Result<Vec<u8>, ReceiveError> {
        let mut bytes = Vec::new();
        while bytes.len() < length {
            let begin = bytes.len();
            bytes.resize(begin + PART.min(length - begin), 0);
            let read = self.read(&mut bytes[begin..], until)?;
            bytes.truncate(begin + read);
        }
        Ok(bytes)
    }

    /// Reads some bytes.
    fn read(&self, bytes: &mut [u8], until: Instant) -> Result<usize, ReceiveError> {
        let left = until.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Err(ReceiveError::TimedOut);
        }
        self.stream.set_read_timeout(Some(left))?;
        match (&self.stream).read(bytes) {
            Ok(0) => Err(ReceiveError::Ended),
            Ok(read) => Ok(read),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => Ok(0),
            Err(error) => Err(error.into()),
        }
    }
}

impl AsFd for Connection {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.stream.as_fd()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::Content;

    fn pair() -> (Connection, Connection) {
        let (near, far) = UnixStream::pair().expect("a pair");
        (Connection::new(near).expect("a socket"), Connection::new(far).expect("a socket"))
    }

    // covers: daemon
    #[test]
    fn messages_of_any_length_arrive_in_order_with_their_descriptors() {
        let (near, far) = pair();
        let long = Message { content: Content::Knowledge, bytes: vec![7; 3 << 20] };
        let sent = long.clone();
        let sender = std::thread::spawn(move || {
            near.send_with(&sent, &[0, 1]).expect("it is read");
            near.send(&Content::Take { master: 1 }.into()).expect("it is read");
        });
        let (first, descriptors) = far.receive(Limits::OWNER, None).expect("it is sent");
        assert!(first == long && descriptors.len() == 2);
        let (second, descriptors) = far.receive(Limits::OWNER, None).expect("it is sent");
        assert_eq!((second, descriptors.len()), (Content::Take { master: 1 }.into(), 0));
        sender.join().expect("no panic");
        assert!(matches!(far.receive(Limits::OWNER, None), Err(ReceiveError::Ended)));
    }

    // covers: daemon
    #[test]
    fn half_a_message_and_silence_end_after_their_limits() {
        let (near, far) = pair();
        let limit = Some(Duration::from_millis(20));
        assert!(matches!(far.receive(Limits::CLIENT, limit), Err(ReceiveError::TimedOut)));
        near.stream.set_nonblocking(false).expect("a socket");
        (&near.stream).write_all(b"RCTL\x01\x00\x00\x00\x10\x00\x00\x00").expect("there is room");
        let begin = Instant::now();
        assert!(matches!(far.receive(Limits::CLIENT, limit), Err(ReceiveError::TimedOut)));
        assert!((WHOLE..2 * WHOLE).contains(&begin.elapsed()));
        drop(near);
    }
}
