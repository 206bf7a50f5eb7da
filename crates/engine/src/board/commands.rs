//! Wrong working counters of process data datagrams, which the exchange posts and the acyclic half reports.
//!
//! One word per datagram: a count of cycles, and the working counters of the last of them. Single writer: the exchange,
//! only in cycles that are incomplete.

use alloc::vec::Vec;
use core::sync::atomic::{AtomicU64, Ordering};

use ringcat_wire::address::Wkc;

/// Words by domain and by datagram in the domain.
#[derive(Debug, Default)]
pub struct CommandWords(Vec<Vec<AtomicU64>>);

/// Wrong working counters of a datagram since activation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CommandErrors {
    /// Number of cycles; wraps to 0.
    pub cycles: u32,
    /// Expected in the last of them.
    pub expected: Wkc,
    /// Received then; 0 if no copy came back.
    pub got: Wkc,
}

impl CommandWords {
    /// Words for these numbers of datagrams, by domain.
    pub(super) fn new(datagrams: impl Iterator<Item = usize>) -> CommandWords {
        CommandWords(datagrams.map(|count| (0..count).map(|_| AtomicU64::new(0)).collect()).collect())
    }

    /// Counts a cycle. Unknown datagrams are ignored.
    pub(crate) fn post(&self, domain: usize, datagram: usize, expected: Wkc, got: Wkc) {
        let Some(word) = self.0.get(domain).and_then(|words| words.get(datagram)) else { return };
        let cycles = (word.load(Ordering::Relaxed) as u32).wrapping_add(1);
        word.store(u64::from(cycles) | u64::from(expected.0) << 32 | u64::from(got.0) << 48, Ordering::Relaxed);
    }

    /// The errors of a datagram.
    pub(crate) fn read(&self, domain: usize, datagram: usize) -> CommandErrors {
        let word = self.0.get(domain).and_then(|words| words.get(datagram));
        let word = word.map_or(0, |word| word.load(Ordering::Relaxed));
        CommandErrors { cycles: word as u32, expected: Wkc((word >> 32) as u16), got: Wkc((word >> 48) as u16) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: jobs
    #[test]
    fn each_datagram_has_a_count_and_its_last_working_counters() {
        let words = CommandWords::new([2, 0, 1].into_iter());
        words.post(0, 1, Wkc(3), Wkc(2));
        words.post(0, 1, Wkc(u16::MAX), Wkc(u16::MAX - 1));
        words.post(2, 0, Wkc(1), Wkc(0));
        words.post(1, 0, Wkc(1), Wkc(0));
        words.post(7, 7, Wkc(1), Wkc(0));
        let of = |cycles, expected, got| CommandErrors { cycles, expected: Wkc(expected), got: Wkc(got) };
        assert_eq!(words.read(0, 0), of(0, 0, 0));
        assert_eq!(words.read(0, 1), of(2, u16::MAX, u16::MAX - 1));
        assert_eq!(words.read(2, 0), of(1, 1, 0));
        assert_eq!(words.read(1, 0), of(0, 0, 0));
    }
}
