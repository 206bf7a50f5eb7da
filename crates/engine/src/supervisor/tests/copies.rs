//! Both copies of a frame: lost, late, in an open ring, with other contents.

use super::*;

// covers: SM-04, ring-merge
#[test]
fn a_lost_frame_is_repeated_nine_times_with_the_retry_index() {
    let mut bench = Bench::new(LinkSet::Single);
    let bus = bench.supervisor.bus();
    let result = bench.start(async move { bus.fprd(STATION, map::AL_STATUS, 2).await });
    for retry in 0..=9 {
        bench.step();
        assert_eq!(bench.sent.len(), 1, "try {retry}");
        // protocol SM-04: bits 6:4 of the first byte of the source address, saturated.
        assert_eq!(bench.sent[0].1[6], retry.min(7) << 4);
        bench.pass(Duration::from_millis(20));
    }
    bench.step();
    assert!(bench.sent.is_empty());
    let error = result.borrow().clone().unwrap().unwrap_err();
    assert!(matches!(error, BusError::Lost { retries: 9, .. }), "{error}");
    let counters = bench.supervisor.counters();
    assert_eq!((counters.lost, counters.resent, counters.timed_out), (10, 9, 1));
}

/// Sends two frames with a read each, 150 us apart, and returns the second one after 100 us, at most on these links.
/// One round trip of 100 us is known. Returns what the next step sends.
fn overtaken(links: LinkSet, returned: &[Link], resend: bool) -> Vec<(Link, Vec<u8>)> {
    let mut bench = Bench::new(links);
    let read = |bench: &mut Bench, resend: bool| {
        let (bus, target) = (bench.supervisor.bus(), Target::Station(STATION, map::AL_STATUS));
        bench.start(async move {
            match resend {
                true => bus.transfer(Command::Fprd, target, vec![0; 2], Some(Wkc(1))).await.map(drop),
                false => bus.transfer_once(Command::Fprd, target, vec![0; 2]).await.map(drop),
            }
        });
        bench.step();
        bench.sent.clone()
    };
    let copies = read(&mut bench, true);
    bench.pass(Duration::from_micros(100));
    for (link, frame) in &copies {
        bench.supervisor.receive(*link, &answered(frame, 1, 0), bench.now);
    }
    read(&mut bench, resend);
    bench.pass(Duration::from_micros(150));
    let copies = read(&mut bench, true);
    bench.pass(Duration::from_micros(100));
    for (link, frame) in copies.iter().filter(|(link, _)| returned.contains(link)) {
        bench.supervisor.receive(*link, &answered(frame, 1, 0), bench.now);
    }
    bench.step();
    bench.sent
}

// covers: SM-04, ring-merge
#[test]
fn a_frame_is_lost_when_later_frames_have_come_back_on_all_its_ways() {
    assert_eq!(overtaken(LinkSet::Single, &[Link::Main], true).len(), 1, "the first is sent again");
    assert_eq!(overtaken(LinkSet::Single, &[], true).len(), 0);
    assert_eq!(overtaken(LinkSet::Single, &[Link::Main], false).len(), 0, "it must not be repeated");
    assert_eq!(overtaken(LinkSet::Ring, &Link::ALL, true).len(), 2);
    assert_eq!(overtaken(LinkSet::Ring, &[Link::Main], true).len(), 0, "a copy on the other way may return");
}

#[test]
fn a_datagram_that_must_not_be_repeated_is_sent_once() {
    let mut bench = Bench::new(LinkSet::Single);
    let bus = bench.supervisor.bus();
    let target = ringcat_wire::datagram::Target::Station(STATION, RegisterAddress(0x1000));
    let result = bench.start(async move { bus.transfer_once(Command::Fprd, target, vec![0; 4]).await });
    bench.step();
    bench.pass(Duration::from_millis(20));
    bench.step();
    assert!(bench.sent.is_empty());
    assert!(matches!(*result.borrow(), Some(Err(BusError::Lost { retries: 0, .. }))));
}

// covers: ring-merge
#[test]
fn an_answer_that_comes_after_the_retry_is_late() {
    let mut bench = Bench::new(LinkSet::Single);
    let bus = bench.supervisor.bus();
    let result = bench.start(async move { bus.fprd(STATION, map::AL_STATUS, 2).await });
    bench.step();
    let first = answered(&bench.sent[0].1, 1, 0xAA);
    bench.pass(Duration::from_millis(20));
    bench.step();
    assert_eq!(bench.supervisor.receive(Link::Main, &first, bench.now), Received::Late);
    let second = answered(&bench.sent[0].1, 1, 0x55);
    bench.supervisor.receive(Link::Main, &second, bench.now);
    bench.step();
    assert_eq!(*result.borrow(), Some(Ok(vec![0x55, 0x55])));
}

