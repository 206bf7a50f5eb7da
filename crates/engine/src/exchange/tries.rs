//! Sends lost frames again within their cycle (decision 0045).
//!
//! Input: the times at which frames are lost ([`super::round_trip`]), and the copies that came back. A frame whose
//! copies are not back by then, or show that the ring changed while they were on the wire, is sent again on all
//! links, as long as it can come back before the next cycle. This is bounded: one check of all frames per
//! call, and at least one round trip between two tries. It is away from the usual cycle, which only notes the time of
//! the next check.

use alloc::vec::Vec;

use super::again::{Again, SyncGrid, Tries, is_mixed};
use super::domain::Domain;
use super::flight::{CyclicFrame, Step};
use super::image::InputNumber;
use super::missed::give_up;
use super::outcome::sent_at;
use super::{Exchange, Received};
use crate::domain::DomainId;
use crate::layout::{Layout, RepeatRule};
use crate::link::{Link, LinkSet};
use crate::ring::{FrameCopy, Identity, RingState};
use crate::time::Instant;

/// Cycles between two applications of the measured round trips.
const REFRESH: u64 = 64;

impl Exchange {
    /// From now on lost frames are sent again within their cycle, in domains with one cycle on the wire: `rules` has
    /// what each SubDevice may receive twice, `layout` is that of this exchange, `is_wanted` selects domains. Not for
    /// the cyclic path: this allocates.
    pub fn send_lost_frames_again(
        &mut self,
        layout: &Layout,
        rules: &[RepeatRule],
        is_wanted: impl Fn(DomainId) -> bool,
    ) {
        if !(0..layout.domains.len()).any(|number| is_wanted(DomainId(number))) {
            return;
        }
        let rule = |subdevice: usize| rules.get(subdevice).copied().unwrap_or(RepeatRule::NEVER);
        let mut again = Vec::with_capacity(self.frames.len());
        for (id, (domain, planned)) in (0..).map(DomainId).zip(self.domains.iter().zip(&layout.domains)) {
            if planned.under_way > 1 || !is_wanted(id) {
                again.extend(domain.frames().map(|_| None));
                continue;
            }
            let mut number = InputNumber { datagram: 0, part: 0 };
            for (index, frame) in domain.frames().zip(&planned.frames) {
                let repeat = planned.repeat(frame, layout.most, rule);
                // A frame leaves without process data until SubDevices answer; the other one has it.
                let whole = &self.others[index];
                let new = |repeat| Again::new(&self.identity, whole, (frame, repeat), number, rule);
                again.push(repeat.as_ref().map(new));
                number.datagram += frame.datagrams.len();
                number.part += frame.datagrams.iter().map(|datagram| datagram.input_areas.len()).sum::<usize>();
            }
        }
        self.is_alone = again.len() == 1;
        let periods = layout.domains.iter().map(|domain| domain.period.as_nanos() as u64);
        self.base_ns = periods.filter(|period| *period > 0).min().unwrap_or(0);
        self.again = again;
    }

    /// When [`Exchange::decide`] is to be called, after all frames that have arrived were received.
    #[inline(always)]
    pub fn decide_at(&self) -> Instant {
        self.decide_at
    }

    /// The next cycle begins then: frames that are sent again must be back before. Without this, a period after the
    /// departure; frames of domains without a period are not sent again then.
    #[inline(always)]
    pub fn expect_next(&mut self, at: Instant) {
        self.next_at = at;
    }

    /// How long frames are waited for before they are sent again: the longest such time. `None` before enough frames
    /// came back, and where nothing is sent again.
    pub fn waits_for_ns(&self) -> Option<u64> {
        let known = self.again.iter().flatten().map(|again| &again.round_trip);
        known.filter(|trip| trip.is_known()).map(|trip| trip.wait_ns()).max()
    }

