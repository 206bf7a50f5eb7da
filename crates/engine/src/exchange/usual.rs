//! The usual result of a copy: the same as that of the previous copy on its link.
//!
//! Input: the places in a frame that show how SubDevices processed it, and a copy that was evaluated. Output: whether a
//! later copy shows exactly the same in all of them, so that its results are those of the copy before. Inputs are not
//! among these places; the presence datagram is compared by itself ([`super::presence`]).

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use ringcat_wire::datagram::{OVERHEAD, WKC_LEN};

use super::words::{HEADER_MASK, word_at};
use crate::layout::SUPERVISION_LEN;

/// Eight bytes of a frame, of which some count.
#[derive(Clone, Copy, Debug)]
struct Check {
    /// Offset. In this type its end cannot overflow, which is not checked then.
    at: u16,
    mask: u64,
    word: u64,
}

/// Bytes of the supervision datagram behind its header's first eight: events, AL status, working counter.
const SUPERVISION_TAIL: usize = OVERHEAD + SUPERVISION_LEN - HEADER_WORD;
/// Bytes of a header that [`HEADER_MASK`] covers.
const HEADER_WORD: usize = 8;

/// The places of one link's copies, with their content in the last evaluated copy.
#[derive(Debug, Default)]
pub(super) struct Usual {
    is_known: bool,
    checks: Box<[Check]>,
    /// Sum of the working counters of process data.
    pub wkc: u32,
    /// Result of the supervision datagram, packed ([`crate::board::Supervision`]).
    pub supervision: u64,
}

impl Usual {
    /// `length`: of the frame; `headers`: offsets of all datagrams; `wkcs`: of the working counters of process data;
    /// `supervision`: of the supervision datagram.
    pub fn new(
        length: usize,
        headers: &[usize],
        wkcs: impl Iterator<Item = usize>,
        supervision: Option<usize>,
    ) -> Usual {
        let mut bits = vec![0; length];
        let mut cover = |at: usize, mask: &[u8]| {
            bits.iter_mut().skip(at).zip(mask).for_each(|(bits, mask)| *bits |= mask);
        };
        headers.iter().for_each(|at| cover(*at, &HEADER_MASK.to_le_bytes()));
        wkcs.for_each(|at| cover(at, &[0xFF; WKC_LEN]));
        supervision.iter().for_each(|at| cover(at + HEADER_WORD, &[0xFF; SUPERVISION_TAIL]));
        Usual { is_known: false, checks: words(&bits), wkc: 0, supervision: 0 }
    }

    /// Whether a copy shows the same as the last noted copy.
    #[inline(always)]
    pub fn is_shown_by(&self, bytes: &[u8]) -> bool {
        self.is_known && self.checks.iter().all(|check| word_at(bytes, check.at.into()) & check.mask == check.word)
    }

    /// Notes the result of an evaluated copy.
    #[cold]
    pub fn note(&mut self, bytes: &[u8], wkc: u32, supervision: u64) {
        for check in &mut self.checks {
            check.word = word_at(bytes, check.at.into()) & check.mask;
        }
        (self.is_known, self.wkc, self.supervision) = (true, wkc, supervision);
    }

    /// The next copy is to be evaluated.
    pub fn forget(&mut self) {
        self.is_known = false;
    }
}

/// As few words as cover these bits of a frame.
fn words(bits: &[u8]) -> Box<[Check]> {
    let mut checks = Vec::new();
    let mut next = 0;
    while let Some(found) = bits.iter().skip(next).position(|bits| *bits != 0) {
        let start = next + found;
        // The last word of a frame begins earlier; its first bytes are those of the word before.
        let at = start.min(bits.len().saturating_sub(size_of::<u64>()));
        let skipped = 8 * (start - at);
        checks.push(Check { at: at as u16, mask: word_at(bits, at) >> skipped << skipped, word: 0 });
        next = at + size_of::<u64>();
    }
    checks.into_boxed_slice()
}

#[cfg(test)]
mod tests {
    use ringcat_wire::datagram::HEADER_LEN;

    use super::*;

    /// Header at 0 with 4 bytes of data behind it, supervision behind that.
    fn usual() -> (Usual, Vec<u8>) {
        let supervision = OVERHEAD + 4;
        let bytes = vec![0x5A; supervision + OVERHEAD + SUPERVISION_LEN];
        let wkcs = [HEADER_LEN + 4].into_iter();
        let mut usual = Usual::new(bytes.len(), &[0, supervision], wkcs, Some(supervision));
        assert_eq!(usual.checks.len(), 3, "the first header; WKC and the next header's first bytes; the rest");
        assert!(!usual.is_shown_by(&bytes), "nothing was noted");
        usual.note(&bytes, 3, 7);
        (usual, bytes)
    }

    // covers: freshness
    #[test]
    fn every_bit_but_inputs_addresses_and_events_of_process_data_counts() {
        let (usual, bytes) = usual();
        assert!(usual.is_shown_by(&bytes));
        let supervision = OVERHEAD + 4;
        // Address and C bit in a header, events of the first datagram, inputs.
        let free = |at: usize, bit: u8| {
            let in_header = |start: usize| (start + 2..start + 6).contains(&at) || (at == start + 7 && bit == 0x40);
            in_header(0) || in_header(supervision) || (8..HEADER_LEN + 4).contains(&at)
        };
        for at in 0..bytes.len() {
            for bit in (0..8).map(|bit| 1 << bit) {
                let mut changed = bytes.clone();
                changed[at] ^= bit;
                assert_eq!(usual.is_shown_by(&changed), free(at, bit), "byte {at}, bit {bit:#x}");
            }
        }
    }

    #[test]
    fn what_was_forgotten_or_is_too_short_is_not_the_same() {
        let (mut usual, bytes) = usual();
        assert!(!usual.is_shown_by(&bytes[..bytes.len() - 1]));
        usual.forget();
        assert!(!usual.is_shown_by(&bytes));
    }
}
