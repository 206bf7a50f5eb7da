//! Errors of mailbox payloads, and a writer of fields into a buffer of the caller.

use core::fmt;

use super::coe::CoeService;

/// The reason for which bytes are not the expected message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PayloadError {
    /// Too short.
    Short {
        /// The expected part.
        what: &'static str,
        /// Minimum number of bytes.
        expected: usize,
        /// Bytes available.
        got: usize,
    },
    /// The CoE service differs.
    Service {
        /// The service expected.
        expected: CoeService,
        /// The service found.
        got: CoeService,
    },
    /// An unknown code, which determines the remaining layout.
    Code {
        /// The kind of code.
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

/// The first `N` bytes and the bytes after them.
pub(super) fn split<'a, const N: usize>(
    bytes: &'a [u8],
    what: &'static str,
) -> Result<(&'a [u8; N], &'a [u8]), PayloadError> {
    bytes.split_first_chunk().ok_or(PayloadError::Short { what, expected: N, got: bytes.len() })
}

/// Writes fields one after the other; `None` if the buffer is full.
pub(super) struct FieldWriter<'b> {
    out: &'b mut [u8],
    at: usize,
}

impl<'b> FieldWriter<'b> {
    pub const fn new(out: &'b mut [u8]) -> FieldWriter<'b> {
        FieldWriter { out, at: 0 }
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
