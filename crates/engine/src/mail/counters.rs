//! What passed through a mailbox.

/// Counters of one mailbox since the beginning.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct MailCounters {
    /// Mails that the SubDevice took.
    pub written: u64,
    /// Writes that were sent again, with the same counter, because their frame was lost.
    pub rewritten: u64,
    /// Mails that were read.
    pub read: u64,
    /// Repeat requests after lost reads.
    pub repeats: u64,
    /// Reads that found nothing.
    pub empty_reads: u64,
    /// Looks at the status of the send mailbox.
    pub looks: u64,
    /// Mails that came twice and were dropped.
    pub duplicates: u64,
    /// Mails that only the second copy of a read brought, or that came when their read had been given up.
    pub strays: u64,
    /// Mails without a readable header.
    pub malformed: u64,
    /// Answers for which nobody waited: too late, or to nothing.
    pub unclaimed: u64,
    /// Messages that could not be queued because their lane was full.
    pub refused: u64,
}
