//! Datagrams that wait to be sent: mailbox reads after all others, and few at a time.
//!
//! A SubDevice prepares its answer while the MainDevice waits, and idles until its next request. So requests are sent
//! before reads, which are long: the reads of a hundred SubDevices occupy the wire for a millisecond, in which all
//! SubDevices idle. Datagrams handed to the interface cannot be reordered, so the reads on the wire are limited to the
//! number that keeps the wire busy until the first one returns.
//!
//! Requests are sent first as long as their SubDevice has not used more than its share of the wire ([`super::turns`]):
//! otherwise continuous requests to one SubDevice would delay the answers of all others.

use alloc::collections::VecDeque;
use core::time::Duration;

use ringcat_wire::datagram::Target;
use ringcat_wire::frame::{BYTE_TIME_NS, MAX_FRAME, wire_time_ns};

use super::transfer::TransferId;
use super::turns::{Accounts, Turn, Turns};
use crate::time::Instant;

/// Bytes of reads on the wire, beyond those that fill it for a round trip.
const AHEAD: usize = 2 * MAX_FRAME;
/// A read that has waited for this time is sent before all requests.
const MAX_READ_WAIT: Duration = Duration::from_millis(5);
/// The shortest round trip may grow by this part of itself per measurement.
const FADING_PART: u64 = 256;

/// Urgent datagrams that are sent in a row while others wait.
const URGENT_IN_A_ROW: usize = 16;

/// The three queues.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Rank {
    /// Datagrams that are sent before all that wait, in the order of their requests.
    Urgent,
    /// All other datagrams.
    First,
    /// Reads of mailboxes.
    Read,
}

/// A waiting read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Read {
    id: TransferId,
    bytes: usize,
    since: Instant,
}

/// The queues.
#[derive(Debug, Default)]
pub(crate) struct Outbox {
    urgent: VecDeque<TransferId>,
    /// Number of urgent datagrams that were packed since another one was.
    urgent_in_a_row: usize,
    accounts: Accounts,
    first: Turns<TransferId>,
    reads: Turns<Read>,
    /// Length of the waiting reads in bytes.
    waiting: usize,
    /// Length of the reads that were packed and have not returned, in bytes.
    under_way: usize,
    /// When the interface finishes sending.
    free_at: Instant,
    /// The shortest recent round trip in nanoseconds.
    round_trip: Option<u64>,
}

impl Outbox {
    /// Queues a datagram that takes this number of bytes in a frame.
    pub(crate) fn push(&mut self, id: TransferId, rank: Rank, target: Target, bytes: usize, now: Instant) {
        if rank == Rank::Urgent {
            self.urgent.push_back(id);
            return;
        }
        let waiting = [self.first.front().map(|(turn, _)| turn), self.reads.front().map(|(turn, _)| turn)];
        let now_is = waiting.iter().flatten().map(|turn| turn.round).min().unwrap_or(0);
        let turn = self.accounts.turn(target, bytes, now_is);
        match rank {
            Rank::Urgent | Rank::First => self.first.push(turn, id),
            Rank::Read => {
                self.waiting += bytes;
                self.reads.push(turn, Read { id, bytes, since: now });
            }
        }
    }

    /// The next datagram; `reads`: the frame may hold reads. Later datagrams do not overtake it, except urgent ones, of
    /// which [`URGENT_IN_A_ROW`] are sent for each other one that waits.
    pub(crate) fn front(&self, reads: bool, now: Instant) -> Option<(TransferId, Rank)> {
        let urgent = self.front_of_urgent();
        let is_others_turn = || urgent.is_none() || self.urgent_in_a_row >= URGENT_IN_A_ROW;
        let other = is_others_turn().then(|| self.front_of_others(reads, now)).flatten();
        other.or(urgent)
    }

    /// The next urgent datagram. While a group is put into a frame, only urgent datagrams are taken, so that no other
    /// datagram comes between those of the group.
    pub(crate) fn front_of_urgent(&self) -> Option<(TransferId, Rank)> {
        self.urgent.front().map(|id| (*id, Rank::Urgent))
    }

