//! Since the ring was processed last: whether it has changed, and the direction in which frames are lost.

use super::posted::Words;
use crate::link::Link;

/// The ring as it was processed last.
#[derive(Debug, Default)]
pub struct SinceReport {
    /// [`crate::board::RingWord::changes`].
    changes: u32,
    /// The direction in which frames were lost.
    dead_way: Option<Link>,
}

/// What has changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RingChange {
    /// The ring.
    pub ring: bool,
    /// The direction in which frames are lost.
    pub way: bool,
}

impl SinceReport {
    /// Compares posted words with the last ones.
    pub fn observe(&mut self, words: &Words) -> RingChange {
        let change = RingChange { ring: words.ring.changes != self.changes, way: words.ring.dead_way != self.dead_way };
        self.skip(words);
        change
    }

    /// What the words show is no change: the redundant link is down on purpose.
    pub fn skip(&mut self, words: &Words) {
        (self.changes, self.dead_way) = (words.ring.changes, words.ring.dead_way);
    }

    /// The ring that the words show is no change: it is open on purpose at a port.
    pub fn skip_ring(&mut self, words: &Words) {
        self.changes = words.ring.changes;
    }
}
