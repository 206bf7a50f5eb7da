//! The header of a cycle: what the ACTIVE sends, how the INACTIVE reads it, and whether it is to take over.

use super::cursor::{Reader, Writer};
use super::item::Item;
use super::{LEAST_READER, MAGIC, MasterFrameError, VERSION};
use crate::memory_write::MemoryWrite;

/// What follows this cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Phase {
    /// The next cycle of this ACTIVE.
    #[default]
    Goes,
    /// The same; the ACTIVE offers its role, and waits for the INACTIVE to accept.
    Offers,
    /// Nothing: this is the last cycle of this ACTIVE, and the INACTIVE that has accepted sends the next one.
    Ends,
    /// A phase of a later version.
    Other(u8),
}

impl Phase {
    /// From its code.
    pub const fn from_code(code: u8) -> Phase {
        match code {
            0 => Phase::Goes,
            1 => Phase::Offers,
            2 => Phase::Ends,
            other => Phase::Other(other),
        }
    }

    /// Its code.
    pub const fn code(self) -> u8 {
        match self {
            Phase::Goes => 0,
            Phase::Offers => 1,
            Phase::Ends => 2,
            Phase::Other(code) => code,
        }
    }
}

/// Bytes of the areas; 0 for one that is absent (protocol FR-12, FR-13).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Lengths {
    /// States of SubDevices.
    pub subdevices: u32,
    /// Inputs.
    pub inputs: u32,
    /// Diagnosis.
    pub diagnosis: u32,
    /// Process data of the ACTIVE for the INACTIVE.
    pub to_inactive: u32,
    /// Process data of the INACTIVE for the ACTIVE.
    pub to_active: u32,
}

/// The header of a cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Header {
    /// Version of the sender.
    pub version: u8,
    /// Oldest version whose readers understand it.
    pub least: u8,
    /// What follows this cycle.
    pub phase: Phase,
    /// State of the MainDevice: the lowest AL state of its SubDevices, as in AL status; 0 without an application.
    pub state: u8,
    /// Number of fragments in this cycle.
    pub fragments: u16,
    /// Sequence number of the first frame of this cycle, 15 bits.
    pub first: u16,
    /// Number of frames of this cycle before the first master frame.
    pub frames: u16,
    /// Number of the session: it decides about logical addresses.
    pub session: u16,
    /// Version of the knowledge that is sent piece by piece; another one with each change.
    pub knowledge: u16,
    /// A write into the memory of a SubDevice that is under way.
    pub write: Option<MemoryWrite>,
    /// Bytes of that knowledge; 0 if none is sent.
    pub knowledge_len: u32,
    /// Period of the cycles in nanoseconds.
    pub period_ns: u32,
    /// Digest of the configuration.
    pub identity: u64,
    /// One item of it.
    pub item: Item,
    /// Bytes of the areas.
    pub lengths: Lengths,
}

impl Header {
    /// Bytes of this version.
    pub const LEN: usize = 4 + 4 + 6 * 2 + 2 * 4 + 8 + Item::LEN + 5 * 4;

    /// A header of this version with nothing in it.
    pub fn new() -> Header {
        Header { version: VERSION, least: LEAST_READER, ..Header::default() }
    }

    /// Decodes a header of this or a later version.
    ///
    /// # Errors
    /// It is too short, of another stack, or of a version that this one does not understand.
    pub fn decode(bytes: &[u8]) -> Result<Header, MasterFrameError> {
        let mut from = Reader::new(bytes, "header of a master frame", Self::LEN)?;
        let magic = from.take();
        if magic != MAGIC {
            return Err(MasterFrameError::Magic(magic));
        }
        let (version, least) = (from.u8(), from.u8());
        if least > VERSION {
            return Err(MasterFrameError::Version { least, got: version });
        }
        let (phase, state) = (Phase::from_code(from.u8()), from.u8());
        let (fragments, first, frames) = (from.u16(), from.u16(), from.u16());
        let (session, knowledge) = (from.u16(), from.u16());
        let write = MemoryWrite::from_code(from.u16());
        let (knowledge_len, period_ns, identity) = (from.u32(), from.u32(), from.u64());
        let item = Item::take(&mut from);
        let lengths = Lengths {
            subdevices: from.u32(),
            inputs: from.u32(),
            diagnosis: from.u32(),
            to_inactive: from.u32(),
            to_active: from.u32(),
        };
        Ok(Header {
            version,
            least,
            phase,
            state,
            fragments,
            first,
            frames,
            session,
            knowledge,
            write,
            knowledge_len,
            period_ns,
            identity,
            item,
            lengths,
        })
    }

    /// Encodes it and returns its length; `None` if it does not fit `out`.
    pub fn encode(&self, out: &mut [u8]) -> Option<usize> {
        let mut out = Writer::new(out, Self::LEN)?;
        out.put(&MAGIC);
        [self.version, self.least, self.phase.code(), self.state].into_iter().for_each(|byte| out.u8(byte));
        let write = self.write.map_or(0, MemoryWrite::code);
        let words = [self.fragments, self.first, self.frames, self.session, self.knowledge, write];
        words.into_iter().for_each(|word| out.u16(word));
        out.u32(self.knowledge_len);
        out.u32(self.period_ns);
        out.u64(self.identity);
        self.item.put(&mut out);
        let Lengths { subdevices, inputs, diagnosis, to_inactive, to_active } = self.lengths;
        [subdevices, inputs, diagnosis, to_inactive, to_active].into_iter().for_each(|length| out.u32(length));
        Some(out.length())
    }
}
