//! The diagnosis that the INACTIVE shows instead of its own (protocol MR-14, MR-19).

use super::MasterFrameError;
use super::cursor::{Reader, Writer};

/// State of the segment, from the ACTIVE: a fixed part, then one [`DomainRecord`] per domain.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Diagnosis {
    /// State of the ring: 0 unknown, 1 closed, 2 open.
    pub ring: u8,
    /// Carriers, two bits per link from the main one on: 0 unknown, 1 none, 2 carrier.
    pub carriers: u8,
    /// OR of the AL states of the SubDevices that answer, by link.
    pub al_states: [u8; 2],
    /// SubDevices that answer, by link.
    pub answering: [u16; 2],
    /// Frames with process data that were sent.
    pub sent: u64,
    /// Frames of which no copy came back in time.
    pub lost: u64,
    /// Cycles of a domain that were not complete.
    pub incomplete: u64,
    /// Cycles of a domain that were skipped.
    pub skipped: u64,
    /// Frames of other MainDevices.
    pub foreign: u64,
}

impl Diagnosis {
    /// Bytes of the fixed part.
    pub const LEN: usize = 2 + 2 + 2 * 2 + 5 * 8;

    /// Decodes the fixed part.
    ///
    /// # Errors
    /// It is too short.
    pub fn decode(bytes: &[u8]) -> Result<Diagnosis, MasterFrameError> {
        let mut from = Reader::new(bytes, "diagnosis in a master frame", Self::LEN)?;
        Ok(Diagnosis {
            ring: from.u8(),
            carriers: from.u8(),
            al_states: from.take(),
            answering: [from.u16(), from.u16()],
            sent: from.u64(),
            lost: from.u64(),
            incomplete: from.u64(),
            skipped: from.u64(),
            foreign: from.u64(),
        })
    }

    /// Encodes the fixed part and returns its length; `None` if it does not fit `out`.
    pub fn encode(&self, out: &mut [u8]) -> Option<usize> {
        let mut out = Writer::new(out, Self::LEN)?;
        out.u8(self.ring);
        out.u8(self.carriers);
        out.put(&self.al_states);
        self.answering.into_iter().for_each(|count| out.u16(count));
        let counters = [self.sent, self.lost, self.incomplete, self.skipped, self.foreign];
        counters.into_iter().for_each(|counter| out.u64(counter));
        Some(out.length())
    }
}

/// State of a domain.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DomainRecord {
    /// 0 no SubDevice answers, 1 some do, 2 all do.
    pub state: u8,
    /// Sum of its working counters.
    pub wkc: u32,
    /// The sum if all SubDevices answer.
    pub expected: u32,
}

impl DomainRecord {
    /// Bytes.
    pub const LEN: usize = 1 + 4 + 4;

    /// Decodes a record.
    ///
    /// # Errors
    /// It is too short.
    pub fn decode(bytes: &[u8]) -> Result<DomainRecord, MasterFrameError> {
        let mut from = Reader::new(bytes, "state of a domain", Self::LEN)?;
        Ok(DomainRecord { state: from.u8(), wkc: from.u32(), expected: from.u32() })
    }

    /// Encodes it and returns its length; `None` if it does not fit `out`.
    pub fn encode(&self, out: &mut [u8]) -> Option<usize> {
        let mut out = Writer::new(out, Self::LEN)?;
        out.u8(self.state);
        out.u32(self.wkc);
        out.u32(self.expected);
        Some(out.length())
    }
}
