//! What the exchange posts about its frames on the wire, so that the acyclic half can send a frame while no other is on
//! the wire (protocol 7.1).
//!
//! Single writer: the exchange. It posts a departure before it hands the first frame to a link, the cycle when it has
//! handed over the last one (`Board::post_cycle`), and the last frame of which a copy returned, by link. A link keeps
//! the order of frames, so when a copy of the last frame has returned, the earlier ones have returned or are lost.

use core::sync::atomic::{AtomicU16, AtomicU32, AtomicU64, Ordering};

use crate::link::{Link, LinkSet};
use crate::ring::Sequence;
use crate::time::Instant;

/// The words.
#[derive(Debug)]
pub struct Traffic {
    /// Number of the latest departure, from 0 on; the predecessor of 0 before the first one.
    begun: AtomicU32,
    /// The last frame of which all copies returned.
    home: AtomicU16,
    /// The last frame of which one copy but not yet all returned, by the link it was sent on.
    half_home: [AtomicU16; 2],
    /// End of the pause that the supervisor requests.
    pause_until: AtomicU64,
}

impl Default for Traffic {
    fn default() -> Traffic {
        let [home, main, redundant] = [0; 3].map(AtomicU16::new);
        let (begun, pause_until) = (AtomicU32::new(u32::MAX), AtomicU64::new(0));
        Traffic { begun, home, half_home: [main, redundant], pause_until }
    }
}

impl Traffic {
    /// The frames of the cycle with this number, from 0 on, are about to leave.
    pub(crate) fn post_departure(&self, cycle: u64) {
        self.begun.store(cycle as u32, Ordering::Release);
    }

    /// All copies of a frame have returned.
    pub(crate) fn post_home(&self, sequence: Sequence) {
        self.home.store(sequence.number(), Ordering::Release);
    }

    /// One copy of a frame returned, others have not.
    pub(crate) fn post_half_home(&self, sent_on: Link, sequence: Sequence) {
        self.half_home[sent_on.index()].store(sequence.number(), Ordering::Release);
    }

    /// The last frame of which all copies returned, those on silent links (a bit each) excepted, by link; the same for
    /// both links where none is silent.
    pub(crate) fn home(&self, links: LinkSet, silent: u8) -> [u16; 2] {
        if links.mask() & silent == 0 {
            return [self.home.load(Ordering::Acquire); 2];
        }
        [0, 1].map(|link: usize| self.half_home[link].load(Ordering::Acquire))
    }

    /// Number of departures, including one that has only begun.
    pub(crate) fn departures(&self) -> u32 {
        self.begun.load(Ordering::Acquire).wrapping_add(1)
    }

    /// Requests that the exchange begins no cycle earlier than this.
    pub(crate) fn ask_for_pause(&self, until: Instant) {
        self.pause_until.store(until.0, Ordering::Relaxed);
    }

    /// Time before which no cycle is to begin; in the distant past without a request.
    pub fn pause_until(&self) -> Instant {
        Instant(self.pause_until.load(Ordering::Relaxed))
    }
}
