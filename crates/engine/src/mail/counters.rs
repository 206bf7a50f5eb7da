//! Counters of a mailbox.

/// Counters of one mailbox since the beginning.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct MailCounters {
    /// Mails that the SubDevice accepted.
    pub written: u64,
    /// Writes that were repeated, with the same counter, because their frame was lost.
    pub rewritten: u64,
    /// Mails that were read.
    pub read: u64,
    /// Repeat requests after lost reads.
    pub repeats: u64,
    /// Reads of an empty mailbox.
    pub empty_reads: u64,
    /// Polls of the status of the send mailbox.
    pub polls: u64,
    /// Duplicate mails that were dropped.
    pub duplicates: u64,
    /// Mails received only with the second copy of a read, or after their read was given up.
    pub strays: u64,
    /// Mails without a readable header.
    pub malformed: u64,
    /// Mails without a waiting request: late answers, or answers to no request.
    pub unclaimed: u64,
    /// Messages that were not queued because their lane was full.
    pub refused: u64,
}
