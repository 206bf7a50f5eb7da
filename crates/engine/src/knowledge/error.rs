//! Why bytes are no knowledge.

use core::fmt;

/// Why bytes are no [`Knowledge`](super::Knowledge).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct KnowledgeError {
    /// Byte at which the fault begins, from the first byte of the header on.
    pub offset: usize,
    /// What was expected there.
    pub expected: &'static str,
}

impl fmt::Display for KnowledgeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "knowledge of a segment, byte {}: expected {}", self.offset, self.expected)
    }
}

impl core::error::Error for KnowledgeError {}