    /// Sends frames again that are lost. All frames that had arrived at `received_at` were received; it is `now`.
    #[cold]
    pub fn decide(&mut self, received_at: Instant, now: Instant, transmit: &mut impl FnMut(Link, &[u8])) {
        self.decide_at = Instant::NEVER;
        let mut has_sent = false;
        for number in 0..self.domains.len() {
            let domain = &mut self.domains[number];
            let Some(set) = domain.on_the_wire().filter(|_| domain.may_send_again()) else { continue };
            for index in set {
                match self.next_try(number, index, received_at, now) {
                    Next::Never => {}
                    Next::At(at) => self.decide_at = self.decide_at.min(at),
                    Next::Now => {
                        if !core::mem::replace(&mut has_sent, true) {
                            self.board.traffic.post_departure(self.cycle);
                        }
                        let lost_at = self.send_again(number, index, now, transmit);
                        self.decide_at = self.decide_at.min(lost_at);
                    }
                }
            }
        }
        if has_sent {
            self.board.post_cycle(self.cycle, self.tally.counters.sent);
            // All tries have left; they belong to the last departure.
            self.board.traffic.post_departure(self.cycle.wrapping_sub(1));
        }
    }

    /// When a frame is to be sent again.
    fn next_try(&mut self, number: usize, index: usize, received_at: Instant, now: Instant) -> Next {
        let (domain, first) = (&self.domains[number], &self.frames[index]);
        let Some(Some(again)) = self.again.get_mut(index) else { return Next::Never };
        let left = first.left();
        let last_at = match again.tries(left) {
            Tries::Over | Tries::Complete => return Next::Never,
            _ if first.is_complete() || first.is_vacant() || !again.round_trip.is_known() => return Next::Never,
            Tries::First if !first.is_waiting() => return Next::Never,
            Tries::Due => Instant(0),
            Tries::First => sent_at(first, domain.timeout_ns()),
            Tries::Again => again.sent_at,
        };
        let lost_at = Instant(last_at.0.saturating_add(again.round_trip.wait_ns()));
        if lost_at > received_at && again.tries(left) != Tries::Due {
            return Next::At(lost_at);
        }
        let end = end_of_cycle(domain, first, self.cycle, self.base_ns, self.next_at);
        let back = Instant(now.0.saturating_add(again.round_trip.longest_ns()));
        let is_late =
            back > end || self.evidence.clocks.passes(again.grids(), sent_at(first, domain.timeout_ns()), back);
        if is_late {
            let was_sent = again.was_sent(left);
            again.set_tries(first, Tries::Over);
            // The last try may still come back.
            return if was_sent && end > now { Next::At(end) } else { Next::Never };
        }
        Next::Now
    }

    /// Sends a frame again; returns when this try is lost.
    fn send_again(
        &mut self,
        number: usize,
        index: usize,
        now: Instant,
        transmit: &mut impl FnMut(Link, &[u8]),
    ) -> Instant {
        let (domain, first) = (&mut self.domains[number], &mut self.frames[index]);
        let Some(Some(again)) = self.again.get_mut(index) else { return Instant::NEVER };
        again.load(first, &self.board, now);
        domain.inputs_mut().deliver_singly(first.left());
        self.sequence = self.sequence.next();
        self.by_id[usize::from(self.sequence.frame_id())] = (self.frames.len() + index) as u16;
        let deadline = Instant(now.0.saturating_add(domain.timeout_ns()));
        let bytes = again.frame.depart(&self.identity, self.sequence, deadline);
        let length = bytes.len() as u64;
        transmit(Link::Main, bytes);
        if self.links == LinkSet::Ring {
            Identity::mark_redundant(bytes, true);
            transmit(Link::Redundant, bytes);
            Identity::mark_redundant(bytes, false);
        }
        let counters = self.tally.disturbed();
        counters.sent += 1;
        counters.sent_again += 1;
        counters.bytes += length;
        Instant(now.0.saturating_add(again.round_trip.wait_ns()))
    }

