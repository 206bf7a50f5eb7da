//! Whether cyclic frames are on the wire, according to the board.

use super::Board;
use crate::link::{Link, LinkSet};
use crate::ring::Sequence;

impl Board {
    /// Number of the departure after which no cyclic frame is on the wire, copies on silent links (a bit each)
    /// excepted; `None` while some are, and also where the last one was lost.
    pub(crate) fn at_rest(&self, links: LinkSet, silent: u8) -> Option<u32> {
        let cycles = self.cycles() as u32;
        // Cycles and sequence numbers of frames count alike.
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

    // covers: dc-remeasure
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
