//! What the exchange posts about its frames on the wire, so that a frame of the other half can be alone there (protocol
//! 7.1).
//!
//! Single writer: the exchange. It posts a departure before it hands the first frame to a link, the cycle when it has
//! handed over the last one (`Board::post_cycle`), and the last frame of which a copy came home, by link. A link hands
//! frames over in their order, so when a copy of the last one is home, those before it are home or lost.

use core::sync::atomic::{AtomicU16, AtomicU32, AtomicU64, Ordering};

use crate::link::{Link, LinkSet};
use crate::ring::Sequence;
use crate::time::Instant;

/// The words.
#[derive(Debug)]
pub struct Traffic {
    /// Number of the departure that has begun last, from 0 on; before the first one, that before 0.
    begun: AtomicU32,
    /// The last frame of which all copies came home.
    home: AtomicU16,
    /// The last frame of which a copy came home and not yet all, by the link it was sent on.
    half_home: [AtomicU16; 2],
    /// Until when the supervisor asks for a pause.
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

    /// All copies of a frame are home.
    pub(crate) fn post_home(&self, sequence: Sequence) {
        self.home.store(sequence.number(), Ordering::Release);
    }

    /// A copy came home, others have not.
    pub(crate) fn post_half_home(&self, sent_on: Link, sequence: Sequence) {
        self.half_home[sent_on.index()].store(sequence.number(), Ordering::Release);
    }

    /// The last frame that is home but for copies on silent links (a bit each), by link; the same for both where none
    /// is.
    pub(crate) fn home(&self, links: LinkSet, silent: u8) -> [u16; 2] {
        if links.mask() & silent == 0 {
            return [self.home.load(Ordering::Acquire); 2];
        }
        [0, 1].map(|link: usize| self.half_home[link].load(Ordering::Acquire))
    }

    /// How many departures there were, those that have only begun included.
    pub(crate) fn departures(&self) -> u32 {
        self.begun.load(Ordering::Acquire).wrapping_add(1)
    }

    /// Asks for cycles to begin no earlier than this.
    pub(crate) fn ask_for_pause(&self, until: Instant) {
        self.pause_until.store(until.0, Ordering::Relaxed);
    }

    /// Until when cycles are to wait; long ago where nothing was asked.
    pub fn pause_until(&self) -> Instant {
        Instant(self.pause_until.load(Ordering::Relaxed))
    }
}
