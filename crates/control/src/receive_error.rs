//! Why no message was received.

use std::fmt;
use std::io;

use crate::wire::WireError;

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
            io::ErrorKind::UnexpectedEof | io::ErrorKind::ConnectionReset | io::ErrorKind::BrokenPipe => {
                ReceiveError::Ended
            }
            _ => ReceiveError::Io(error),
        }
    }
}

impl From<WireError> for ReceiveError {
    fn from(error: WireError) -> ReceiveError {
        ReceiveError::Wire(error)
    }
}
