//! The posted words themselves. Their fields are visible in this directory only.

use ringcat_wire::address::Wkc;

use crate::board::{Board, RingWord, Supervision};
use crate::link::{Link, LinkSet};
use crate::ring::RingState;
use crate::ring_status::LinkCounts;

/// Words posted by the exchange, or without an application the answer to a broadcast, and the carriers of the links.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Words {
    /// The links in use.
    pub(super) links: LinkSet,
    /// Carriers by [`Link::index`]; `None` if the links do not report them.
    pub(super) carriers: [Option<bool>; 2],
    /// The state of the ring.
    pub(super) ring: RingWord,
    /// The latest supervision result and its number; without an application a new one, or none.
    pub(super) supervision: Option<(u32, Supervision)>,
    /// Cycles that the exchange has sent.
    pub(super) cycles: u64,
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
    pub(super) fn answering(&self) -> LinkCounts {
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

/// SubDevices on each link in a result.
pub(super) fn counts_of(result: &Supervision) -> LinkCounts {
    LinkCounts { main: result.main.0, redundant: result.redundant.0 }
}
