//! A cycle of master frames on its way: which fragments have arrived, and what this MainDevice gives in it.

use alloc::boxed::Box;
use alloc::vec;

use ringcat_wire::master_frame::{Answer, Header, Lengths, Stage};

use super::content::Content;
use crate::layout::MOST_FRAGMENTS;
use crate::ring::Sequence;

/// Words of a bit per fragment.
const WORDS: usize = MOST_FRAGMENTS / 64;

/// A cycle.
#[derive(Debug)]
pub(super) struct Cycle {
    pub number: Option<u32>,
    /// Its header, and the sequence number of the frame with it.
    pub header: Option<(Header, Sequence)>,
    pub content: Content,
    /// Everything of it has arrived.
    pub is_done: bool,
    arrived: [u64; WORDS],
    count: u16,
    /// Process data for the ACTIVE, the same in both copies.
    snapshot: Box<[u8]>,
    is_taken: bool,
    /// The answer, the same in both copies, and whether it accepts the role.
    answer: Option<([u8; Answer::LEN], bool)>,
}

impl Cycle {
    pub fn new(lengths: &Lengths) -> Cycle {
        Cycle {
            number: None,
            header: None,
            content: Content::new(lengths),
            is_done: false,
            arrived: [0; WORDS],
            count: 0,
            snapshot: vec![0; lengths.to_active as usize].into_boxed_slice(),
            is_taken: false,
            answer: None,
        }
    }

    pub fn forget(&mut self) {
        (self.number, self.header) = (None, None);
    }

    /// Another cycle is here now.
    pub fn begin(&mut self, number: u32) {
        (self.number, self.header, self.is_done) = (Some(number), None, false);
        (self.arrived, self.count) = ([0; WORDS], 0);
        (self.is_taken, self.answer) = (false, None);
    }

    /// Notes a fragment; false if it arrived before.
    pub fn note(&mut self, number: u16) -> bool {
        let (word, bit) = (usize::from(number / 64), 1 << (number % 64));
        let Some(word) = self.arrived.get_mut(word).filter(|word| **word & bit == 0) else { return false };
        *word |= bit;
        self.count += 1;
        true
    }

    /// Whether the answer in this cycle has accepted the role.
    pub fn has_accepted(&self, number: u32) -> bool {
        self.number == Some(number) && self.answer.is_some_and(|(_, accepts)| accepts)
    }

    /// Whether all fragments have arrived.
    pub fn is_whole(&self, header: &Header) -> bool {
        self.count == header.fragments
    }

    /// Puts process data of this MainDevice into a fragment.
    pub fn give(&mut self, to_active: &[u8], offset: u32, place: &mut [u8]) -> bool {
        if !core::mem::replace(&mut self.is_taken, true) {
            self.snapshot.copy_from_slice(to_active);
        }
        let end = (offset as usize).checked_add(place.len());
        let part = end.and_then(|end| self.snapshot.get(offset as usize..end));
        part.is_some_and(|part| {
            place.copy_from_slice(part);
            true
        })
    }

    /// Puts the answer into a fragment.
    pub fn give_answer(&mut self, answer: &Answer, place: &mut [u8]) -> bool {
        let (bytes, _) = self.answer.get_or_insert_with(|| {
            let mut bytes = [0; Answer::LEN];
            answer.encode(&mut bytes);
            (bytes, answer.stage == Stage::Accepts)
        });
        // A later version may have room for more.
        let (filled, rest) = place.split_at_mut(bytes.len().min(place.len()));
        if filled.len() < bytes.len() {
            return false;
        }
        filled.copy_from_slice(bytes);
        rest.fill(0);
        true
    }
}
