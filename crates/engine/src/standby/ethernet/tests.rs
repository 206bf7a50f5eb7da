//! Two MainDevices whose acyclic master frames pass from one to the other, copy by copy.

use std::vec;
use std::vec::Vec;

use proptest::prelude::*;
use ringcat_wire::frame::MacAddress;
use ringcat_wire::master_frame::MAX_ETHERNET;
use ringcat_wire::source_address::{FORWARDED_ON_MAIN, MacCodec};

use super::PartnerEthernet;
use crate::link::{Link, LinkSet};
use crate::ring::{Identity, Sequence};
use crate::standby::endpoint::{ETHERNET_QUEUE, NotQueued, PartnerEndpoint};
use crate::time::Instant;

const MS: u64 = 1_000_000;
/// There is no window.
const NO_LIMIT: usize = usize::MAX;

/// One MainDevice and the end of its Ethernet.
struct Side {
    ethernet: PartnerEthernet,
    endpoint: PartnerEndpoint,
    sequence: Sequence,
}

impl Side {
    fn new(last: u8, most: u8) -> Side {
        let (main, redundant) = (MacAddress([0, 1, 2, 3, 4, last]), MacAddress([0, 1, 2, 3, 4, last + 1]));
        let identity = Identity::new(MacCodec::FlagsFirst, main, Some(redundant));
        let (ethernet, endpoint) = PartnerEthernet::new(identity, most, Instant(u64::from(last) * MS));
        Side { ethernet, endpoint, sequence: Sequence::default() }
    }

    /// Sends what is due as ACTIVE.
    fn send(&mut self, now: Instant, budget: usize) -> Vec<(Link, Vec<u8>)> {
        let (mut copies, sequence) = (Vec::new(), &mut self.sequence);
        let next = || {
            *sequence = sequence.next();
            *sequence
        };
        if self.ethernet.poll(true, now).is_now {
            let transmit = &mut |link: Link, bytes: &[u8]| copies.push((link, bytes.to_vec()));
            self.ethernet.transmit((now, budget), LinkSet::Ring, next, transmit);
        }
        copies
    }

    fn received(&mut self) -> Vec<Vec<u8>> {
        let mut out = [0; MAX_ETHERNET];
        core::iter::from_fn(|| self.endpoint.receive(&mut out).map(|length| out[..length].to_vec())).collect()
    }
}

/// Both, the first one ACTIVE.
struct Duo {
    sides: [Side; 2],
    now: Instant,
}

/// What becomes of a copy before the INACTIVE, and behind it.
type Lost = fn(Link) -> [bool; 2];

const NONE: Lost = |_| [false; 2];

impl Duo {
    fn new(most: u8) -> Duo {
        let mut duo = Duo { sides: [Side::new(0x10, most), Side::new(0x20, most)], now: Instant(100 * MS) };
        // The first poll shows each the other one.
        duo.run(10, NONE);
        assert!(duo.sides.iter().all(|side| side.endpoint.is_up()));
        duo
    }

    /// Runs for some periods, in ten steps each.
    fn run(&mut self, periods: usize, lost: Lost) -> usize {
        (0..periods * 10).map(|_| self.step(lost, NO_LIMIT)).sum()
    }

    /// A step; the number of master frames.
    fn step(&mut self, lost: Lost, budget: usize) -> usize {
        self.now.0 += MS / 10;
        let [active, inactive] = &mut self.sides;
        inactive.ethernet.poll(false, self.now);
        let copies = active.send(self.now, budget);
        let count = copies.len();
        for (link, mut bytes) in copies {
            let [before, behind] = lost(link);
            if before {
                continue;
            }
            inactive.ethernet.fill(&mut bytes, self.now);
            bytes[6] |= FORWARDED_ON_MAIN;
            if !behind {
                assert!(active.ethernet.take_own(&bytes, self.now));
            }
        }
        count / 2
    }

    fn queue(&mut self, side: usize, frames: impl IntoIterator<Item = Vec<u8>>) {
        frames.into_iter().for_each(|frame| self.sides[side].endpoint.send(&frame).expect("there is room"));
    }

    fn received(&mut self) -> [Vec<Vec<u8>>; 2] {
        [0, 1].map(|side| self.sides[side].received())
    }
}

/// Frames with numbers.
fn frames(count: u8, length: usize) -> Vec<Vec<u8>> {
    (0..count).map(|number| vec![number; length]).collect()
}