    fn front_of_others(&self, reads: bool, now: Instant) -> Option<(TransferId, Rank)> {
        let read = self.reads.front().filter(|_| reads);
        match (self.first.front(), read) {
            (Some((turn, id)), waiting) => {
                let passes =
                    |(other, read): &(Turn, &Read)| turn.round > other.round || now.since(read.since) >= MAX_READ_WAIT;
                if let Some((turn, read)) = waiting.filter(passes) {
                    self.reads.settle(turn);
                    return Some((read.id, Rank::Read));
                }
                self.first.settle(turn);
                Some((*id, Rank::First))
            }
            (None, Some((turn, read))) => {
                self.reads.settle(turn);
                Some((read.id, Rank::Read))
            }
            (None, None) => None,
        }
    }

    /// Removes the next datagram: it was packed, or its procedure gave it up.
    pub(crate) fn pop(&mut self, rank: Rank) {
        match rank {
            Rank::Urgent => _ = self.urgent.pop_front(),
            Rank::First => _ = self.first.pop(),
            Rank::Read => self.waiting -= self.reads.pop().map_or(0, |read| read.bytes),
        }
        self.urgent_in_a_row = if rank == Rank::Urgent { self.urgent_in_a_row + 1 } else { 0 };
        if self.first.is_empty() && self.reads.is_empty() {
            self.accounts.forget();
        }
    }

    /// Whether a waiting datagram may be sent now.
    pub(crate) fn is_ready(&self, now: Instant) -> bool {
        !self.urgent.is_empty() || !self.first.is_empty() || (!self.reads.is_empty() && self.may_read(now))
    }

    /// Time at which waiting reads are sent even in a short frame.
    pub(crate) fn next_deadline(&self, now: Instant) -> Option<Instant> {
        (!self.reads.is_empty() && self.has_room() && self.free_at > now).then_some(self.free_at)
    }

    /// Whether the next frame may hold reads: beside requests, as a full frame, or in any frame as soon as the
    /// interface is idle. Many short frames would waste bandwidth.
    pub(crate) fn may_read(&self, now: Instant) -> bool {
        let worthwhile = !self.first.is_empty() || self.waiting >= MAX_FRAME || self.free_at <= now;
        worthwhile && self.has_room()
    }

    fn has_room(&self) -> bool {
        let round_trip = self.round_trip.unwrap_or_default() / BYTE_TIME_NS;
        let limit = AHEAD.saturating_add(usize::try_from(round_trip).unwrap_or(usize::MAX));
        self.under_way + self.waiting.min(MAX_FRAME) <= limit
    }

    /// A frame is handed to the interface. Returns the earliest start and end of its transmission.
    pub(crate) fn hand_over(&mut self, length: usize, now: Instant) -> (Instant, Instant) {
        let begins = self.free_at.max(now);
        self.free_at = Instant(begins.0.saturating_add(wire_time_ns(length)));
        (begins, self.free_at)
    }

    /// Reads of this length were packed.
    pub(crate) fn reads_sent(&mut self, bytes: usize) {
        self.under_way += bytes;
    }

    /// Reads of this length returned, or were lost.
    pub(crate) fn reads_returned(&mut self, bytes: usize) {
        self.under_way = self.under_way.saturating_sub(bytes);
    }

    /// A frame returned this number of nanoseconds after its transmission.
    pub(crate) fn note_round_trip(&mut self, ns: u64) {
        self.round_trip = Some(self.round_trip.map_or(ns, |shortest| ns.min(shortest + shortest / FADING_PART)));
    }
}

#[cfg(test)]
mod tests {
    use alloc::collections::BTreeMap;
    use alloc::vec::Vec;

    use ringcat_wire::address::{RegisterAddress, StationAddress};

    use super::super::transfer::{Transfer, Transfers};
    use super::super::turns::SHARE;
    use super::*;

    const READ: usize = 140;

    fn ids<const N: usize>() -> [TransferId; N] {
        let mut transfers = Transfers::default();
        core::array::from_fn(|_| transfers.insert(Transfer::for_test()))
    }

