//! Since the last round of reads: whether another one is due.

use ringcat_wire::register::EcatEvent;

use super::posted::Words;
use crate::board::{RingWord, Supervision};

/// A supervision result with a number this much higher than that at the end of a round was certainly sent after the
/// round's reads.
const SURELY_LATER: u32 = 8;
/// Consecutive rounds because of an ECAT event request that stays set.
const MOST_MISSED: u8 = 3;

/// The words posted when the last round began.
#[derive(Debug, Default)]
pub struct SinceRound {
    result: Supervision,
    ring: RingWord,
    /// Number of the result at the end of the last round, and the number of rounds since then that were started only
    /// because of missed requests.
    checked: u32,
    missed: u8,
}

impl SinceRound {
    /// A word differs from its value at the start of the last round.
    pub fn has_changed(&self, words: &Words) -> bool {
        words.supervision.is_some_and(|(_, result)| result != self.result) || words.ring != self.ring
    }

    /// Ports have changed again directly after a round that cleared their ECAT event: the event is set again, as before
    /// the round. `None` if that is impossible.
    pub fn has_missed(&mut self, words: &Words) -> Option<bool> {
        let (number, result) = words.supervision?;
        if !EcatEvent::from_bits(result.irq).dl_status {
            self.missed = 0;
            return None;
        }
        // Events of SubDevices that are not read stay set for ever.
        if self.missed >= MOST_MISSED {
            return None;
        }
        let is_missed = number.wrapping_sub(self.checked) >= SURELY_LATER;
        self.missed += u8::from(is_missed);
        Some(is_missed)
    }

    /// A round begins.
    pub fn begin(&mut self, words: &Words) {
        self.result = words.supervision.map_or(self.result, |(_, result)| result);
        self.ring = words.ring;
    }

    /// A round has ended; `number` is the latest result's.
    pub fn end(&mut self, number: Option<u32>) {
        self.checked = number.unwrap_or(0);
    }
}
