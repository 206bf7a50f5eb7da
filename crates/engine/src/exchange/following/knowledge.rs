//! Knowledge of the segment that arrives in pieces, another one in each cycle.

use alloc::boxed::Box;
use alloc::vec;

use ringcat_wire::master_frame::Header;

use crate::board::sheet::Sheet;
use crate::board::standby::KNOWLEDGE_ROOM;
use crate::layout::KNOWLEDGE_GRAIN;

/// Words of a bit per grain.
const WORDS: usize = KNOWLEDGE_ROOM / KNOWLEDGE_GRAIN / 64;

/// The knowledge on its way.
#[derive(Debug)]
pub(super) struct ReceivedKnowledge {
    /// Version and length of what is on its way, or has arrived.
    version: Option<(u16, usize)>,
    /// One bit per grain that has arrived.
    arrived: Box<[u64]>,
    left: usize,
}

impl Default for ReceivedKnowledge {
    fn default() -> ReceivedKnowledge {
        ReceivedKnowledge { version: None, arrived: vec![0; WORDS].into_boxed_slice(), left: 0 }
    }
}

impl ReceivedKnowledge {
    /// Nothing is on its way. In the cyclic path: the room stays.
    pub fn forget(&mut self) {
        (self.version, self.left) = (None, 0);
        self.arrived.fill(0);
    }

    /// The pieces of this cycle are of the knowledge that its header names.
    pub fn expect(&mut self, header: &Header) {
        let length = header.knowledge_len as usize;
        let version = (header.knowledge, length);
        if length == 0 || length > KNOWLEDGE_ROOM || self.version == Some(version) {
            return;
        }
        self.version = Some(version);
        self.arrived.fill(0);
        self.left = length.div_ceil(KNOWLEDGE_GRAIN);
    }

    /// Takes a piece.
    pub fn take(&mut self, sheet: &Sheet, offset: usize, bytes: &[u8]) {
        let Some((_, length)) = self.version else { return };
        if self.left == 0 || offset >= length || !offset.is_multiple_of(KNOWLEDGE_GRAIN) {
            return;
        }
        if sheet.version().is_some() {
            sheet.begin();
        }
        let bytes = &bytes[..bytes.len().min(length - offset)];
        sheet.put(offset, bytes);
        for grain in offset / KNOWLEDGE_GRAIN..(offset + bytes.len()).div_ceil(KNOWLEDGE_GRAIN) {
            let Some(word) = self.arrived.get_mut(grain / 64) else { return };
            let bit = 1 << (grain % 64);
            self.left -= usize::from(*word & bit == 0);
            *word |= bit;
        }
        if self.left == 0 {
            sheet.end(length);
        }
    }
}
