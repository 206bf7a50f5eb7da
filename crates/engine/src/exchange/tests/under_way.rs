//! Several cycles on the wire: flights that come back in any order or not at all.

use proptest::collection::vec as list;
use proptest::prelude::*;

use super::*;

const ALL: [usize; 3] = [0, 1, 2];

fn with_under_way(cycles: u8) -> Ring {
    Ring::with(vec![], cycles)
}

/// The copies of a flight as they come back through a closed ring.
fn closed([mut main, redundant]: [Vec<u8>; 2], base: u8) -> [(Link, Vec<u8>); 2] {
    process(&mut main, &ALL, base);
    [(Link::Redundant, main), (Link::Main, redundant)]
}

/// As they come back where the first of the SubDevices are on the main side of a break.
fn cut([mut main, mut redundant]: [Vec<u8>; 2], before: usize, base: u8) -> [(Link, Vec<u8>); 2] {
    process(&mut main, &ALL[..before], base);
    process(&mut redundant, &ALL[before..], base);
    [(Link::Main, main), (Link::Redundant, redundant)]
}

#[test]
fn a_domain_is_skipped_only_when_all_its_cycles_are_under_way() {
    for cycles in 1..=4 {
        let mut ring = with_under_way(cycles);
        for _ in 0..cycles {
            assert!(!ring.exchange.is_full());
            ring.send();
            ring.now += PERIOD / 8;
        }
        assert!(ring.exchange.is_full() && !ring.exchange.queue(DOMAIN, ring.now));
        let status = ring.exchange.process(DOMAIN, ring.now);
        assert_eq!((status.skipped, status.pending), (1, true));
        assert_eq!(ring.exchange.counters().skipped, 1);
    }
}

#[test]
fn inputs_of_an_older_cycle_never_overwrite_those_of_a_newer_one() {
    let mut ring = with_under_way(2);
    let older = ring.send();
    ring.now += PERIOD;
    let newer = ring.send();
    for copies in [closed(newer, 0x20), closed(older, 0x10)] {
        for (link, bytes) in copies {
            assert_eq!(ring.receive(link, &bytes), Received::Taken);
        }
        assert_eq!(ring.inputs(), [0x20, 0x21, 0x22]);
    }
    let status = ring.exchange.process(DOMAIN, ring.now);
    assert_eq!((status.state, status.pending), (DomainState::Complete, false));
    assert_eq!(ring.freshness(), [Freshness::Fresh; 3]);
    let counters = ring.exchange.counters();
    assert_eq!((counters.overtaken, counters.received, counters.lost, counters.incomplete), (1, 2, 0, 0));
}

// covers: under-way
#[test]
fn a_lost_cycle_is_given_up_when_a_newer_one_is_back_and_is_counted_once() {
    let mut ring = with_under_way(3);
    let lost = ring.send();
    ring.now += PERIOD;
    let early = ring.exchange.process(DOMAIN, ring.now);
    assert!(early.pending && early.state == DomainState::Zero);
    let newer = ring.send();
    for (link, bytes) in closed(newer, 0x20) {
        ring.receive(link, &bytes);
    }
    let status = ring.exchange.process(DOMAIN, ring.now);
    assert_eq!((status.state, status.pending), (DomainState::Complete, false));
    for (link, bytes) in closed(lost, 0x10) {
        assert_eq!(ring.receive(link, &bytes), Received::Late);
    }
    assert_eq!(ring.inputs(), [0x20, 0x21, 0x22]);
    let counters = ring.exchange.counters();
    assert_eq!((counters.lost, counters.incomplete, counters.received, counters.late), (1, 1, 1, 2));
}

#[test]
fn a_lost_cycle_makes_inputs_stale_though_an_older_one_came_at_the_same_time() {
    let mut ring = with_under_way(2);
    let came = ring.send();
    ring.now += PERIOD;
    ring.send();
    for (link, bytes) in closed(came, 0x10) {
        ring.receive(link, &bytes);
    }
    ring.now += 2 * PERIOD;
    let status = ring.exchange.process(DOMAIN, ring.now);
    assert_eq!((status.state, ring.inputs()), (DomainState::Zero, &[0x10, 0x11, 0x12][..]));
    assert_eq!(ring.freshness(), [Freshness::Stale { cycles: 1 }; 3]);
}

#[test]
fn a_cycle_is_waited_for_until_shortly_before_its_turn_comes_again() {
    for cycles in 1..=4 {
        let mut ring = with_under_way(cycles);
        ring.send();
        let deadline = ring.now + PERIOD * u32::from(cycles) - Instant(0);
        let deadline = Instant(0) + (deadline - PERIOD / 4);
        assert!(ring.exchange.process(DOMAIN, Instant(deadline.0 - 1)).pending);
        assert!(!ring.exchange.process(DOMAIN, deadline).pending);
    }
}

