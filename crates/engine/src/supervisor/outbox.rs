//! Datagrams that wait to be sent: reads of mailboxes behind everything else, and few at a time.
//!
//! A SubDevice works while its answer is waited for, and rests until the next request reaches it. So requests go before
//! reads, which are long: those of a hundred SubDevices would keep the wire busy for a millisecond, in which nobody had
//! anything to do. What was handed to the interface cannot be overtaken, so only as many reads are under way as keep the
//! wire busy until the first of them is back.

use alloc::collections::VecDeque;
use core::time::Duration;

use ringcat_wire::datagram::Target;
use ringcat_wire::frame::{BYTE_TIME_NS, MAX_FRAME, wire_time_ns};

use super::transfer::TransferId;
use super::turns::Turns;
use crate::time::Instant;

/// Bytes of reads under way besides those that fill the wire for the time of a round trip.
const AHEAD: usize = 2 * MAX_FRAME;
/// A read that waited for so long goes before everything else.
const PATIENCE: Duration = Duration::from_millis(5);
/// A way through the segment that has become longer is believed by this part of it each time.
const FADING_PART: u32 = 256;

/// Which of the two queues.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Rank {
    /// Everything else.
    First,
    /// Reads of mailboxes.
    Read,
}

/// A read that waits.
#[derive(Clone, Copy, Debug)]
struct Read {
    id: TransferId,
    bytes: usize,
    since: Instant,
    /// The round of everything else in which it came.
    round: u64,
}

/// The queues.
#[derive(Debug, Default)]
pub(crate) struct Outbox {
    first: Turns,
    reads: VecDeque<Read>,
    /// Bytes of these.
    waiting: usize,
    /// Bytes of reads that were packed and are not back.
    under_way: usize,
    /// When the interface has sent what it was given.
    free_at: Instant,
    /// The shortest way through the segment of late.
    way: Option<Duration>,
}

impl Outbox {
    /// Queues a datagram that takes so many bytes of a frame.
    pub(crate) fn push(&mut self, id: TransferId, rank: Rank, target: Target, bytes: usize, now: Instant) {
        match rank {
            Rank::First => self.first.push(id, target, bytes),
            Rank::Read => {
                self.waiting += bytes;
                self.reads.push_back(Read { id, bytes, since: now, round: self.first.round() });
            }
        }
    }

    /// What goes next, into a frame that may hold reads or not.
    pub(crate) fn front(&self, reads: bool, now: Instant) -> Option<(TransferId, Rank)> {
        self.first.settle();
        let read = self.reads.front().filter(|_| reads);
        match (self.first.front(), read) {
            (Some((_, round)), Some(read)) if round > read.round || now.since(read.since) >= PATIENCE => {
                Some((read.id, Rank::Read))
            }
            (Some((id, _)), _) => Some((id, Rank::First)),
            (None, Some(read)) => Some((read.id, Rank::Read)),
            (None, None) => None,
        }
    }

    /// It is packed, or nobody wants it any more.
    pub(crate) fn pop(&mut self, rank: Rank) {
        match rank {
            Rank::First => self.first.pop(),
            Rank::Read => self.waiting -= self.reads.pop_front().map_or(0, |read| read.bytes),
        }
    }

    /// Whether anything waits that may go now.
    pub(crate) fn is_ready(&self, now: Instant) -> bool {
        !self.first.is_empty() || (!self.reads.is_empty() && self.may_read(now))
    }

    /// When reads that wait for others to share their frame go without them.
    pub(crate) fn next_deadline(&self, now: Instant) -> Option<Instant> {
        (!self.reads.is_empty() && self.has_room() && self.free_at > now).then_some(self.free_at)
    }

    /// Whether the next frame may hold reads: one that has room left, a full one, or, as soon as the interface has
    /// nothing else to send, any. Many short frames take more of the wire.
    pub(crate) fn may_read(&self, now: Instant) -> bool {
        let worthwhile = !self.first.is_empty() || self.waiting >= MAX_FRAME || self.free_at <= now;
        worthwhile && self.has_room()
    }

