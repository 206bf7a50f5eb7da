//! Frames that are sent again, and the end of the cycle before which they must be back.

use std::vec::Vec;

use super::*;
use crate::layout::RepeatRule;

const FLIGHT: Duration = Duration::from_micros(20);
/// More than the cycles after which the round trips of frames are known.
const LEARNING: u64 = 200;

/// Domains of one input byte each on one link, with these periods in milliseconds, that send lost frames again. The
/// round trips of their frames are known.
fn learned(periods: &[u64]) -> Ring {
    let spec = |(subdevice, period): (usize, &u64)| {
        let direction = Direction::Inputs;
        let areas = vec![AreaSpec { subdevice, sync_manager: 3, direction, length: 1 }];
        let period = Duration::from_millis(*period);
        DomainSpec { period, under_way: 1, lrw: true, areas, image: ImageOrder::Packed }
    };
    let specs: Vec<_> = periods.iter().enumerate().map(spec).collect();
    let layout = Layout::new(&specs, LinkSet::Single, false).unwrap();
    let board = Arc::new(Board::new(periods.len()));
    (0..periods.len()).for_each(|subdevice| board.set_taking_part(subdevice, true));
    let (producer, events) = queue(16);
    let identity = Identity::new(MacCodec::FlagsFirst, MacAddress([0, 1, 2, 3, 4, 5]), None);
    let mut exchange = Exchange::new(identity, LinkSet::Single, &layout, board.clone(), producer);
    exchange.send_lost_frames_again(&layout, &vec![RepeatRule::default(); periods.len()], |_| true);
    let mut ring = Ring { exchange, board, events, now: Instant(0) };
    for _ in 0..LEARNING {
        let frames = ring.leave(periods.len(), PERIOD);
        ring.now += FLIGHT;
        for frame in frames {
            let now = ring.now;
            assert_eq!(ring.exchange.receive_and_follow(Link::Main, &answered(frame), now), Received::Taken);
        }
        ring.now += PERIOD - FLIGHT;
    }
    assert!(ring.exchange.waits_for_ns().is_some_and(|wait| wait < 2 * FLIGHT.as_nanos() as u64));
    assert_eq!(ring.exchange.counters().sent_again, 0);
    ring
}

/// The frame as the SubDevices return it.
fn answered(mut frame: Vec<u8>) -> Vec<u8> {
    frame[6] |= 0x02;
    let mut at = 16;
    loop {
        let length = u16::from_le_bytes([frame[at + 6], frame[at + 7]]);
        frame[at + 10 + usize::from(length & 0x7FF)] += 1;
        if length & 0x8000 == 0 {
            return frame;
        }
        at += 12 + usize::from(length & 0x7FF);
    }
}

impl Ring {
    /// Evaluates, queues and sends all domains; the next send is expected after that time.
    fn leave(&mut self, domains: usize, next: Duration) -> Vec<Vec<u8>> {
        for domain in (0..domains).map(DomainId) {
            self.exchange.process(domain, self.now);
            self.exchange.queue(domain, self.now);
        }
        let mut frames = vec![];
        self.exchange.send(self.now, &mut |_, bytes| frames.push(bytes.to_vec()));
        self.exchange.expect_next(self.now + next);
        self.exchange.follow_departures(self.now);
        frames
    }

    /// Loses all frames of a cycle; how many are sent again before the next send, which is expected after that time.
    fn lose(&mut self, domains: usize, next: Duration) -> u64 {
        let before = self.exchange.counters().sent_again;
        self.leave(domains, next);
        let end = self.now + PERIOD;
        while self.exchange.decide_at() < end {
            let at = self.exchange.decide_at().max(self.now);
            self.exchange.decide(at, at, &mut |_, _| ());
            self.now = at + Duration::from_nanos(1);
        }
        self.now = end;
        self.exchange.counters().sent_again - before
    }
}

// covers: lost-frames
#[test]
fn a_domain_without_a_period_is_sent_again_if_it_is_back_before_the_next_send() {
    // One wait of 32.5 us or two, and another round trip.
    for (next_us, tries) in [(40, 0), (60, 1), (90, 2)] {
        let mut ring = learned(&[0]);
        assert_eq!(ring.lose(1, Duration::from_micros(next_us)), tries, "next send after {next_us} us");
    }
}

// covers: lost-frames
#[test]
fn a_domain_without_a_period_does_not_change_the_end_of_cycles_of_others() {
    // The next cycle begins early, as with a trigger or a loop that was late: neither frame can be back.
    for periods in [&[1][..], &[1, 0], &[0, 1], &[4, 0, 1]] {
        let mut ring = learned(periods);
        let of_long = periods.iter().filter(|period| **period > 1).count() as u64;
        let tries = ring.lose(periods.len(), Duration::from_micros(40));
        assert!((of_long == 0) == (tries == 0), "{periods:?}: {tries}");
    }
}
