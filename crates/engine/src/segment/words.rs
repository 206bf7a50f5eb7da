//! The words that the exchange posts: the only module that reads them, and compares them with earlier ones.
//!
//! The fields of [`Words`] are private, so a rule cannot compare them on its own. Several questions are asked of the
//! same words, and each has a reference of its own in the [`Reader`], because the model answers them at different
//! times: since the words before, since the last round of reads, since the ring was reported, since the last answer,
//! since the last scan. The supervisor also compares words, to wake the procedure that passes them on
//! (`supervisor/watching.rs`), and decides nothing.

mod answers;
mod broadcasts;
mod changes;
mod counts;
mod ring_changes;
mod round;

pub use broadcasts::Broadcast;
pub use changes::Changes;

use ringcat_wire::address::Wkc;

use self::answers::LastAnswer;
use self::broadcasts::SinceScan;
use self::changes::SinceBefore;
use self::counts::SteadyCounts;
use self::ring_changes::SinceReport;
use self::round::SinceRound;
use crate::board::{Board, RingWord, Supervision};
use crate::link::{Link, LinkSet};
use crate::ring::RingState;
use crate::ring_status::LinkCounts;

/// Words posted by the exchange, or without an application the answer to a broadcast, and the carriers of the links.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Words {
    /// The links in use.
    links: LinkSet,
    /// By [`Link::index`].
    carriers: [Option<bool>; 2],
    /// The state of the ring.
    ring: RingWord,
    /// The latest supervision result and its number; without an application a new one, or none.
    supervision: Option<(u32, Supervision)>,
    /// Cycles that the exchange has sent.
    cycles: u64,
}

/// The references with which words are compared, one for each question.
#[derive(Debug, Default)]
pub(super) struct Reader {
    /// The words before.
    pub before: SinceBefore,
    /// The words at the begin of the last round of reads.
    pub round: SinceRound,
    /// The ring as it was processed last.
    pub ring: SinceReport,
    /// SubDevices that answer while the ring does not change.
    pub counts: SteadyCounts,
    /// The last result with an answer.
    pub answer: LastAnswer,
    /// Without an application: the last scan.
    pub scan: SinceScan,
}

impl Reader {
    /// Broadcasts follow, without an application.
    pub fn begin_idle(&mut self) {
        self.ring = SinceReport::default();
        self.counts = SteadyCounts::default();
        self.scan = SinceScan::default();
    }
}

impl Words {
    /// Links and the ring, without a supervision result.
    pub fn new(links: LinkSet, carriers: [Option<bool>; 2], ring: RingWord) -> Words {
        Words { links, carriers, ring, supervision: None, cycles: 0 }
    }

    /// The words that the exchange has posted last.
    pub fn posted(board: &Board, links: LinkSet, carriers: [Option<bool>; 2]) -> Words {
        let words = Words::new(links, carriers, board.ring());
        Words { supervision: board.supervision(), cycles: board.cycles(), ..words }
    }

    /// The same with a supervision result and its number.
    #[must_use]
    pub fn with_result(self, number: u32, result: Supervision) -> Words {
        Words { supervision: Some((number, result)), ..self }
    }

    /// The same after this number of cycles.
    #[cfg(test)]
    #[must_use]
    pub fn after_cycles(self, cycles: u64) -> Words {
        Words { cycles, ..self }
    }

    /// The same with the ring of other words.
    #[must_use]
    pub fn with_ring(self, other: &Words) -> Words {
        Words { ring: other.ring, ..self }
    }

    /// The links in use.
    pub fn links(&self) -> LinkSet {
        self.links
    }

    /// Carriers of the links, by [`Link::index`].
    pub fn carriers(&self) -> [Option<bool>; 2] {
        self.carriers
    }

    /// State of the ring.
    pub fn ring_state(&self) -> RingState {
        self.ring.state
    }

    /// Changes of the ring so far.
    pub fn ring_changes(&self) -> u32 {
        self.ring.changes
    }

    /// The link whose copies are lost though those of the other link pass the ring.
    pub fn dead_way(&self) -> Option<Link> {
        self.ring.dead_way
    }

    /// Number of the latest supervision result.
    pub fn number(&self) -> Option<u32> {
        self.supervision.map(|(number, _)| number)
    }

    /// SubDevices that the latest supervision result counts.
    pub fn counted(&self) -> Option<Wkc> {
        self.supervision.map(|(_, result)| result.total())
    }

    /// SubDevices on each link in the latest supervision result; none without a result.
    fn answering(&self) -> LinkCounts {
        self.supervision.map(|(_, result)| counts_of(&result)).unwrap_or_default()
    }

    /// No link has a carrier.
    pub fn is_unplugged(&self) -> bool {
        let links = if self.links == LinkSet::Ring { 2 } else { 1 };
        self.carriers.iter().take(links).all(|carrier| *carrier == Some(false))
    }

    /// Whether a link in use has lost its carrier.
    pub fn has_no_carrier(&self, link: Link) -> bool {
        (link == Link::Main || self.links == LinkSet::Ring) && self.carriers[link.index()] == Some(false)
    }
}

fn counts_of(result: &Supervision) -> LinkCounts {
    LinkCounts { main: result.main.0, redundant: result.redundant.0 }
}
