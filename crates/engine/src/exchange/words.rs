//! Words in the bytes of a received copy: headers, working counters, the supervision datagram.
//!
//! Input: the bytes of a copy and an offset, both unchecked. Output: a number; bytes beyond the end are zero.

use ringcat_wire::address::Wkc;
use ringcat_wire::datagram::{CIRCULATING, OVERHEAD};

use crate::board::Supervision;
use crate::layout::SUPERVISION_LEN;
use crate::link::Link;

/// The parts of a datagram's first eight bytes that no controller changes (protocol 1.5): command, Idx, length, M bit.
#[derive(Debug)]
pub(super) struct Header {
    /// Offset in the frame.
    pub at: usize,
    /// As sent.
    pub sent: u64,
}

/// Bits of a datagram's first eight bytes that no controller changes (protocol 1.5): command, Idx, length, M bit.
/// Address and C bit are not among them.
pub(super) const HEADER_MASK: u64 = 0x0000_0000_0000_FFFF | !(CIRCULATING as u64) << 48;

/// The parts of a datagram's first eight bytes that no controller changes; zero for bytes beyond the end.
#[inline]
pub(super) fn header_at(bytes: &[u8], at: usize) -> u64 {
    word_at(bytes, at) & HEADER_MASK
}

/// Eight bytes; beyond the end, zero.
#[inline(always)]
pub(super) fn word_at(bytes: &[u8], at: usize) -> u64 {
    let word = bytes.get(at..at + size_of::<u64>()).and_then(<[u8]>::first_chunk);
    word.map_or(0, |word| u64::from_le_bytes(*word))
}

/// Result of the supervision datagram of a copy, packed.
pub(super) fn supervision_at(bytes: &[u8], at: usize, sent_on: Link) -> u64 {
    let datagram = bytes.get(at..).and_then(<[u8]>::first_chunk::<{ OVERHEAD + SUPERVISION_LEN }>);
    let Some(&[.., irq_low, irq_high, al_low, _, wkc_low, wkc_high]) = datagram else { return 0 };
    let mut seen = Supervision { irq: u16::from_le_bytes([irq_low, irq_high]), ..Supervision::default() };
    seen.al_status[sent_on.index()] = al_low;
    let wkc = Wkc(u16::from_le_bytes([wkc_low, wkc_high]));
    match sent_on {
        Link::Main => seen.main = wkc,
        Link::Redundant => seen.redundant = wkc,
    }
    seen.pack()
}

/// Two bytes; beyond the end, zero.
#[inline]
pub(super) fn u16_at(bytes: &[u8], at: usize) -> u16 {
    bytes.get(at..).and_then(<[u8]>::first_chunk).map_or(0, |bytes| u16::from_le_bytes(*bytes))
}
