//! A cycle in its parts: any of them more than once, without the others, at any rate.

use std::vec;
use std::vec::Vec;

use super::*;

/// Frames that a send put on the main link.
fn sent(exchange: &mut Exchange, now: Instant) -> Vec<Vec<u8>> {
    let mut frames = vec![];
    exchange.send(now, &mut |link, bytes| {
        if link == Link::Main {
            frames.push(bytes.to_vec());
        }
    });
    frames
}

/// Offset of the supervision datagram: BRD of 0x0130.
fn supervision_at(frame: &[u8]) -> Option<usize> {
    let mut at = 16;
    loop {
        if frame[at] == 7 && frame[at + 4..at + 6] == [0x30, 0x01] {
            return Some(at);
        }
        let length = u16::from_le_bytes([frame[at + 6], frame[at + 7]]);
        if length & 0x8000 == 0 {
            return None;
        }
        at += 12 + usize::from(length & 0x7FF);
    }
}

fn supervises(frame: &[u8]) -> bool {
    supervision_at(frame).is_some()
}

/// The frame as one SubDevice on the only link returns it.
fn answered(mut frame: Vec<u8>) -> Vec<u8> {
    frame[6] |= 0x02;
    if let Some(at) = supervision_at(&frame) {
        frame[at + 10] |= 0x08;
        frame[at + 12] += 1;
    }
    frame
}

/// Domains of one input byte each on one link, with these periods in milliseconds.
fn domains(periods: &[u64], supervision: bool) -> Ring {
    let spec = |(subdevice, period): (usize, &u64)| {
        let direction = Direction::Inputs;
        let areas = vec![AreaSpec { subdevice, sync_manager: 3, direction, length: 1 }];
        let period = Duration::from_millis(*period);
        DomainSpec { period, under_way: 1, lrw: true, areas, image: ImageOrder::Packed }
    };
    let specs: Vec<_> = periods.iter().enumerate().map(spec).collect();
    let layout = Layout::new(&specs, LinkSet::Single, supervision).unwrap();
    let board = Arc::new(Board::new(periods.len()));
    (0..periods.len()).for_each(|subdevice| board.set_taking_part(subdevice, true));
    let (producer, events) = queue(16);
    let identity = Identity::new(MacCodec::FlagsFirst, MacAddress([0, 1, 2, 3, 4, 5]), None);
    let exchange = Exchange::new(identity, LinkSet::Single, &layout, board.clone(), producer);
    Ring { exchange, board, events, now: Instant(0) }
}

// covers: cycles
#[test]
fn a_send_without_a_queued_domain_supervises_in_a_frame_of_its_own() {
    let mut ring = domains(&[1], true);
    let frames = sent(&mut ring.exchange, ring.now);
    assert_eq!(frames.len(), 1);
    assert_eq!(supervision_at(&frames[0]), Some(16), "nothing is before it");
    assert!(sent(&mut ring.exchange, ring.now).is_empty(), "it is on the wire");
    assert_eq!(ring.receive(Link::Main, &answered(frames[0].clone())), Received::Taken);
    let (count, seen) = ring.board.supervision().unwrap();
    assert_eq!((count, seen.main, seen.al_status), (1, Wkc(1), [8, 0]));
    assert_eq!(sent(&mut ring.exchange, ring.now).len(), 1, "it is back");
    // It was lost: the next one leaves at its deadline.
    ring.now += PERIOD / 2;
    assert!(sent(&mut ring.exchange, ring.now).is_empty());
    ring.now += PERIOD / 2;
    assert_eq!(sent(&mut ring.exchange, ring.now).len(), 1);
    assert_eq!((ring.exchange.counters().lost, ring.exchange.counters().sent), (1, 3));
}

// covers: cycles
#[test]
fn no_frame_is_added_where_any_domain_leaves() {
    let mut ring = domains(&[1, 2, 4], true);
    for queued in [&[0, 1, 2][..], &[1], &[2, 1], &[0], &[0, 1], &[2], &[], &[1, 2], &[0, 1, 2]] {
        ring.now += 10 * PERIOD;
        queued.iter().for_each(|domain| assert!(ring.exchange.queue(DomainId(*domain), ring.now)));
        let frames = sent(&mut ring.exchange, ring.now);
        assert_eq!(frames.len(), queued.len().max(1), "{queued:?}");
        assert_eq!(frames.iter().filter(|frame| supervises(frame)).count(), 1, "{queued:?}");
        for frame in frames {
            let mut back = answered(frame);
            if queued.is_empty() {
                assert_eq!(ring.receive(Link::Main, &back), Received::Taken);
                continue;
            }
            // Data and working counter of the only process data datagram.
            (back[26], back[27]) = (0x40, 1);
            assert_eq!(ring.receive(Link::Main, &back), Received::Taken);
        }
        for domain in queued {
            let status = ring.exchange.process(DomainId(*domain), ring.now);
            assert_eq!((status.wkc, status.state), (1, DomainState::Complete), "{queued:?}, {domain}");
            assert_eq!(ring.exchange.image(DomainId(*domain)), [0x40]);
        }
    }
    assert_eq!((ring.exchange.counters().lost, ring.exchange.counters().late), (0, 0));
}

#[test]
fn without_supervision_a_send_without_a_queued_domain_sends_nothing() {
    let mut ring = domains(&[1], false);
    assert!(sent(&mut ring.exchange, ring.now).is_empty());
}

#[test]
fn while_the_home_domain_is_on_the_wire_nothing_else_supervises() {
    let mut ring = domains(&[1, 2], true);
    assert!(ring.exchange.queue(DomainId(0), ring.now));
    assert!(supervises(&sent(&mut ring.exchange, ring.now)[0]));
    assert!(!ring.exchange.queue(DomainId(0), ring.now), "it is on the wire");
    assert!(sent(&mut ring.exchange, ring.now).is_empty());
    assert!(ring.exchange.queue(DomainId(1), ring.now));
    let frames = sent(&mut ring.exchange, ring.now);
    assert_eq!((frames.len(), supervises(&frames[0])), (1, false));
}

// covers: cycles
#[test]
fn a_domain_that_is_processed_twice_keeps_its_result() {
    let mut ring = Ring::new();
    let [mut main, redundant] = ring.send();
    process(&mut main, &[0, 1, 2], 0x40);
    ring.receive(Link::Redundant, &main);
    ring.receive(Link::Main, &redundant);
    let first = ring.evaluate();
    assert_eq!((first, first.state), (ring.evaluate(), DomainState::Complete));
}

// covers: cycles
#[test]
fn outputs_of_a_domain_queued_twice_are_those_of_the_second_time() {
    let mut ring = Ring::new();
    ring.exchange.image_mut(DOMAIN)[0] = 1;
    assert!(ring.exchange.queue(DOMAIN, ring.now));
    ring.exchange.image_mut(DOMAIN)[0] = 2;
    let [main, _] = ring.send();
    assert_eq!(main[OUTPUTS_AT], 2);
}

#[test]
fn the_cyclic_half_may_move_to_another_thread() {
    fn moves<T: Send>(_: &T) {}
    let mut ring = Ring::new();
    moves(&ring.exchange);
    let [mut main, redundant] = ring.send();
    process(&mut main, &[0, 1, 2], 0x40);
    let mut ring = std::thread::spawn(move || {
        ring.receive(Link::Redundant, &main);
        ring.receive(Link::Main, &redundant);
        ring
    })
    .join()
    .unwrap();
    assert_eq!(ring.evaluate().state, DomainState::Complete);
}