// covers: AC-01, AC-02, REQ034, REQ040, standby
#[test]
fn frames_of_both_sides_arrive_once_and_in_order_and_one_copy_is_enough() {
    let cases: [Lost; 5] = [
        NONE,
        |link| [link == Link::Main, false],
        |link| [link == Link::Redundant, false],
        |link| [false, link == Link::Main],
        |link| [false, link == Link::Redundant],
    ];
    for (number, lost) in cases.into_iter().enumerate() {
        let mut duo = Duo::new(4);
        for length in [14, 60, 128, 600, MAX_ETHERNET] {
            duo.queue(0, frames(20, length));
            duo.queue(1, frames(20, length));
            duo.run(20, lost);
            assert_eq!(duo.received(), [frames(20, length), frames(20, length)], "case {number}, {length} bytes");
        }
        let traffic = duo.sides.each_ref().map(|side| side.endpoint.traffic());
        assert!(traffic.iter().all(|it| (it.sent, it.received, it.missed) == (100, 100, 0)), "{number}: {traffic:?}");
    }
}

// covers: AC-02, standby
#[test]
fn both_copies_of_a_poll_get_the_same_frame_and_a_late_one_none() {
    let mut duo = Duo::new(1);
    duo.queue(1, frames(3, 60));
    let [active, inactive] = &mut duo.sides;
    let mut kept = Vec::new();
    for round in 0..3 {
        let copies = active.send(Instant(duo.now.0 + (round + 1) * 6 * MS), NO_LIMIT);
        assert_eq!(copies.len(), 2);
        let filled = copies.into_iter().map(|(_, mut bytes)| {
            inactive.ethernet.fill(&mut bytes, duo.now);
            bytes[6] = 0;
            bytes
        });
        let filled: Vec<_> = filled.collect();
        assert_eq!(filled[0], filled[1]);
        kept.push(filled[0].clone());
        // It has been forwarded: it is not touched.
        let mut again = filled[0].clone();
        again[6] = FORWARDED_ON_MAIN;
        let before = again.clone();
        inactive.ethernet.fill(&mut again, duo.now);
        assert_eq!(again, before);
    }
    // They come back in another order: what is behind a later one is dropped.
    for number in [0, 2, 1, 2] {
        active.ethernet.take_own(&kept[number], duo.now);
    }
    assert_eq!(active.received(), [vec![0; 60], vec![2; 60]]);
    assert_eq!(active.endpoint.traffic().missed, 1);
}

// covers: AC-02, AC-05, MR-07, standby
#[test]
fn a_sender_counts_on_in_both_roles_and_begins_anew_with_its_program() {
    let mut duo = Duo::new(4);
    duo.queue(1, frames(2, 60));
    duo.run(2, NONE);
    assert_eq!(duo.sides[0].received(), frames(2, 60));
    duo.sides.reverse();
    duo.queue(0, frames(2, 60));
    // Not before the answers of the other role have arrived.
    assert_eq!((duo.step(NONE, NO_LIMIT), duo.run(3, NONE) > 0), (0, true));
    assert_eq!(duo.sides[1].received(), frames(2, 60));
    assert_eq!(duo.sides[1].endpoint.traffic().missed, 0);
    duo.sides[0] = Side::new(0x20, 4);
    duo.sides[0].ethernet.stream ^= 1;
    duo.run(10, NONE);
    duo.queue(0, frames(2, 60));
    duo.run(3, NONE);
    assert_eq!(duo.sides[1].received(), frames(2, 60));
}

// covers: AC-03, AC-06, FR-07, standby
#[test]
fn master_frames_per_period_are_limited_and_polls_are_rare_without_traffic() {
    let mut duo = Duo::new(3);
    assert_eq!(duo.run(100, NONE), 20, "one in 5 ms");
    duo.queue(0, frames(30, 1000));
    assert_eq!(duo.run(5, NONE), 15, "three per period");
    duo.run(10, NONE);
    assert_eq!(duo.sides[1].received().len(), 30);
    let polls = duo.run(50, NONE);
    assert!((48..=52).contains(&polls), "one per period while traffic may go on: {polls}");
    duo.run(100, NONE);
    assert_eq!(duo.run(100, NONE), 20);
}

