//! Waiting datagrams in an order that is fair between SubDevices.
//!
//! Each addressed SubDevice has an account of the bytes sent to it, its mailbox reads included. Bandwidth is divided
//! into rounds; in each round every SubDevice may use a share of bytes, in the order of requests. Data beyond the share
//! waits for later rounds, and datagrams to newly addressed SubDevices are sent first: neither a long file transfer nor
//! a thousand datagrams to one SubDevice block the others. SubDevices with continuous data get the same number of bytes
//! each, to within one datagram of each and one share. While no SubDevice needs more than its share, the order is that
//! of requests.

use alloc::collections::{BTreeMap, BinaryHeap};
use core::cell::Cell;
use core::cmp::Reverse;

use ringcat_wire::datagram::Target;

/// Share of a SubDevice in a round, in bytes: a request and its answer with a small mailbox. With a larger share,
/// SubDevices that wait for each answer would get less than those with continuous data.
pub(super) const SHARE: u64 = 256;
/// Number of accounts kept while datagrams wait; beyond it, accounts that are not ahead of the current round are
/// dropped. The next search follows when the number of the remaining accounts has doubled, which keeps the cost per
/// datagram low.
const ACCOUNTS: usize = 4096;

/// Number of accounts that are not removed when no datagram waits.
const KEPT_ACCOUNTS: usize = 16;

/// Target of a datagram.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Account {
    Station(u16),
    Position(u16),
    /// Broadcasts and datagrams without the address of one SubDevice.
    Other,
}

impl Account {
    const fn of(target: Target) -> Account {
        match target {
            Target::Station(station, _) => Account::Station(station.0),
            Target::Position(position, _) => Account::Position(position.0),
            Target::None | Target::Broadcast(_) | Target::Logical(_) => Account::Other,
        }
    }
}

/// Turn of a datagram.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Turn {
    /// The round, of [`SHARE`] bytes each.
    pub round: u64,
    order: u64,
}

/// Accounts of bytes sent or waiting, by target.
#[derive(Debug, Default)]
pub(super) struct Accounts {
    /// Bytes used by each account, on a scale on which a round has [`SHARE`] bytes. Those of before `origin` count as
    /// none.
    used: BTreeMap<Account, u64>,
    /// Where the rounds began.
    origin: u64,
    /// The most that an account has used, on the same scale.
    most: u64,
    /// Number of accounts at which those that are not ahead of the current round are dropped; at least [`ACCOUNTS`].
    limit: usize,
    order: u64,
}

impl Accounts {
    /// The turn of a datagram of this length. `now` is the round of the oldest waiting datagram: rounds that a target
    /// did not use are lost.
    pub(super) fn turn(&mut self, target: Target, bytes: usize, now: u64) -> Turn {
        let begin = self.origin + now * SHARE;
        if self.used.len() >= self.limit.max(ACCOUNTS) {
            self.used.retain(|_, used| *used > begin);
            self.limit = 2 * self.used.len();
        }
        let used = self.used.entry(Account::of(target)).or_default();
        let from = begin.max(*used);
        *used = from + bytes as u64;
        self.most = self.most.max(*used);
        self.order += 1;
        Turn { round: (from - self.origin) / SHARE, order: self.order }
    }

    /// No datagram waits: all accounts are cleared. A few keep their memory, for the next datagram to them.
    pub(super) fn forget(&mut self) {
        if self.used.len() > KEPT_ACCOUNTS {
            self.used.clear();
        }
        self.origin = self.most;
        self.limit = 0;
    }
}

/// Waiting datagrams, by turn.
#[derive(Debug)]
pub(super) struct Turns<T> {
    waiting: BinaryHeap<Reverse<(Turn, T)>>,
    /// The latest round of a datagram that was next to be sent.
    settled: Cell<u64>,
}

impl<T: Ord> Default for Turns<T> {
    fn default() -> Turns<T> {
        Turns { waiting: BinaryHeap::new(), settled: Cell::new(0) }
    }
}

impl<T: Ord> Turns<T> {
    pub(super) fn is_empty(&self) -> bool {
        self.waiting.is_empty()
    }

    /// Queues a datagram with its turn. It does not overtake a datagram that was next to be sent.
    pub(super) fn push(&mut self, turn: Turn, what: T) {
        let round = turn.round.max(self.settled.get());
        self.waiting.push(Reverse((Turn { round, ..turn }, what)));
    }

    /// The next datagram.
    pub(super) fn front(&self) -> Option<(Turn, &T)> {
        self.waiting.peek().map(|Reverse((turn, what))| (*turn, what))
    }

