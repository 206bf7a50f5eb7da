//! Mail that came back after its read was given up (decision 0007).
//!
//! A read empties the mailbox, so its result must not be dropped. A mail arrives without a waiting reader in two cases:
//! the ring closed while a frame was on the wire, so that both copies passed the SubDevice and each read a mail; or the
//! frame came back after it was given up.

use alloc::collections::VecDeque;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::{StationAddress, Wkc};
use ringcat_wire::datagram::HEADER_LEN;

use crate::ring::Sequence;
use crate::time::Instant;

/// Stray mails that wait for their router; beyond this, the oldest is dropped and counted.
const KEPT: usize = 64;
/// Given-up reads that are remembered in case their frames come back.
const REMEMBERED: usize = 64;

/// A frame that comes back later than this counts as lost.
const LATEST: Duration = Duration::from_millis(100);

/// A read of a mailbox in a frame that was given up.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Overdue {
    pub sequence: Sequence,
    pub header_at: usize,
    pub length: usize,
    pub station: StationAddress,
    pub sent_at: Instant,
}

/// A mail without a waiting reader.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stray {
    /// The content of the mailbox.
    pub mail: Vec<u8>,
    /// When its read was sent.
    pub sent_at: Instant,
}

impl Overdue {
    /// The mail in a frame, if the SubDevice answered the read.
    pub(crate) fn mail(&self, bytes: &[u8]) -> Option<Vec<u8>> {
        let start = self.header_at + HEADER_LEN;
        let data = bytes.get(start..start + self.length)?;
        let wkc = bytes.get(start + self.length..)?.first_chunk()?;
        (Wkc(u16::from_le_bytes(*wkc)) != Wkc(0)).then(|| data.to_vec())
    }
}

/// Mails without a waiting reader, and given-up reads.
#[derive(Debug, Default)]
pub(crate) struct Strays {
    mails: VecDeque<(StationAddress, Stray)>,
    overdue: VecDeque<Overdue>,
    dropped: u64,
}

impl Strays {
    /// A read was given up.
    pub(crate) fn remember(&mut self, read: Overdue) {
        if self.overdue.len() >= REMEMBERED {
            self.overdue.pop_front();
        }
        self.overdue.push_back(read);
    }

    /// Keeps the mail of a frame that came back late.
    pub(crate) fn late(&mut self, sequence: Sequence, bytes: &[u8], now: Instant) {
        for at in (0..self.overdue.len()).rev() {
            let read = self.overdue[at];
            if read.sequence == sequence
                && now.since(read.sent_at) <= LATEST
                && let Some(mail) = read.mail(bytes)
            {
                self.overdue.remove(at);
                self.keep(read.station, Stray { mail, sent_at: read.sent_at });
            }
        }
    }

    /// Keeps a mail for the next reader of that mailbox.
    pub(crate) fn keep(&mut self, station: StationAddress, stray: Stray) {
        if self.mails.len() >= KEPT {
            self.mails.pop_front();
            self.dropped += 1;
        }
        self.mails.push_back((station, stray));
    }

    /// The oldest mail of a SubDevice.
    pub(crate) fn take(&mut self, station: StationAddress) -> Option<Stray> {
        let at = self.mails.iter().position(|(of, _)| *of == station)?;
        self.mails.remove(at).map(|(_, stray)| stray)
    }

    /// Whether there is a mail of a SubDevice.
    pub(crate) fn has(&self, station: StationAddress) -> bool {
        self.mails.iter().any(|(of, _)| *of == station)
    }

    /// Whether there is any mail.
    pub(crate) fn has_any(&self) -> bool {
        !self.mails.is_empty()
    }

    /// Number of mails that were not fetched in time.
    pub(crate) fn dropped(&self) -> u64 {
        self.dropped
    }
}