// covers: AC-03, standby
#[test]
fn long_frames_of_both_sides_take_turns_with_one_master_frame_per_period() {
    let mut duo = Duo::new(1);
    duo.queue(0, frames(40, MAX_ETHERNET));
    duo.queue(1, frames(40, MAX_ETHERNET));
    duo.run(40, NONE);
    let received = duo.received().map(|frames| frames.len());
    assert!(received.iter().all(|count| (18..=21).contains(count)), "{received:?}");
}

// covers: AC-03, standby
#[test]
fn a_master_frame_that_fits_no_window_leaves_after_ten_milliseconds() {
    let mut duo = Duo::new(2);
    duo.queue(0, frames(1, MAX_ETHERNET));
    let steps = (0..).find(|_| duo.step(NONE, 300) > 0).expect("it leaves");
    assert!((100..=102).contains(&steps), "{steps} steps of 0.1 ms");
    duo.queue(0, frames(1, MAX_ETHERNET));
    assert!((0..300).all(|_| duo.step(NONE, 0) == 0), "without a window nothing leaves");
}

// covers: AC-04, REQ039, standby
#[test]
fn frames_that_are_too_long_or_too_many_are_refused_and_counted() {
    let mut duo = Duo::new(16);
    let endpoint = &mut duo.sides[0].endpoint;
    assert_eq!(endpoint.send(&[0; 13]), Err(NotQueued::Length { bytes: 13 }));
    assert_eq!(endpoint.send(&[0; MAX_ETHERNET + 1]), Err(NotQueued::Length { bytes: MAX_ETHERNET + 1 }));
    for _ in 0..ETHERNET_QUEUE {
        assert_eq!(endpoint.send(&[0; 14]), Ok(()));
    }
    assert_eq!((endpoint.send(&[0; 14]), endpoint.room()), (Err(NotQueued::Full), 0));
    let traffic = endpoint.traffic();
    assert_eq!((traffic.refused_length, traffic.refused_full), (2, 1));
    duo.run(20, NONE);
    duo.queue(0, frames(10, 60));
    duo.run(20, NONE);
    assert_eq!(duo.sides[1].received().len(), ETHERNET_QUEUE, "they were not taken");
    let traffic = duo.sides[1].endpoint.traffic();
    assert_eq!((traffic.received, traffic.overflowed, traffic.missed), (ETHERNET_QUEUE as u64, 10, 0));
}

// covers: AC-05, standby
#[test]
fn without_a_sign_for_a_second_nothing_is_kept_for_the_return_of_the_other_one() {
    for side in [0, 1] {
        let mut duo = Duo::new(4);
        duo.queue(side, frames(5, 60));
        let before = duo.now;
        for at in [900, 1_100] {
            duo.now = Instant(before.0 + at * MS);
            duo.sides[side].ethernet.poll(side == 0, duo.now);
            assert_eq!(duo.sides[side].endpoint.is_up(), at < 1_000);
        }
        assert_eq!(duo.sides[side].endpoint.send(&[0; 60]), Err(NotQueued::Down));
        assert_eq!(duo.sides[side].endpoint.traffic().dropped_down, 6);
        duo.run(10, NONE);
        assert!(duo.sides[side].endpoint.is_up() && duo.received().iter().all(Vec::is_empty));
    }
}

proptest! {
    // covers: 9.12, standby
    #[test]
    fn any_bytes_are_taken_and_filled_without_a_change_elsewhere(
        changes in proptest::collection::vec((0_usize..400, any::<u8>()), 0..6),
        cut in 0_usize..400,
    ) {
        let mut duo = Duo::new(1);
        duo.queue(0, frames(1, 60));
        duo.queue(1, frames(1, 60));
        let [active, inactive] = &mut duo.sides;
        let copies = active.send(Instant(duo.now.0 + MS), NO_LIMIT);
        let mut bytes = copies[0].1.clone();
        for (at, value) in changes {
            if let Some(byte) = bytes.get_mut(at) {
                *byte = value;
            }
        }
        bytes.truncate(cut.max(60));
        let before = bytes.clone();
        inactive.ethernet.fill(&mut bytes, duo.now);
        prop_assert_eq!(&before[..24.min(before.len())], &bytes[..24.min(bytes.len())]);
        active.ethernet.take_own(&bytes, duo.now);
        active.ethernet.take_foreign(&bytes, duo.now);
        prop_assert!(inactive.received().iter().chain(&active.received()).all(|it| it.len() <= MAX_ETHERNET));
    }
}
