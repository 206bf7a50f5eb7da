//! To which frame an answer belongs: late, double, corrupt and short ones.

use super::*;

#[test]
fn late_double_and_corrupt_copies_change_nothing() {
    let mut ring = Ring::new();
    let [mut old, _] = ring.send();
    ring.evaluate();
    let [mut main, redundant] = ring.send();
    process(&mut old, &[0, 1, 2], 0x70);
    assert_eq!(ring.receive(Link::Redundant, &old), Received::Late);
    // Command, Idx behind the first, length, M bit.
    for (at, bit) in [(16, 1), (32, 1), (37, 1), (22, 1), (23, 0x80), (52, 4), (67, 4)] {
        let mut wrong = main.clone();
        process(&mut wrong, &[0, 1, 2], 0x70);
        wrong[at] ^= bit;
        assert_eq!(ring.receive(Link::Redundant, &wrong), Received::Corrupt, "byte {at}");
    }
    assert_eq!(ring.receive(Link::Redundant, &main[..74]), Received::Corrupt);
    // The C bit is set by controllers.
    main[23] |= 0x40;
    process(&mut main, &[0, 1, 2], 0x10);
    assert_eq!(ring.receive(Link::Redundant, &main), Received::Taken);
    assert_eq!(ring.receive(Link::Redundant, &main), Received::Late);
    assert_eq!(ring.receive(Link::Main, &redundant), Received::Taken);
    assert_eq!(ring.evaluate().wkc, 6);
    assert_eq!(ring.inputs(), [0x10, 0x11, 0x12]);
    let counters = ring.exchange.counters();
    assert_eq!((counters.late, counters.corrupt), (2, 8));
}

#[test]
fn frames_of_more_than_256_flights_are_distinguished() {
    let mut ring = Ring::new();
    let [first, _] = ring.send();
    for _ in 0..256 {
        ring.evaluate();
        let [mut main, redundant] = ring.send();
        process(&mut main, &[0, 1, 2], 0x10);
        assert_eq!(ring.receive(Link::Redundant, &main), Received::Taken);
        assert_eq!(ring.receive(Link::Main, &redundant), Received::Taken);
    }
    let [now, _] = ring.send();
    assert_eq!(first[7].wrapping_add(1), now[7]);
    assert!([17, 32, 47, 62].iter().all(|at| (first[*at], now[*at]) == (0, 1)), "every Idx");
    let mut same_id = first.clone();
    same_id[7] = now[7];
    process(&mut same_id, &[0, 1, 2], 0x70);
    assert_eq!(ring.receive(Link::Redundant, &same_id), Received::Late);
}

#[test]
fn what_was_queued_and_never_sent_was_not_answered() {
    let mut ring = Ring::new();
    let [mut main, redundant] = ring.send();
    process(&mut main, &[0, 1, 2], 0x10);
    ring.receive(Link::Redundant, &main);
    ring.receive(Link::Main, &redundant);
    assert_eq!(ring.evaluate().state, DomainState::Complete);
    assert!(ring.exchange.queue(DOMAIN, ring.now));
    let status = ring.evaluate();
    assert_eq!((status.wkc, status.state), (0, DomainState::Zero));
}

// covers: domains
#[test]
fn a_datagram_that_is_short_does_not_hide_behind_one_that_is_over() {
    let mut ring = Ring::new();
    let [mut main, redundant] = ring.send();
    process(&mut main, &[0, 1, 2], 0x40);
    main[LWR_WKC_AT] += 1;
    main[LRD_WKC_AT] -= 1;
    ring.receive(Link::Redundant, &main);
    ring.receive(Link::Main, &redundant);
    let status = ring.evaluate();
    assert_eq!((status.wkc, status.expected, status.state), (6, 6, DomainState::Incomplete));
    assert_eq!(ring.freshness(), [Freshness::Never; 3]);
}