    /// The datagram with this turn is next to be sent: later ones do not overtake it.
    pub(super) fn settle(&self, turn: Turn) {
        self.settled.set(self.settled.get().max(turn.round));
    }

    /// Takes the datagram that [`Turns::front`] showed.
    pub(super) fn pop(&mut self) -> Option<T> {
        let Reverse((_, what)) = self.waiting.pop()?;
        if self.waiting.is_empty() {
            self.settled.set(0);
        }
        Some(what)
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;

    use ringcat_wire::address::{RegisterAddress, StationAddress};

    use super::*;

    #[derive(Default)]
    struct Bench {
        accounts: Accounts,
        turns: Turns<u16>,
    }

    const fn target(station: u16) -> Target {
        Target::Station(StationAddress(station), RegisterAddress(0))
    }

    impl Bench {
        fn request(&mut self, station: u16, bytes: usize) {
            let now = self.turns.front().map_or(0, |(turn, _)| turn.round);
            let turn = self.accounts.turn(target(station), bytes, now);
            self.turns.push(turn, station);
        }

        /// Targets in the order of sending.
        fn next(&mut self) -> Option<u16> {
            let (turn, _) = self.turns.front()?;
            self.turns.settle(turn);
            self.turns.pop()
        }
    }

    // covers: byte-budget
    #[test]
    fn datagrams_within_the_share_are_sent_in_the_order_of_requests() {
        let mut bench = Bench::default();
        let requested = [3, 1, 1, 2, 3, 1, 2, 2];
        requested.iter().for_each(|station| bench.request(*station, 100));
        let sent: Vec<u16> = core::iter::from_fn(|| bench.next()).collect();
        assert_eq!(sent, requested);
        assert!(bench.turns.is_empty());
    }

    // covers: byte-budget
    #[test]
    fn the_limit_of_accounts_doubles_while_all_are_ahead_of_the_round() {
        let mut accounts = Accounts::default();
        for station in 0..=u16::MAX {
            accounts.turn(target(station), 16, 0);
        }
        // Each search from 4,096 accounts on keeps all of them: the next follows at 8,192, 16,384, and so on.
        assert_eq!((accounts.used.len(), accounts.limit), (1 << 16, 1 << 16));
    }

    // covers: byte-budget
    #[test]
    fn a_thousand_datagrams_to_one_subdevice_do_not_block_others() {
        let mut bench = Bench::default();
        (0..1000).for_each(|_| bench.request(1, 100));
        (0..5).for_each(|_| assert_eq!(bench.next(), Some(1)));
        bench.request(2, 60);
        let before = core::iter::from_fn(|| bench.next()).take_while(|station| *station == 1).count();
        assert!(before <= 3, "{before} datagrams of 100 bytes");
        // From here both request continuously: they share the bytes.
        let mut served = [0u32; 3];
        (0..50).for_each(|_| bench.request(2, 300));
        for _ in 0..160 {
            served[usize::from(bench.next().expect("plenty"))] += 1;
        }
        let bytes = [served[1] * 100, served[2] * 300];
        assert!(bytes[0].abs_diff(bytes[1]) <= 100 + 300 + SHARE as u32, "{served:?}");
    }

    // covers: byte-budget
    #[test]
    fn after_an_idle_time_all_accounts_are_equal_however_many_there_were() {
        for others in [1, KEPT_ACCOUNTS as u16, 4 * KEPT_ACCOUNTS as u16] {
            let mut bench = Bench::default();
            for round in 0..3 {
                (0..10).for_each(|_| bench.request(1, 1500));
                (2..2 + others).for_each(|station| bench.request(station, 60));
                while bench.next().is_some() {}
                bench.accounts.forget();
                assert!(bench.accounts.used.len() <= KEPT_ACCOUNTS, "round {round}");
            }
            let requested = [1, 2, 1, 3];
            requested.iter().for_each(|station| bench.request(*station, 100));
            let sent: Vec<u16> = core::iter::from_fn(|| bench.next()).collect();
            assert_eq!(sent, requested, "after {others} others");
        }
    }

    // covers: byte-budget
    #[test]
    fn a_datagram_that_was_next_is_not_overtaken() {
        let mut bench = Bench::default();
        (0..3).for_each(|_| bench.request(1, 1500));
        bench.next();
        bench.next();
        // It waits for a wider send window; others are queued meanwhile.
        let (turn, _) = bench.turns.front().expect("one is left");
        bench.turns.settle(turn);
        (2..500).for_each(|station| bench.request(station, 60));
        assert_eq!(bench.next(), Some(1));
    }
}
