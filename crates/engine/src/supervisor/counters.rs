//! Counters of the acyclic half.

/// Counters of the acyclic half.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct AcyclicCounters {
    /// Frames sent.
    pub sent: u64,
    /// Bytes sent, one copy of each frame, without FCS.
    pub bytes: u64,
    /// Frames answered.
    pub received: u64,
    /// Frames of which no copy came back in time.
    pub lost: u64,
    /// Frames of which one copy of two came back in time.
    pub half: u64,
    /// Copies that did not come back in time, by the link on which they were sent ([`crate::link::Link::index`]).
    pub copies_lost: [u64; 2],
    /// Their bytes, without FCS.
    pub bytes_lost: [u64; 2],
    /// Copies that came too late or twice.
    pub late: u64,
    /// Frames of this MainDevice that came back with other datagrams than were sent.
    pub corrupt: u64,
    /// Frames of other MainDevices.
    pub foreign: u64,
    /// Datagrams sent.
    pub datagrams: u64,
    /// Datagrams that were repeated because their frame was lost.
    pub resent: u64,
    /// Datagrams that were given up because their frame was lost.
    pub timed_out: u64,
    /// Mailbox messages that arrived when no read waited for them, and were dropped because they were not fetched in
    /// time: lost answers.
    pub mails_dropped: u64,
}

impl AcyclicCounters {
    /// Sum of both.
    #[must_use]
    pub const fn plus(self, other: AcyclicCounters) -> AcyclicCounters {
        AcyclicCounters {
            sent: self.sent + other.sent,
            bytes: self.bytes + other.bytes,
            received: self.received + other.received,
            lost: self.lost + other.lost,
            half: self.half + other.half,
            copies_lost: both(self.copies_lost, other.copies_lost),
            bytes_lost: both(self.bytes_lost, other.bytes_lost),
            late: self.late + other.late,
            corrupt: self.corrupt + other.corrupt,
            foreign: self.foreign + other.foreign,
            datagrams: self.datagrams + other.datagrams,
            resent: self.resent + other.resent,
            timed_out: self.timed_out + other.timed_out,
            mails_dropped: self.mails_dropped + other.mails_dropped,
        }
    }
}

const fn both([a, b]: [u64; 2], [c, d]: [u64; 2]) -> [u64; 2] {
    [a + c, b + d]
}
