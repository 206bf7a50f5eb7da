//! Mail that came back when nobody waited for it any more (decision 0007).
//!
//! Reading a mailbox empties it, so that what a read brings back must not be thrown away: not when both copies passed
//! the SubDevice at the edge of a ring's repair and each read another mail, and not when the frame was given up before it
//! came back.

use alloc::collections::VecDeque;
use alloc::vec::Vec;

use ringcat_wire::address::{StationAddress, Wkc};
use ringcat_wire::datagram::HEADER_LEN;

use crate::ring::Sequence;

/// Stray mails that wait for their router; beyond, the oldest is dropped and counted.
const KEPT: usize = 64;
/// Reads that were given up and are remembered, in case that they come back.
const REMEMBERED: usize = 64;

/// A read of a mailbox in a frame that was given up.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Overdue {
    pub sequence: Sequence,
    pub header_at: usize,
    pub length: usize,
    pub station: StationAddress,
}

impl Overdue {
    /// Its data in a frame, where it was answered.
    pub(crate) fn mail(&self, bytes: &[u8]) -> Option<Vec<u8>> {
        let start = self.header_at + HEADER_LEN;
        let data = bytes.get(start..start + self.length)?;
        let wkc = bytes.get(start + self.length..)?.first_chunk()?;
        (Wkc(u16::from_le_bytes(*wkc)) != Wkc(0)).then(|| data.to_vec())
    }
}

/// Mail without a reader.
#[derive(Debug, Default)]
pub(crate) struct Strays {
    mails: VecDeque<(StationAddress, Vec<u8>)>,
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

    /// A frame came back late: keeps the mail that is in it.
    pub(crate) fn late(&mut self, sequence: Sequence, bytes: &[u8]) {
        for at in (0..self.overdue.len()).rev() {
            let read = self.overdue[at];
            if read.sequence == sequence
                && let Some(mail) = read.mail(bytes)
            {
                self.overdue.remove(at);
                self.keep(read.station, mail);
            }
        }
    }

    /// Keeps a mail for whoever reads that mailbox next.
    pub(crate) fn keep(&mut self, station: StationAddress, mail: Vec<u8>) {
        if self.mails.len() >= KEPT {
            self.mails.pop_front();
            self.dropped += 1;
        }
        self.mails.push_back((station, mail));
    }

    /// The oldest mail of a SubDevice.
    pub(crate) fn take(&mut self, station: StationAddress) -> Option<Vec<u8>> {
        let at = self.mails.iter().position(|(of, _)| *of == station)?;
        self.mails.remove(at).map(|(_, mail)| mail)
    }

    /// Mails that nobody fetched in time.
    pub(crate) fn dropped(&self) -> u64 {
        self.dropped
    }
}
