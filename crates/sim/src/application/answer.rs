//! Result of a mailbox message: a protocol server returns it, the mailbox sends it.

/// Result of a message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Answer {
    /// Answers of the same protocol, one message each.
    Payloads(Vec<Vec<u8>>),
    /// An error reply of the mailbox with this detail.
    Error(u16),
    /// No answer.
    Silence,
}

impl Answer {
    /// One answer of the same protocol.
    pub fn payload(bytes: Vec<u8>) -> Answer {
        Answer::Payloads(vec![bytes])
    }
}