    fn has_room(&self) -> bool {
        let way = self.way.unwrap_or_default().as_nanos() / u128::from(BYTE_TIME_NS);
        let limit = AHEAD.saturating_add(usize::try_from(way).unwrap_or(usize::MAX));
        self.under_way + self.waiting.min(MAX_FRAME) <= limit
    }

    /// A frame is handed to the interface. Returns when it begins to leave at the earliest, and when it has left.
    pub(crate) fn hand_over(&mut self, length: usize, now: Instant) -> (Instant, Instant) {
        let begins = self.free_at.max(now);
        self.free_at = begins + Duration::from_nanos(wire_time_ns(length));
        (begins, self.free_at)
    }

    /// So many bytes of reads were packed.
    pub(crate) fn set_out(&mut self, bytes: usize) {
        self.under_way += bytes;
    }

    /// They are back, or lost.
    pub(crate) fn came_back(&mut self, bytes: usize) {
        self.under_way = self.under_way.saturating_sub(bytes);
    }

    /// A frame came back so long after it had left.
    pub(crate) fn took(&mut self, way: Duration) {
        self.way = Some(self.way.map_or(way, |shortest| way.min(shortest + shortest / FADING_PART)));
    }
}

#[cfg(test)]
mod tests {
    use super::super::transfer::{Transfer, Transfers};
    use super::*;

    const READ: usize = 140;

    fn ids<const N: usize>() -> [TransferId; N] {
        let mut transfers = Transfers::default();
        core::array::from_fn(|_| transfers.insert(Transfer::for_test()))
    }

    #[test]
    fn requests_go_before_reads_unless_these_have_waited_for_long() {
        let [a, b, c] = ids();
        let mut outbox = Outbox::default();
        outbox.push(a, Rank::Read, Target::None, READ, Instant(0));
        outbox.push(b, Rank::First, Target::None, 40, Instant(10));
        assert_eq!(outbox.front(true, Instant(10)), Some((b, Rank::First)));
        assert_eq!(outbox.front(true, Instant(0) + PATIENCE), Some((a, Rank::Read)));
        outbox.pop(Rank::Read);
        outbox.pop(Rank::First);
        assert_eq!(outbox.front(true, Instant(10)), None);
        outbox.push(c, Rank::Read, Target::None, READ, Instant(20));
        assert_eq!(outbox.front(false, Instant(20)), None, "this frame holds no reads");
    }

    #[test]
    fn reads_under_way_are_those_of_two_frames_and_of_the_way_through_the_segment() {
        let mut outbox = Outbox::default();
        ids::<64>().into_iter().for_each(|id| outbox.push(id, Rank::Read, Target::None, READ, Instant(0)));
        assert!(outbox.is_ready(Instant(0)));
        outbox.set_out(MAX_FRAME);
        assert!(outbox.is_ready(Instant(0)), "a second frame may go");
        outbox.set_out(MAX_FRAME);
        assert!(!outbox.is_ready(Instant(0)));
        outbox.took(Duration::from_nanos(MAX_FRAME as u64 * BYTE_TIME_NS));
        assert!(outbox.is_ready(Instant(0)), "a third one fills the way");
        outbox.set_out(MAX_FRAME);
        assert!(!outbox.is_ready(Instant(0)));
        outbox.came_back(MAX_FRAME);
        assert!(outbox.is_ready(Instant(0)));
    }

    #[test]
    fn a_few_reads_wait_for_others_while_the_interface_is_busy() {
        let [a] = ids();
        let mut outbox = Outbox::default();
        let (begins, left) = outbox.hand_over(MAX_FRAME, Instant(100));
        assert_eq!((begins, left), (Instant(100), Instant(100 + wire_time_ns(MAX_FRAME))));
        assert_eq!(outbox.hand_over(60, Instant(100)).0, left, "one frame leaves after the other");
        outbox.push(a, Rank::Read, Target::None, READ, Instant(100));
        assert!(!outbox.is_ready(Instant(100)));
        let until = outbox.next_deadline(Instant(100)).unwrap();
        assert!(outbox.is_ready(until) && outbox.next_deadline(until).is_none());
    }
}