    // covers: start-lists
    #[test]
    fn requests_are_sent_before_reads_unless_a_read_has_waited_for_5_ms() {
        let [a, b, c] = ids();
        let mut outbox = Outbox::default();
        outbox.push(a, Rank::Read, Target::None, READ, Instant(0));
        outbox.push(b, Rank::First, Target::None, 40, Instant(10));
        assert_eq!(outbox.front(true, Instant(10)), Some((b, Rank::First)));
        assert_eq!(outbox.front(true, Instant(0) + MAX_READ_WAIT), Some((a, Rank::Read)));
        outbox.pop(Rank::Read);
        outbox.pop(Rank::First);
        assert_eq!(outbox.front(true, Instant(10)), None);
        outbox.push(c, Rank::Read, Target::None, READ, Instant(20));
        assert_eq!(outbox.front(false, Instant(20)), None, "this frame holds no reads");
    }

    // covers: registers
    #[test]
    fn an_urgent_datagram_is_sent_before_all_that_wait() {
        let [a, b, c, d] = ids();
        let mut outbox = Outbox::default();
        outbox.push(a, Rank::Read, Target::None, READ, Instant(0));
        outbox.push(b, Rank::First, Target::None, 40, Instant(0));
        // The first one is next to be sent, and the read has waited for too long.
        let late = Instant(0) + MAX_READ_WAIT;
        assert_eq!(outbox.front(true, late), Some((a, Rank::Read)));
        outbox.push(c, Rank::Urgent, Target::None, 40, late);
        outbox.push(d, Rank::Urgent, Target::None, 40, late);
        let mut sent = Vec::new();
        while let Some((id, rank)) = outbox.front(true, late) {
            outbox.pop(rank);
            sent.push(id);
        }
        assert_eq!(sent, [c, d, a, b]);
        assert!(!outbox.is_ready(late));
    }

    // covers: registers
    #[test]
    fn others_are_sent_after_each_16_urgent_datagrams() {
        let [a, b, c] = ids();
        let mut outbox = Outbox::default();
        outbox.push(a, Rank::First, Target::None, 40, Instant(0));
        outbox.push(b, Rank::Read, Target::None, READ, Instant(0));
        // Another urgent one always waits.
        outbox.push(c, Rank::Urgent, Target::None, 40, Instant(0));
        let sent = (0..60).filter_map(|_| {
            outbox.push(c, Rank::Urgent, Target::None, 40, Instant(0));
            let (id, rank) = outbox.front(true, Instant(0))?;
            outbox.pop(rank);
            Some((id, rank))
        });
        let others: Vec<_> = sent.enumerate().filter(|(_, (_, rank))| *rank != Rank::Urgent).collect();
        assert_eq!(others, [(16, (a, Rank::First)), (33, (b, Rank::Read))]);
        assert_eq!(outbox.front(false, Instant(0)), Some((c, Rank::Urgent)), "nothing else waits");
    }

    /// Continuous load of a SubDevice: datagrams of this length, or a request and then the read of its answer.
    #[derive(Clone, Copy, Debug)]
    enum Load {
        Datagrams(usize),
        Mail { write: usize, read: usize },
    }