    /// Takes a copy of a further try.
    pub(super) fn receive_again(&mut self, copy: FrameCopy, arrived_on: Link, bytes: &[u8]) -> Received {
        let count = self.frames.len();
        let index = usize::from(self.by_id[usize::from(copy.sequence.frame_id())]).wrapping_sub(count);
        let Some(Some(again)) = self.again.get_mut(index) else {
            self.missed.late(copy.sequence, self.tally.disturbed());
            return Received::Late;
        };
        let frame = &mut again.frame;
        let Some(domain) = self.domains.get_mut(frame.domain()) else { return Received::Other };
        // A try of an earlier cycle is late, even if none followed.
        let is_current = self.frames[index].left() == frame.left() && domain.on_the_wire().is_some();
        let step = if is_current {
            frame.receive(copy, arrived_on, bytes, domain.inputs_mut(), self.cycle, &mut self.tally)
        } else {
            Step::Late
        };
        match step {
            Step::Waiting => {
                self.board.traffic.post_half_home(copy.sent_on, frame.sequence());
            }
            Step::Finished => {
                self.board.traffic.post_home(frame.sequence());
                self.tally.counters.received += 1;
                // Only first tries show the ring and the clocks.
                frame.close();
            }
            Step::Late => {
                self.missed.late(copy.sequence, self.tally.disturbed());
                return Received::Late;
            }
            Step::Corrupt => {
                self.tally.disturbed().corrupt += 1;
                self.missed.damaged(copy.sequence);
                return Received::Corrupt;
            }
        }
        again.gather_own();
        self.taken = (count + index) as u16;
        Received::Taken
    }

    /// Whether lost frames are sent again. Then frames are taken by [`Exchange::receive_and_follow`], and
    /// [`Exchange::follow_departures`] is called after [`Exchange::send`]: the usual cycle pays nothing for it.
    #[inline(always)]
    pub fn sends_again(&self) -> bool {
        !self.again.is_empty()
    }

    /// As [`Exchange::receive`], where lost frames are sent again.
    #[inline(never)]
    pub fn receive_and_follow(&mut self, arrived_on: Link, bytes: &[u8], now: Instant) -> Received {
        if self.receive_usual(bytes) {
            self.follow_usual(now);
            return Received::Taken;
        }
        let received = self.receive_any(arrived_on, bytes);
        if received == Received::Taken {
            self.follow_copy(now);
        }
        received
    }

    /// A first try is back on the only link as usual.
    fn follow_usual(&mut self, now: Instant) {
        self.learn_way(usize::from(self.taken), now, false);
        if self.is_alone {
            self.decide_at = Instant::NEVER;
        } else if self.taken == self.newest {
            self.rest();
        }
    }

    /// A copy of any try was received.
    fn follow_copy(&mut self, now: Instant) {
        let index = usize::from(self.taken);
        if let Some(again) = index.checked_sub(self.frames.len()) {
            // Its departure is that of the first try.
            self.taken = again as u16;
            self.follow_tries(again);
        } else {
            self.learn_way(index, now, self.is_closed);
            self.follow_tries(index);
        }
    }

    /// After [`Exchange::send`], where lost frames are sent again: notes when the frames that left are lost.
    #[inline(never)]
    pub fn follow_departures(&mut self, now: Instant) {
        let left = self.cycle;
        for (index, (frame, again)) in self.frames.iter().zip(&mut self.again).enumerate() {
            if frame.is_waiting() && frame.left() == left {
                let lost_at = again.as_mut().map_or(Instant::NEVER, |again| again.round_trip.depart(now));
                self.decide_at = self.decide_at.min(lost_at);
                self.newest = index as u16;
            }
        }
        if left.is_multiple_of(REFRESH) {
            self.refresh_ways();
        }
    }

    /// Learns from the copy with which a frame became complete.
    fn learn_way(&mut self, index: usize, now: Instant, is_closed: bool) {
        let (Some(frame), Some(Some(again))) = (self.frames.get(index), self.again.get_mut(index)) else { return };
        let Some(domain) = self.domains.get(frame.domain()).filter(|_| frame.is_complete()) else { return };
        if again.round_trip.is_later(now) {
            let was_sent = again.was_sent(frame.left());
            again.round_trip.learn(sent_at(frame, domain.timeout_ns()), now, is_closed, was_sent);
        }
        again.round_trip.arrive();
    }