// covers: 9.2.1, under-way
#[test]
fn what_an_older_cycle_shows_of_the_ring_does_not_count_after_a_newer_one() {
    let mut ring = with_under_way(2);
    let older = ring.send();
    ring.now += PERIOD;
    let newer = ring.send();
    for (link, bytes) in cut(newer, 1, 0x20).into_iter().chain(closed(older, 0x10)) {
        assert_eq!(ring.receive(link, &bytes), Received::Taken);
    }
    assert_eq!(ring.exchange.ring(), RingState::Open);
    let (count, seen) = ring.board.supervision().unwrap();
    assert_eq!((count, seen.main, seen.redundant), (1, Wkc(1), Wkc(2)));
}

/// Fate of a flight.
#[derive(Clone, Copy, Debug)]
enum Way {
    Closed,
    Cut(usize),
    Without(usize),
}

fn way() -> impl Strategy<Value = Way> {
    prop_oneof![3 => Just(Way::Closed), 2 => (0..=3usize).prop_map(Way::Cut), 1 => (0..3usize).prop_map(Way::Without)]
}

/// A flight in the model.
#[derive(Debug)]
struct Flight {
    base: u8,
    way: Way,
    /// Copies received so far.
    taken: usize,
    complete: bool,
}

impl Flight {
    /// Notes a copy that was received.
    fn take(&mut self, bytes: &[u8]) {
        self.taken += 1;
        self.complete = match self.way {
            Way::Closed | Way::Cut(0 | 3) => self.complete || bytes[LRD_WKC_AT] == 3,
            Way::Cut(_) => self.taken == 2,
            Way::Without(_) => false,
        };
    }
}

/// A copy on the wire: the number of its flight, the link of its arrival, the number of SubDevices that processed it.
struct Copy {
    flight: usize,
    link: Link,
    bytes: Vec<u8>,
}

proptest! {
    // covers: under-way
    #[test]
    fn inputs_are_those_of_the_newest_copy_that_a_subdevice_processed(
        cycles in 1u8..=4,
        steps in list((way(), any::<[bool; 2]>(), any::<bool>(), list(any::<usize>(), 0..6), 1u32..12), 1..60),
    ) {
        let mut ring = with_under_way(cycles);
        let (mut flights, mut copies): (Vec<Flight>, Vec<Copy>) = (vec![], vec![]);
        let mut newest: [Option<usize>; 3] = [None; 3];
        for (way, lost, may_lose, picks, eighths) in steps {
            for pick in picks {
                if copies.is_empty() {
                    break;
                }
                let Copy { flight, link, bytes } = copies.swap_remove(pick % copies.len());
                if ring.receive(link, &bytes) == Received::Taken {
                    flights[flight].take(&bytes);
                    for (subdevice, newest) in newest.iter_mut().enumerate() {
                        if bytes[PRESENCE_AT + subdevice] != 0 {
                            *newest = (*newest).max(Some(flight));
                        }
                    }
                }
                let value = |at: usize| newest[at].map_or(0, |number| flights[number].base + at as u8);
                prop_assert_eq!(ring.inputs(), [0, 1, 2].map(value), "flights {:?} of {:?}", newest, flights);
            }
            ring.now += PERIOD * eighths / 8;
            ring.exchange.process(DOMAIN, ring.now);
            if !ring.exchange.queue(DOMAIN, ring.now) {
                continue;
            }
            let sent = ring.send();
            let base = (flights.len() * 3 + 1) as u8;
            let back = match way {
                Way::Closed => closed(sent, base),
                Way::Cut(before) => cut(sent, before, base),
                Way::Without(missing) => {
                    let [mut main, redundant] = sent;
                    process(&mut main, &[(missing + 1) % 3, (missing + 2) % 3], base);
                    [(Link::Redundant, main), (Link::Main, redundant)]
                }
            };
            let flight = flights.len();
            flights.push(Flight { base, way, taken: 0, complete: false });
            let there = back.into_iter().zip(lost).filter(|(_, lost)| !(may_lose && *lost));
            copies.extend(there.map(|((link, bytes), _)| Copy { flight, link, bytes }));
        }
        // Each cycle was evaluated once.
        ring.now += 10 * PERIOD;
        ring.exchange.process(DOMAIN, ring.now);
        let count = |wanted: &dyn Fn(&Flight) -> bool| flights.iter().filter(|flight| wanted(flight)).count() as u64;
        let counters = ring.exchange.counters();
        prop_assert_eq!(counters.incomplete, count(&|flight| !flight.complete));
        prop_assert_eq!(counters.lost, count(&|flight| flight.taken == 0));
        prop_assert_eq!(counters.half, count(&|flight| flight.taken == 1 && !flight.complete));
        prop_assert_eq!(counters.received, count(&|flight| flight.taken == 2));
        prop_assert!(!ring.exchange.in_flight() && !ring.exchange.is_full());
    }
}
