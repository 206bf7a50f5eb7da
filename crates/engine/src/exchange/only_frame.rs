//! The fast path of a cycle with one frame: one domain with one cycle of one frame on the wire, on one link, without
//! clocks or copies. Nearly all cycles of such an application take it (decision 0055). If lost frames are sent again, a
//! cycle without a further try takes it too.
//!
//! A step that returns false has changed nothing, and the general step follows: [`Exchange::process`],
//! [`Exchange::queue`] with [`Exchange::send`].

use super::Exchange;
use super::flight::CyclicFrame;
use crate::link::LinkSet;
use crate::time::Instant;

impl Exchange {
    /// Determines whether this path exists. It depends on the layout and the table of copies only.
    pub(super) fn find_only_frame(&mut self) {
        let has_clocks = |frame: &CyclicFrame| frame.clocks().is_some();
        let has_one_set = self.domains.len() == 1 && self.domains.iter().all(|domain| domain.frames() == (0..1));
        let has_clocks = self.frames.iter().chain(&self.others).any(has_clocks);
        let is_simple = self.copies.is_empty() && self.service.stays_at(0);
        self.has_only_frame = self.links == LinkSet::Single && has_one_set && !has_clocks && is_simple;
    }

    /// Whether the only frame is on the wire. False where there may be others.
    #[inline(always)]
    pub fn awaits_only_frame(&self) -> bool {
        self.has_only_frame && self.frames.first().is_some_and(CyclicFrame::is_waiting)
    }

    /// Evaluates the only domain if its frame has the same result as the one before: then its status stays the same.
    #[inline(always)]
    pub fn process_unchanged(&mut self) -> bool {
        let (Some(domain), Some(frame)) = (self.domains.first_mut(), self.frames.first()) else { return false };
        self.has_only_frame && frame.is_home() && domain.evaluate_unchanged(frame.wkc(), frame.left())
    }

    /// Copies the outputs of the only domain into its frame. [`Exchange::send_only_frame`] has to follow.
    #[inline(always)]
    pub fn load_only_frame(&mut self) -> bool {
        let (Some(domain), Some(frame)) = (self.domains.first_mut(), self.frames.first_mut()) else { return false };
        let is_ready = self.has_only_frame && frame.is_ready(self.board.taking_part_changes()) && !domain.is_queued();
        if is_ready {
            frame.load(domain.image(), self.cycle);
            domain.note_loaded_alone();
        }
        is_ready
    }

    /// Whether the only frame was queued and leaves now.
    #[inline(always)]
    pub(super) fn leave_alone(&mut self) -> bool {
        self.has_only_frame && self.domains.first_mut().is_some_and(|domain| domain.leave().is_some())
    }

    /// Sends the frame that [`Exchange::load_only_frame`] has loaded, and ends the cycle.
    #[inline(always)]
    pub fn send_only_frame(&mut self, now: Instant, transmit: &mut impl FnMut(&[u8])) {
        let (Some(domain), Some(frame)) = (self.domains.first(), self.frames.first_mut()) else { return };
        self.board.traffic.post_departure(self.cycle);
        self.sequence = self.sequence.next();
        self.by_id[usize::from(self.sequence.frame_id())] = 0;
        let deadline = Instant(now.0.saturating_add(domain.timeout_ns()));
        let bytes = frame.depart(&self.identity, self.sequence, deadline);
        transmit(bytes);
        let counters = &mut self.tally.counters;
        counters.sent += 1;
        counters.bytes += bytes.len() as u64;
        self.cycle += 1;
        self.board.post_cycle(self.cycle, counters.sent);
    }
}