    /// A copy of any try was received: settles the cycle of the frame, or has it sent again at once.
    fn follow_tries(&mut self, index: usize) {
        let is_closed = self.links == LinkSet::Ring && self.evidence.monitor.state() == RingState::Closed;
        if is_closed != self.is_closed {
            self.is_closed = is_closed;
            self.again.iter_mut().flatten().for_each(|again| again.round_trip.change(is_closed));
        }
        let first = &self.frames[index];
        let left = first.left();
        if first.is_complete() && index == usize::from(self.newest) {
            self.rest();
        }
        let first = &self.frames[index];
        let Some(Some(again)) = self.again.get_mut(index) else { return };
        if again.was_sent(left) {
            again.gather_first(first);
            if first.is_complete() || again.is_proved(first) {
                let is_first = first.is_complete();
                again.set_tries(first, if is_first { Tries::Over } else { Tries::Complete });
                self.settle(index);
                self.rest();
                return;
            }
        }
        if again.was_sent(left) && again.frame.is_complete() {
            // All that may be repeated was; the rest of the first try is lost.
            again.set_tries(first, Tries::Over);
            return;
        }
        let last = if again.was_sent(left) { &again.frame } else { first };
        if last.is_complete() || last.is_waiting() || again.tries(left) == Tries::Over {
            return;
        }
        // All copies of the last try are back, and it is incomplete.
        let is_edge = last.is_doubled() || is_mixed(last);
        if is_edge {
            again.set_tries(first, Tries::Due);
            self.decide_at = Instant(0);
        } else if again.was_sent(left) {
            again.set_tries(first, Tries::Over);
        }
    }

    /// The frame that was sent last is back: if all are, no check is needed.
    #[inline(never)]
    pub(super) fn rest(&mut self) {
        if self.decide_at != Instant(0) && !self.frames.iter().any(CyclicFrame::is_waiting) {
            self.decide_at = Instant::NEVER;
        }
    }

    /// A cycle is complete because its frame was sent again: the first try is waited for no longer.
    fn settle(&mut self, index: usize) {
        let first = &mut self.frames[index];
        if first.is_waiting() {
            give_up(first, &mut self.missed, self.tally.disturbed());
        }
        self.board.post_lost(self.tally.counters.lost);
    }

    /// Applies the measured round trips of frames that can be sent again.
    #[cold]
    pub(super) fn refresh_ways(&mut self) {
        self.again.iter_mut().flatten().for_each(|again| again.round_trip.refresh(self.is_closed));
    }
}

/// When a frame is to be sent again.
enum Next {
    Now,
    At(Instant),
    Never,
}

/// When a cycle of a domain is evaluated: frames must be back before. Without a period this is the next send.
fn end_of_cycle(domain: &Domain, first: &CyclicFrame, cycle: u64, base_ns: u64, next_at: Instant) -> Instant {
    let period_ns = domain.period_ns();
    let begun = sent_at(first, domain.timeout_ns());
    let by_period = Instant(begun.0.saturating_add(period_ns));
    if next_at == Instant::NEVER {
        return by_period;
    }
    // The next cycle is that of the shortest period.
    let Some(cycles) = period_ns.checked_div(base_ns).filter(|cycles| *cycles > 0) else { return next_at };
    let later = cycles.saturating_sub(1 + cycle.saturating_sub(first.left()));
    by_period.min(Instant(next_at.0.saturating_add(later * base_ns)))
}

impl super::clocks::Clocks {
    /// Whether outputs that arrive at the latest at `back` pass a SYNC0 signal after the first try. True if the time of
    /// the SubDevices is unknown.
    fn passes(&self, grids: &[SyncGrid], first: Instant, back: Instant) -> bool {
        if grids.is_empty() {
            return false;
        }
        let Some(reference) = self.reference_time() else { return true };
        let (first, back) = (reference.at(first), reference.at(back));
        grids.iter().any(|grid| grid.lies_between(first, back))
    }
}
