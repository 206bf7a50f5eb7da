//! While the ring does not change: how many SubDevices answer. After a change: on which link, once that is certain.

use super::posted::{Words, counts_of};
use crate::link::Link;
use crate::ring::RingState;
use crate::ring_status::LinkCounts;

/// If the counts before the change are not known: supervision results after which two equal counts in a row are
/// required. At the moment of a cut one copy may be processed by fewer SubDevices than are connected to its side.
const SETTLING_RESULTS: u32 = 20;

/// The counts of the results before.
#[derive(Debug, Default)]
pub struct SteadyCounts {
    /// Number and counts of the last supervision result that was evaluated.
    last: Option<(u32, LinkCounts)>,
    /// Results since the ring changed.
    settling: u32,
    /// SubDevices that answered twice in a row while the ring did not change.
    steady: u16,
}

impl SteadyCounts {
    /// SubDevices that answered twice in a row while the ring did not change.
    pub fn steady(&self) -> u16 {
        self.steady
    }

    /// The ring is as reported. Whether the latest result counts as many SubDevices as the steady count; true without
    /// a result.
    pub fn observe(&mut self, words: &Words) -> bool {
        let Some((number, result)) = words.supervision else { return true };
        let counts = counts_of(&result);
        if self.last.is_some_and(|(before, same)| before != number && same == counts) {
            self.steady = result.total().0;
        }
        self.last = Some((number, counts));
        self.settling = 0;
        self.steady == result.total().0
    }

    /// SubDevices on each link after a change of the ring, as soon as the counts are certain.
    pub fn after_change(&mut self, words: &Words) -> Option<LinkCounts> {
        let (number, result) = words.supervision?;
        let counts = counts_of(&result);
        match (words.ring.state, words.ring.returned) {
            // A copy that returned on its own link was processed by all SubDevices on its side. All others are on the
            // other side, also if the other copy is late or lost.
            (RingState::Open, Some((link, count))) if self.steady > 0 => {
                let other = self.steady.saturating_sub(count);
                let (seen, derived) = match link {
                    Link::Main => (counts.main, LinkCounts { main: count, redundant: other }),
                    Link::Redundant => (counts.redundant, LinkCounts { main: other, redundant: count }),
                };
                let is_of_both = seen == count && counts.main > 0 && counts.redundant > 0;
                Some(if is_of_both { counts } else { derived })
            }
            // Another frame may have shown the change; these are then counts from before it.
            (RingState::Open, _) if !result.returned => None,
            (RingState::Closed, _) if result.returned => None,
            (RingState::Closed, _) if result.total().0 == self.steady => Some(counts),
            _ => self.settled(number, counts),
        }
    }

    fn settled(&mut self, number: u32, counts: LinkCounts) -> Option<LinkCounts> {
        match self.last {
            Some((before, _)) if before == number => return None,
            Some((_, before)) if self.settling > 0 && (before == counts || self.settling >= SETTLING_RESULTS) => {
                return Some(counts);
            }
            _ => {}
        }
        self.settling += 1;
        self.last = Some((number, counts));
        None
    }
}