    // covers: byte-budget
    #[test]
    fn continuous_loads_get_equal_bytes_to_within_a_datagram_each_and_two_shares() {
        const MAIL: Load = Load::Mail { write: 40, read: READ };
        let loads =
            [MAIL, Load::Datagrams(1490), MAIL, Load::Datagrams(28), Load::Datagrams(400), MAIL, Load::Datagrams(800)];
        let mut transfers = Transfers::default();
        let mut outbox = Outbox::default();
        let mut owners: BTreeMap<TransferId, (usize, usize)> = BTreeMap::new();
        let enqueue =
            |outbox: &mut Outbox, owners: &mut BTreeMap<_, _>, transfers: &mut Transfers, owner: usize, rank| {
                let bytes = match (loads[owner], rank) {
                    (Load::Datagrams(bytes), _) => bytes,
                    (Load::Mail { write, .. }, Rank::Urgent | Rank::First) => write,
                    (Load::Mail { read, .. }, Rank::Read) => read,
                };
                let id = transfers.insert(Transfer::for_test());
                let target = Target::Station(StationAddress(owner as u16), RegisterAddress(0));
                outbox.push(id, rank, target, bytes, Instant(0));
                owners.insert(id, (owner, bytes));
            };
        for (owner, load) in loads.iter().enumerate() {
            // A thousand datagrams are queued at once.
            let count = if matches!(load, Load::Datagrams(_)) { 1000 } else { 1 };
            (0..count).for_each(|_| enqueue(&mut outbox, &mut owners, &mut transfers, owner, Rank::First));
        }
        let mut had = [0i64; 7];
        // Difference in bytes between two SubDevices: smallest and largest at any time.
        let mut ahead = [[(0, 0); 7]; 7];
        for _ in 0..20_000 {
            let (id, rank) = outbox.front(true, Instant(0)).expect("plenty");
            outbox.pop(rank);
            let (owner, bytes) = owners.remove(&id).expect("it was queued");
            had[owner] += bytes as i64;
            let is_request = matches!(loads[owner], Load::Mail { .. }) && rank == Rank::First;
            let next = if is_request { Rank::Read } else { Rank::First };
            enqueue(&mut outbox, &mut owners, &mut transfers, owner, next);
            for (one, other) in (0..7).flat_map(|one| (0..7).map(move |other| (one, other))) {
                let (least, most) = &mut ahead[one][other];
                let by = had[one] - had[other];
                (*least, *most) = ((*least).min(by), (*most).max(by));
            }
        }
        // In any time window, the difference changes by at most the range of all differences.
        let longest = loads.map(|load| match load {
            Load::Datagrams(bytes) => bytes as i64,
            Load::Mail { write, read } => (write + read) as i64,
        });
        for (one, other) in (0..7).flat_map(|one| (0..7).map(move |other| (one, other))) {
            let (least, most) = ahead[one][other];
            let limit = longest[one] + longest[other] + 2 * SHARE as i64;
            assert!(most - least <= limit, "{} bytes between {one} and {other}, {had:?}", most - least);
        }
    }

    // covers: start-lists
    #[test]
    fn reads_on_the_wire_fill_two_frames_and_the_round_trip() {
        let mut outbox = Outbox::default();
        ids::<64>().into_iter().for_each(|id| outbox.push(id, Rank::Read, Target::None, READ, Instant(0)));
        assert!(outbox.is_ready(Instant(0)));
        outbox.reads_sent(MAX_FRAME);
        assert!(outbox.is_ready(Instant(0)), "a second frame may be sent");
        outbox.reads_sent(MAX_FRAME);
        assert!(!outbox.is_ready(Instant(0)));
        outbox.note_round_trip(MAX_FRAME as u64 * BYTE_TIME_NS);
        assert!(outbox.is_ready(Instant(0)), "a third frame fills the round trip");
        outbox.reads_sent(MAX_FRAME);
        assert!(!outbox.is_ready(Instant(0)));
        outbox.reads_returned(MAX_FRAME);
        assert!(outbox.is_ready(Instant(0)));
    }

    // covers: start-lists
    #[test]
    fn a_short_frame_of_reads_waits_while_the_interface_is_busy() {
        let [a] = ids();
        let mut outbox = Outbox::default();
        let (begins, left) = outbox.hand_over(MAX_FRAME, Instant(100));
        assert_eq!((begins, left), (Instant(100), Instant(100 + wire_time_ns(MAX_FRAME))));
        assert_eq!(outbox.hand_over(60, Instant(100)).0, left, "the second frame is sent after the first");
        outbox.push(a, Rank::Read, Target::None, READ, Instant(100));
        assert!(!outbox.is_ready(Instant(100)));
        let until = outbox.next_deadline(Instant(100)).unwrap();
        assert!(outbox.is_ready(until) && outbox.next_deadline(until).is_none());
    }
}
