//! Datagrams that wait to be sent, in fair turns between SubDevices.
//!
//! Everybody who is addressed has an account. Time is cut into rounds; in each of them everybody may send about a full
//! frame, in the order of asking. Who asks for more than that waits for later rounds, and whoever comes meanwhile goes
//! first: a long file transfer, or a thousand datagrams to one SubDevice at once, keep nobody else from the wire. As long
//! as nobody asks for more than his share, the order is that of asking.

use alloc::collections::{BTreeMap, BinaryHeap};
use core::cell::Cell;
use core::cmp::Reverse;

use ringcat_wire::datagram::Target;

use super::transfer::TransferId;

/// Bytes that everybody may send in a round: the longest datagram, so that a SubDevice's mail is never more than a round.
const SHARE: u64 = 1536;
/// Accounts that are kept while others wait; beyond, those that owe nothing are looked for and forgotten. Where most of
/// them owe something, the next look waits until there are twice as many, so that looking costs each datagram little.
const ACCOUNTS: usize = 4096;

/// Who is addressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Account {
    Station(u16),
    Position(u16),
    /// Broadcasts and what has no address of one SubDevice.
    Everybody,
}

impl Account {
    const fn of(target: Target) -> Account {
        match target {
            Target::Station(station, _) => Account::Station(station.0),
            Target::Position(position, _) => Account::Position(position.0),
            Target::None | Target::Broadcast(_) | Target::Logical(_) => Account::Everybody,
        }
    }
}

/// A datagram that waits, in the order in which it leaves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Waiting {
    round: u64,
    order: u64,
    id: TransferId,
}

/// Datagrams that wait to be sent.
#[derive(Debug, Default)]
pub(super) struct Turns {
    waiting: BinaryHeap<Reverse<Waiting>>,
    /// Bytes up to which each account is used, on a scale on which a round has [`SHARE`] bytes.
    used: BTreeMap<Account, u64>,
    /// Accounts at which those that owe nothing are forgotten; at least [`ACCOUNTS`].
    limit: usize,
    /// The round that is under way.
    round: Cell<u64>,
    order: u64,
}

impl Turns {
    pub(super) fn is_empty(&self) -> bool {
        self.waiting.is_empty()
    }

    /// The round that is under way.
    pub(super) fn round(&self) -> u64 {
        self.round.get()
    }

    /// Queues a datagram that takes so many bytes of a frame.
    pub(super) fn push(&mut self, id: TransferId, target: Target, bytes: usize) {
        let begin = self.round.get() * SHARE;
        if self.used.len() >= self.limit.max(ACCOUNTS) {
            self.used.retain(|_, used| *used > begin);
            self.limit = 2 * self.used.len();
        }
        let used = self.used.entry(Account::of(target)).or_default();
        let from = begin.max(*used);
        *used = from + bytes as u64;
        self.order += 1;
        self.waiting.push(Reverse(Waiting { round: from / SHARE, order: self.order, id }));
    }

    /// The datagram that leaves next, and its round.
    pub(super) fn front(&self) -> Option<(TransferId, u64)> {
        self.waiting.peek().map(|Reverse(next)| (next.id, next.round))
    }

    /// What is next now is not overtaken by what comes later.
    pub(super) fn settle(&self) {
        if let Some((_, round)) = self.front() {
            self.round.set(self.round.get().max(round));
        }
    }

    /// Takes the datagram that [`Turns::front`] showed.
    pub(super) fn pop(&mut self) {
        self.settle();
        self.waiting.pop();
        if self.waiting.is_empty() {
            // Nobody owes anybody anything.
            self.used.clear();
            self.limit = 0;
            self.round.set(0);
        }
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;

    use ringcat_wire::address::{RegisterAddress, StationAddress};

    use super::super::transfer::{Transfer, Transfers};
    use super::*;

    #[derive(Default)]
    struct Bench {
        transfers: Transfers,
        turns: Turns,
        whose: Vec<(TransferId, u16)>,
    }

    impl Bench {
        fn ask(&mut self, station: u16, bytes: usize) {
            let id = self.transfers.insert(Transfer::for_test());
            self.whose.push((id, station));
            self.turns.push(id, Target::Station(StationAddress(station), RegisterAddress(0)), bytes);
        }

        /// Who leaves next.
        fn next(&mut self) -> Option<u16> {
            let (next, _) = self.turns.front()?;
            self.turns.pop();
            self.whose.iter().find(|(id, _)| *id == next).map(|(_, station)| *station)
        }
    }

    #[test]
    fn who_asks_for_no_more_than_a_share_is_served_in_the_order_of_asking() {
        let mut bench = Bench::default();
        let asked = [3, 1, 1, 2, 3, 1, 2, 2, 2];
        asked.iter().for_each(|station| bench.ask(*station, 100));
        let served: Vec<u16> = core::iter::from_fn(|| bench.next()).collect();
        assert_eq!(served, asked);
        assert!(bench.turns.is_empty() && bench.turns.used.is_empty());
    }

    #[test]
    fn accounts_are_looked_through_seldom_however_many_owe_something() {
        let mut turns = Turns::default();
        let mut transfers = Transfers::default();
        for station in 0..=u16::MAX {
            let id = transfers.insert(Transfer::for_test());
            turns.push(id, Target::Station(StationAddress(station), RegisterAddress(0)), 16);
        }
        // From 4,096 on, each look leaves all of them: 8,192, 16,384, and so on.
        assert_eq!((turns.used.len(), turns.limit), (1 << 16, 1 << 16));
    }

    #[test]
    fn a_thousand_datagrams_to_one_subdevice_let_others_pass() {
        let mut bench = Bench::default();
        (0..1000).for_each(|_| bench.ask(1, 100));
        (0..5).for_each(|_| assert_eq!(bench.next(), Some(1)));
        bench.ask(2, 60);
        let before = core::iter::from_fn(|| bench.next()).take_while(|station| *station == 1).count();
        assert!(before <= 16, "{before} datagrams of 100 bytes");
        // From now on both ask again and again: the bytes are shared.
        let mut served = [0u32; 3];
        (0..50).for_each(|_| bench.ask(2, 300));
        for _ in 0..160 {
            served[usize::from(bench.next().expect("plenty"))] += 1;
        }
        let bytes = [served[1] * 100, served[2] * 300];
        assert!(bytes[0].abs_diff(bytes[1]) <= 3_200, "{served:?}");
    }

    #[test]
    fn a_datagram_that_was_next_once_is_not_overtaken() {
        let mut bench = Bench::default();
        (0..3).for_each(|_| bench.ask(1, 1500));
        bench.next();
        bench.next();
        // It waits for a wider window; others come.
        bench.turns.settle();
        (2..500).for_each(|station| bench.ask(station, 60));
        assert_eq!(bench.next(), Some(1));
    }
}
