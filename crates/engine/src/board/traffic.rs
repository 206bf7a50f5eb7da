//! What the exchange posts about its frames on the wire, so that a frame of the other half can be alone there (facts 7.1).
//!
//! Single writer: the exchange. It posts a departure before it hands the first frame to a link, the cycle when it has handed
//! over the last one (`Board::post_cycle`), and the last frame of which a copy came home, by link. A link hands frames over
//! in their order, so when a copy of the last one is home, those before it are home or lost.

use core::sync::atomic::{AtomicU16, AtomicU32, AtomicU64, Ordering};

use super::Board;
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

    /// The last frame that is home but for copies on silent links (a bit each), by link; the same for both where none is.
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

impl Board {
    /// After how many departures no cyclic frame is under way, but for copies on links that are silent (a bit each); `None`
    /// while some are, and also where the last one was lost.
    pub(crate) fn at_rest(&self, links: LinkSet, silent: u8) -> Option<u32> {
        let cycles = self.cycles() as u32;
        // Frames and their numbers are counted together.
        let last = Sequence::of_frame(self.frames().sent).number();
        let home = self.traffic.home(links, silent);
        let is_home = |link: &Link| home[link.index()] == last;
        let waited_for = |link: &&Link| links.mask() & !silent & link.bit() != 0;
        let all_home = Link::ALL.iter().filter(waited_for).all(is_home);
        (all_home && self.traffic.departures() == cycles).then_some(cycles)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_wire_is_at_rest_when_the_last_frame_is_home_on_each_link_that_is_not_silent() {
        let board = Board::new(0);
        let traffic = &board.traffic;
        let (ring, silent) = (LinkSet::Ring, Link::Main.bit());
        assert_eq!(board.at_rest(ring, 0), Some(0), "nothing has left");
        traffic.post_departure(0);
        assert_eq!(board.at_rest(ring, 0), None, "frames are leaving");
        board.post_cycle(1, 2);
        assert_eq!(board.at_rest(ring, 0), None);
        traffic.post_home(Sequence::of_frame(1));
        traffic.post_half_home(Link::Redundant, Sequence::of_frame(2));
        assert_eq!(board.at_rest(ring, 0), None, "the second one is not home");
        assert_eq!(board.at_rest(ring, silent), Some(1), "nothing comes home there");
        traffic.post_home(Sequence::of_frame(2));
        assert_eq!(board.at_rest(ring, 0), Some(1));
        traffic.post_departure(1);
        assert_eq!((board.at_rest(ring, silent), traffic.departures()), (None, 2));
    }
}
