//! Why the payload of a mailbox message says nothing, and a pen that writes one into a buffer of the caller.

use core::fmt;

use super::coe::CoeService;

/// Why bytes are not the message that was expected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PayloadError {
    /// Too short.
    Short {
        /// What was to be read.
        what: &'static str,
        /// Bytes that it has at least.
        expected: usize,
        /// Bytes there.
        got: usize,
    },
    /// The CoE service is another one.
    Service {
        /// The service expected.
        expected: CoeService,
        /// The service found.
        got: CoeService,
    },
    /// A code that decides about the rest means nothing.
    Code {
        /// What the code stands for.
        what: &'static str,
        /// The code.
        got: u16,
    },
}

impl fmt::Display for PayloadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            PayloadError::Short { what, expected, got } => {
                write!(f, "{what} too short: expected at least {expected} bytes, got {got}")
            }
            PayloadError::Service { expected, got } => write!(f, "expected {expected}, got {got}"),
            PayloadError::Code { what, got } => write!(f, "unknown {what} {got:#x}"),
        }
    }
}

impl core::error::Error for PayloadError {}

/// The first `N` bytes and what is behind them.
pub(super) fn split<'a, const N: usize>(
    bytes: &'a [u8],
    what: &'static str,
) -> Result<(&'a [u8; N], &'a [u8]), PayloadError> {
    bytes.split_first_chunk().ok_or(PayloadError::Short { what, expected: N, got: bytes.len() })
}

/// Writes one field behind the other; `None` where there is no room.
pub(super) struct Pen<'b> {
    out: &'b mut [u8],
    at: usize,
}

impl<'b> Pen<'b> {
    pub const fn new(out: &'b mut [u8]) -> Pen<'b> {
        Pen { out, at: 0 }
    }

    pub fn put(&mut self, bytes: &[u8]) -> Option<()> {
        let end = self.at.checked_add(bytes.len())?;
        self.out.get_mut(self.at..end)?.copy_from_slice(bytes);
        self.at = end;
        Some(())
    }

    pub fn put_u16(&mut self, value: u16) -> Option<()> {
        self.put(&value.to_le_bytes())
    }

    pub fn put_u32(&mut self, value: u32) -> Option<()> {
        self.put(&value.to_le_bytes())
    }

    /// Bytes written so far.
    pub const fn length(&self) -> usize {
        self.at
    }
}
