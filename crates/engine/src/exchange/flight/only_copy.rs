//! The usual end of a flight where there is one link: its only copy shows the same as the one before.

use super::{CyclicFrame, Shown, Stage};
use crate::board::Supervision;
use crate::exchange::image::{Image, Moment};
use crate::exchange::usual::Usual;
use crate::link::Link;
use crate::ring::{Arrivals, Sequence};

impl CyclicFrame {
    /// Whether bytes are those of the only copy of the current flight with the same results as the one before, none of
    /// which was incomplete or came from an older cycle than others in the image.
    #[inline(always)]
    pub(crate) fn is_back_as_usual(&self, sequence: Sequence, bytes: &[u8], image: &Image) -> bool {
        let main = Link::Main.index();
        self.stage == Stage::Waiting
            && self.sequence == sequence
            && self.views.is_enough[main]
            && self.left >= image.newest
            && self.is_usual(main, bytes)
    }

    /// Takes such a copy: delivers it, and ends the flight. Returns the result of its supervision datagram, if it has
    /// one.
    #[inline(always)]
    pub(crate) fn take_usual(&mut self, bytes: &[u8], image: &mut Image, cycle: u64) -> Option<u64> {
        let main = Link::Main.index();
        let Usual { wkc, supervision, .. } = self.usual[main];
        let arrivals = Arrivals { arrived: Link::Main.bit(), returned: Link::Main.bit() };
        self.shown = Shown { supervision, wkc, arrivals, complete: true, is_overtaken: false };
        image.newest = self.left;
        let moment = Moment { left: self.left, came: cycle + 1 };
        for place in &mut self.places {
            place.deliver(main, bytes, image, moment);
        }
        self.stage = Stage::Idle;
        self.supervision_at.map(|_| supervision | Supervision::RETURNED)
    }
}
