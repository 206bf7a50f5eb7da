//! Counters of a segment: frames on the MainDevice's links, and causes of lost frames.

use std::fmt;

use crate::cable::HostLink;

/// Cause of a lost frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LossCause {
    /// It was sent on an interface without carrier or without cable.
    NoCarrier,
    /// It was longer than the maximum of an interface.
    Oversized,
    /// It contained more datagrams than the segment accepts
    /// ([`NetworkOptions::max_datagrams`](super::NetworkOptions::max_datagrams)).
    TooManyDatagrams,
    /// The transmit queue of the interface was full.
    TransmitQueueFull,
    /// The cable was cut, or an end had no power, while the frame was on it.
    DeadCable,
    /// A device sent it out of a port that was forced open and has no cable.
    OpenPort,
    /// It reached a port or interface that had not detected the link yet.
    NoLink,
    /// A port on its path opened or closed while it passed (protocol 2.2: a running frame may be cut).
    LoopChanged,
    /// The direction was blocked by a fault.
    Blocked,
    /// It was dropped by a fault.
    Dropped,
    /// A controller destroyed it: closed port, circulating frame or forwarding rule (protocol 2.2, 2.4, 2.6).
    Destroyed,
    /// It returned with a wrong FCS.
    BadCheckSequence,
    /// The receive queue was full because frames were not fetched.
    ReceiveQueueFull,
}

impl fmt::Display for LossCause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            LossCause::NoCarrier => "interface without carrier",
            LossCause::Oversized => "longer than an interface sends",
            LossCause::TransmitQueueFull => "transmit queue of the interface full",
            LossCause::TooManyDatagrams => "more datagrams than the segment takes",
            LossCause::DeadCable => "on a cable that was cut or had no power",
            LossCause::OpenPort => "out of a port without cable",
            LossCause::NoLink => "link not detected yet",
            LossCause::LoopChanged => "a port opened or closed meanwhile",
            LossCause::Blocked => "direction blocked",
            LossCause::Dropped => "dropped by a fault",
            LossCause::Destroyed => "destroyed by a SubDevice",
            LossCause::BadCheckSequence => "wrong check sequence",
            LossCause::ReceiveQueueFull => "receive queue of the interface full",
        })
    }
}

impl LossCause {
    /// All causes.
    pub const ALL: [LossCause; 13] = [
        LossCause::NoCarrier,
        LossCause::Oversized,
        LossCause::TooManyDatagrams,
        LossCause::TransmitQueueFull,
        LossCause::DeadCable,
        LossCause::OpenPort,
        LossCause::NoLink,
        LossCause::LoopChanged,
        LossCause::Blocked,
        LossCause::Dropped,
        LossCause::Destroyed,
        LossCause::BadCheckSequence,
        LossCause::ReceiveQueueFull,
    ];
}

/// Traffic of one interface of the MainDevice. Bytes do not include the FCS.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LinkStatistics {
    /// Frames that went onto the wire.
    pub frames_sent: u64,
    /// Their bytes.
    pub bytes_sent: u64,
    /// Frames received completely.
    pub frames_received: u64,
    /// Their bytes.
    pub bytes_received: u64,
}

/// Counters of a whole segment since its creation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    pub(crate) links: [LinkStatistics; HostLink::COUNT],
    pub(crate) lost: [u64; LossCause::ALL.len()],
    pub(crate) hops: u64,
}

impl Statistics {
    /// Traffic of an interface of the MainDevice.
    pub fn link(&self, link: HostLink) -> LinkStatistics {
        self.links[link as usize]
    }

    /// Frames lost for one cause.
    pub fn lost(&self, cause: LossCause) -> u64 {
        self.lost[cause as usize]
    }

    /// Frames lost in total.
    pub fn lost_total(&self) -> u64 {
        self.lost.iter().sum()
    }

    /// Number of passes of frames through devices.
    pub fn hops(&self) -> u64 {
        self.hops
    }

    pub(crate) fn lose(&mut self, cause: LossCause) {
        self.lost[cause as usize] += 1;
    }
}