#[test]
fn copies_have_the_same_id_and_the_redundant_copy_has_its_bit() {
    // protocol CR-01, CR-24, SM-02.
    let mut bench = Bench::new(LinkSet::Ring);
    let bus = bench.supervisor.bus();
    bench.start(async move { bus.brd(map::TYPE, 1).await });
    bench.step();
    let (main, redundant) = (&bench.sent[0], &bench.sent[1]);
    assert_eq!((main.0, redundant.0), (Link::Main, Link::Redundant));
    assert_eq!(redundant.1[6], main.1[6] | 0x08);
    assert_eq!(main.1[7..], redundant.1[7..]);
}

#[test]
fn in_an_open_ring_working_counters_are_added_and_reads_are_ored() {
    let mut bench = Bench::new(LinkSet::Ring);
    let bus = bench.supervisor.bus();
    let result = bench.start(async move { bus.brd(map::AL_STATUS, 2).await });
    bench.step();
    let main = answered(&bench.sent[0].1, 3, 0x04);
    let redundant = answered(&bench.sent[1].1, 5, 0x08);
    bench.supervisor.receive(Link::Redundant, &redundant, bench.now);
    bench.step();
    assert!(result.borrow().is_none(), "one copy of a broadcast is not enough");
    bench.supervisor.receive(Link::Main, &main, bench.now);
    bench.step();
    let reply = result.borrow().clone().unwrap().unwrap();
    assert_eq!((reply.main, reply.redundant, reply.wkc()), (Wkc(3), Wkc(5), Wkc(8)));
    assert_eq!(reply.data, vec![0x0C, 0x0C]);
    assert_eq!(bench.supervisor.ring(), RingState::Open);
}

// covers: CR-09, CR-10, ring-merge
#[test]
fn positions_behind_the_break_are_shifted_on_the_redundant_copy() {
    // protocol CR-09: three SubDevices on the main link, so position 4 is position 1 on the redundant link: ADP -4 + 3
    // = -1.
    let mut bench = Bench::new(LinkSet::Ring);
    let bus = bench.supervisor.bus();
    bench.start(async move {
        bus.brd(map::TYPE, 1).await.unwrap();
        bus.aprd(Position(4), map::STATION_ADDRESS, 2).await
    });
    bench.step();
    let copies = bench.sent.clone();
    for (link, frame) in copies {
        let count = if link == Link::Main { 3 } else { 5 };
        bench.supervisor.receive(link, &answered(&frame, count, 0), bench.now);
    }
    bench.step();
    let adp = |frame: &[u8]| Frame::parse(frame).unwrap().datagrams().next().unwrap().header.adp();
    assert_eq!(adp(&bench.sent[0].1), 0u16.wrapping_sub(4));
    assert_eq!(adp(&bench.sent[1].1), 0u16.wrapping_sub(1));
}

// covers: CR-06, ring-merge
#[test]
fn one_copy_with_the_expected_working_counter_is_enough() {
    // protocol CR-06.
    let mut bench = Bench::new(LinkSet::Ring);
    let bus = bench.supervisor.bus();
    let result = bench.start(async move { bus.fprd(STATION, map::AL_STATUS, 2).await });
    bench.step();
    let main = answered(&bench.sent[0].1, 1, 0x08);
    bench.supervisor.receive(Link::Redundant, &main, bench.now);
    bench.step();
    assert_eq!(*result.borrow(), Some(Ok(vec![0x08, 0x08])));
    assert_eq!(bench.supervisor.ring(), RingState::Unknown, "a missing copy proves nothing");
}

#[test]
fn a_copy_with_working_counter_0_does_not_replace_the_missing_copy() {
    let mut bench = Bench::new(LinkSet::Ring);
    let bus = bench.supervisor.bus();
    let result = bench.start(async move { bus.fprd(STATION, map::AL_STATUS, 2).await });
    bench.step();
    let redundant = answered(&bench.sent[1].1, 0, 0);
    bench.supervisor.receive(Link::Main, &redundant, bench.now);
    bench.pass(Duration::from_millis(20));
    bench.step();
    assert!(result.borrow().is_none());
    assert_eq!(bench.sent.len(), 2, "sent again on both links");
}

#[test]
fn a_frame_with_other_datagrams_than_sent_is_corrupt() {
    let mut bench = Bench::new(LinkSet::Single);
    let bus = bench.supervisor.bus();
    bench.start(async move { bus.fprd(STATION, map::AL_STATUS, 2).await });
    bench.step();
    let mut answer = answered(&bench.sent[0].1, 1, 0x08);
    answer[22] = 1; // length of the datagram
    assert_eq!(bench.supervisor.receive(Link::Main, &answer, bench.now), Received::Corrupt);
    assert_eq!(bench.supervisor.receive(Link::Main, &answer[..30], bench.now), Received::Corrupt);
}
