//! Tests of the acyclic half with prepared answers: packing, pairing, retries, time limits, timers.

use alloc::rc::Rc;
use alloc::vec;
use alloc::vec::Vec;
use core::cell::{Cell, RefCell};
use core::time::Duration;

use proptest::prelude::*;
use ringcat_wire::address::{Position, RegisterAddress, StationAddress, Wkc};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::{HEADER_LEN, Target};
use ringcat_wire::frame::{Frame, MacAddress};
use ringcat_wire::register::map;
use ringcat_wire::source_address::MacCodec;

use super::*;

const MAIN: MacAddress = MacAddress([0, 0, 0x5E, 0, 0x53, 1]);
const REDUNDANT: MacAddress = MacAddress([0, 0, 0x5E, 0, 0x53, 2]);
const STATION: StationAddress = StationAddress(0x1001);

struct Bench {
    supervisor: Supervisor,
    now: Instant,
    sent: Vec<(Link, Vec<u8>)>,
}

impl Bench {
    fn new(links: LinkSet) -> Bench {
        let identity = Identity::new(MacCodec::FlagsFirst, MAIN, Some(REDUNDANT));
        Bench { supervisor: Supervisor::new(identity, links, Instant(0)), now: Instant(0), sent: Vec::new() }
    }

    /// Polls and sends; the frames sent are in `sent`.
    fn step(&mut self) {
        self.supervisor.poll(self.now);
        let sent = &mut self.sent;
        sent.clear();
        self.supervisor.transmit(self.now, usize::MAX, &mut |link, frame| sent.push((link, frame.to_vec())));
    }

    fn pass(&mut self, time: Duration) {
        self.now += time;
    }

    fn start<T: 'static>(&mut self, procedure: impl Future<Output = T> + 'static) -> Rc<RefCell<Option<T>>> {
        let result = Rc::new(RefCell::new(None));
        let slot = result.clone();
        self.supervisor.spawn(async move {
            let value = procedure.await;
            *slot.borrow_mut() = Some(value);
        });
        result
    }
}

// covers: stop
#[test]
fn nothing_remains_of_a_supervisor_that_ends_before_its_procedures_begin() {
    for polls in 0..3 {
        let mut bench = Bench::new(LinkSet::Single);
        let (held, bus) = (Rc::new(()), bench.supervisor.bus());
        let (inner, outer) = (held.clone(), bus.clone());
        bench.start(async move {
            let (of_task, in_task) = (inner.clone(), outer.clone());
            outer.spawn(async move {
                in_task.sleep(Duration::from_secs(1)).await;
                drop(of_task);
            });
            outer.sleep(Duration::from_secs(1)).await;
            drop(inner);
        });
        drop(bus);
        (0..polls).for_each(|_| bench.step());
        drop(bench);
        assert_eq!(Rc::strong_count(&held), 1, "after {polls} polls");
    }
}

/// A copy that came back with this working counter in every datagram, and this data in the reads.
fn answered(frame: &[u8], wkc: u16, fill: u8) -> Vec<u8> {
    let mut frame = frame.to_vec();
    let places: Vec<(usize, usize, bool)> = {
        let parsed = Frame::parse(&frame).unwrap();
        let mut at = parsed.payload_offset();
        let datagram = |d: ringcat_wire::datagram::Datagram<'_>| {
            let data = at + HEADER_LEN;
            at = data + d.data.len() + 2;
            (data, d.data.len(), d.header.command.reads())
        };
        parsed.datagrams().map(datagram).collect()
    };
    for (data, length, reads) in places {
        if reads && wkc > 0 {
            frame[data..data + length].fill(fill);
        }
        frame[data + length..data + length + 2].copy_from_slice(&wkc.to_le_bytes());
    }
    frame[6] |= 0x02;
    frame
}

#[test]
fn requests_of_many_procedures_share_a_frame() {
    let mut bench = Bench::new(LinkSet::Single);
    for station in 0..50 {
        let bus = bench.supervisor.bus();
        bench.start(async move { bus.fprd(StationAddress(station), map::AL_STATUS, 2).await });
    }
    bench.step();
    assert_eq!(bench.sent.len(), 1);
    assert_eq!(Frame::parse(&bench.sent[0].1).unwrap().datagrams().count(), 50);
}

#[test]
fn a_reply_reaches_the_procedure_that_waits_for_it() {
    let mut bench = Bench::new(LinkSet::Single);
    let bus = bench.supervisor.bus();
    let result = bench.start(async move { bus.fprd(STATION, map::AL_STATUS, 2).await });
    bench.step();
    let answer = answered(&bench.sent[0].1, 1, 0x08);
    assert_eq!(bench.supervisor.receive(Link::Main, &answer, bench.now), Received::Taken);
    assert_eq!(bench.supervisor.receive(Link::Main, &answer, bench.now), Received::Late);
    bench.step();
    assert_eq!(*result.borrow(), Some(Ok(vec![0x08, 0x08])));
}

#[test]
fn answered_frames_do_not_wait_for_copies_on_a_silent_link() {
    let mut bench = Bench::new(LinkSet::Ring);
    let mut answered_on_main = |requests: usize, length: usize| {
        for _ in 0..requests {
            let bus = bench.supervisor.bus();
            bench.start(async move { bus.fprd(STATION, RegisterAddress(0x1000), length).await });
        }
        let mut answers = 0;
        loop {
            bench.step();
            if bench.sent.is_empty() {
                bench.pass(Duration::from_millis(1));
                return answers;
            }
            for (_, frame) in bench.sent.iter().filter(|(link, _)| *link == Link::Main) {
                answers += 1;
                bench.supervisor.receive(Link::Main, &answered(frame, 0, 0), bench.now);
            }
        }
    };
    for _ in 0..100 {
        answered_on_main(1, 2);
    }
    assert_eq!(answered_on_main(60, 1400), 60, "without a pause");
}

#[test]
fn a_working_counter_of_0_is_an_error_that_names_station_and_register() {
    let mut bench = Bench::new(LinkSet::Single);
    let bus = bench.supervisor.bus();
    let result = bench.start(async move { bus.fprd(STATION, map::AL_STATUS, 2).await });
    bench.step();
    let answer = answered(&bench.sent[0].1, 0, 0);
    bench.supervisor.receive(Link::Main, &answer, bench.now);
    bench.step();
    let error = result.borrow().clone().unwrap().unwrap_err();
    assert_eq!(
        alloc::string::ToString::to_string(&error),
        "station 0x1001, register 0x0130: expected working counter 1, got 0"
    );
}

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

#[test]
fn the_answer_to_an_abandoned_request_does_not_reach_another_request() {
    let mut bench = Bench::new(LinkSet::Single);
    let bus = bench.supervisor.bus();
    let result = bench.start(async move {
        let slow = bus.fprd(STATION, map::AL_STATUS, 2);
        let gave_up = bus.within(Duration::from_millis(1), slow).await.is_err();
        (gave_up, bus.fprd(STATION, map::DL_STATUS, 2).await)
    });
    bench.step();
    let first = answered(&bench.sent[0].1, 1, 0xAA);
    bench.pass(Duration::from_millis(1));
    bench.step();
    let second = answered(&bench.sent[0].1, 1, 0x55);
    bench.supervisor.receive(Link::Main, &first, bench.now);
    bench.supervisor.receive(Link::Main, &second, bench.now);
    bench.step();
    assert_eq!(*result.borrow(), Some((true, Ok(vec![0x55, 0x55]))));
}

#[test]
fn a_request_abandoned_before_it_was_sent_is_never_sent() {
    let mut bench = Bench::new(LinkSet::Single);
    let bus = bench.supervisor.bus();
    bench.start(async move {
        let never = bus.fprd(STATION, map::AL_STATUS, 2);
        bus.within(Duration::ZERO, never).await.is_err()
    });
    bench.step();
    assert!(bench.sent.is_empty());
}

// covers: byte-budget
#[test]
fn the_budget_counts_the_padding_of_a_short_frame() {
    let mut bench = Bench::new(LinkSet::Single);
    let bus = bench.supervisor.bus();
    bench.start(async move { bus.fprd(STATION, map::AL_STATUS, 2).await });
    bench.supervisor.poll(bench.now);
    let mut sizes = Vec::new();
    bench.supervisor.transmit(bench.now, 59, &mut |_, frame| sizes.push(frame.len()));
    assert_eq!(sizes, []);
    bench.supervisor.transmit(bench.now, 60, &mut |_, frame| sizes.push(frame.len()));
    assert_eq!(sizes, [60]);
}

#[test]
fn the_byte_budget_and_the_window_are_kept() {
    let mut bench = Bench::new(LinkSet::Single);
    let bus = bench.supervisor.bus();
    bench.supervisor.spawn(async move {
        let read = |bus: Bus, n| async move { bus.fprd(StationAddress(n), map::PROCESS_RAM, 1000).await };
        bus.gather(0..200u16, read).await;
    });
    bench.supervisor.poll(bench.now);
    let mut sizes = Vec::new();
    bench.supervisor.transmit(bench.now, 2500, &mut |_, frame| sizes.push(frame.len()));
    assert_eq!(sizes, vec![1028, 1028]);
    bench.supervisor.transmit(bench.now, usize::MAX, &mut |_, frame| sizes.push(frame.len()));
    assert_eq!(sizes.len(), 32);
}

#[test]
fn a_datagram_too_long_for_every_window_is_sent_after_10_ms() {
    let mut bench = Bench::new(LinkSet::Single);
    let bus = bench.supervisor.bus();
    bench.start(async move { bus.fprd(STATION, map::PROCESS_RAM, 1000).await });
    bench.supervisor.poll(bench.now);
    let mut sent = 0;
    for _ in 0..10 {
        bench.supervisor.transmit(bench.now, 500, &mut |_, _| sent += 1);
        assert_eq!(sent, 0);
        bench.pass(Duration::from_millis(1));
    }
    bench.supervisor.transmit(bench.now, 500, &mut |_, _| sent += 1);
    assert_eq!(sent, 1);
}

#[test]
fn a_datagram_longer_than_a_frame_fails_at_once() {
    let mut bench = Bench::new(LinkSet::Single);
    let bus = bench.supervisor.bus();
    let result = bench.start(async move { bus.fprd(STATION, map::PROCESS_RAM, 1487).await });
    bench.step();
    bench.step();
    assert!(bench.sent.is_empty());
    assert!(matches!(*result.borrow(), Some(Err(BusError::TooLong { length: 1487, .. }))));
}

#[test]
fn timers_fire_in_order_and_a_group_wakes_its_waiter_once() {
    let mut bench = Bench::new(LinkSet::Single);
    let bus = bench.supervisor.bus();
    let woken = Rc::new(Cell::new(0));
    let counter = woken.clone();
    let result = bench.start(async move {
        let order = bus.gather([3u64, 1, 2], |bus, ms| async move {
            bus.sleep(Duration::from_millis(ms)).await;
            (ms, bus.now().0 / 1_000_000)
        });
        let order = order.await;
        counter.set(counter.get() + 1);
        order
    });
    assert_eq!(bench.supervisor.next_deadline(), Some(Instant(0)));
    bench.step();
    for ms in 1..=3 {
        assert_eq!(bench.supervisor.next_deadline(), Some(Instant(ms * 1_000_000)));
        bench.pass(Duration::from_millis(1));
        bench.step();
    }
    assert_eq!(*result.borrow(), Some(vec![(3, 3), (1, 1), (2, 2)]));
    assert_eq!(woken.get(), 1);
    assert_eq!(bench.supervisor.next_deadline(), None);
}

#[test]
fn work_that_comes_between_two_questions_is_due_at_once() {
    const MS: u64 = 1_000_000;
    let mut bench = Bench::new(LinkSet::Single);
    let (board, bell) = (Arc::new(Board::new(1)), Bell::default());
    bench.supervisor.attach(board.clone());
    bench.supervisor.attach_bell(bell.clone());
    let (bus, signal) = (bench.supervisor.bus(), bench.supervisor.bus().signal());
    bench.start(async move {
        loop {
            bus.until_posted(bus.posted(), Instant(7 * MS), &signal, || false).await;
        }
    });
    let due = |bench: &Bench| [bench.supervisor.due_at(), bench.supervisor.due_at()];
    let idle = |bench: &mut Bench| {
        bench.step();
        assert_eq!(due(bench), [Instant(7 * MS); 2], "asked twice");
    };
    idle(&mut bench);
    // Words of other threads, and those of the links.
    bell.ring();
    assert_eq!(due(&bench), [bench.now; 2]);
    idle(&mut bench);
    board.post_supervision(1);
    assert_eq!(due(&bench), [bench.now; 2]);
    idle(&mut bench);
    bench.supervisor.set_carriers([Some(true), None]);
    assert_eq!(due(&bench), [bench.now; 2]);
    assert_eq!(board.live.carrier(Link::Main), Some(true));
    bench.supervisor.set_carriers([Some(true), None]);
    idle(&mut bench);
    // A new procedure, its timer, its datagram, the deadline of its frame.
    let bus = bench.supervisor.bus();
    bench.start(async move {
        bus.sleep(Duration::from_millis(1)).await;
        bus.fprd(STATION, map::AL_STATUS, 2).await
    });
    assert_eq!(due(&bench), [bench.now; 2]);
    bench.supervisor.poll(bench.now);
    assert_eq!(due(&bench), [Instant(MS); 2]);
    bench.pass(Duration::from_millis(1));
    bench.supervisor.poll(bench.now);
    assert_eq!(due(&bench), [Instant(0); 2], "a datagram does not wait for a time");
    bench.step();
    assert!(due(&bench)[0] > bench.now && due(&bench)[0] < Instant(7 * MS), "the frame has a deadline");
    let copy = answered(&bench.sent[0].1, 1, 8);
    bench.supervisor.receive(Link::Main, &copy, bench.now);
    assert_eq!(due(&bench), [bench.now; 2], "its reply");
    idle(&mut bench);
}

proptest! {
    #[test]
    fn any_bytes_may_arrive(
        frames in proptest::collection::vec((any::<bool>(), proptest::collection::vec(any::<u8>(), 0..120)), 0..20),
        mangle in any::<[u8; 8]>()
    ) {
        let mut bench = Bench::new(LinkSet::Ring);
        let bus = bench.supervisor.bus();
        bench.start(async move { bus.fprd(STATION, map::AL_STATUS, 2).await });
        bench.step();
        for (main, bytes) in frames {
            let link = if main { Link::Main } else { Link::Redundant };
            bench.supervisor.receive(link, &bytes, bench.now);
            // A frame of ours with random bytes changed.
            let mut own = bench.sent[0].1.clone();
            for (at, value) in bytes.iter().zip(mangle) {
                let at = usize::from(*at) % own.len();
                own[at] = value;
            }
            bench.supervisor.receive(link, &own, bench.now);
        }
        bench.pass(Duration::from_millis(20));
        bench.step();
    }
}

#[test]
fn an_abandoned_datagram_does_not_count_as_waiting_time_of_the_next() {
    let mut bench = Bench::new(LinkSet::Single);
    let request = |bench: &mut Bench| {
        let bus = bench.supervisor.bus();
        bench.start(async move {
            let long = bus.fprd(STATION, RegisterAddress(0x1000), 1_000);
            bus.within(Duration::from_millis(1), long).await.is_err()
        });
        bench.supervisor.poll(bench.now);
    };
    let offer = |bench: &mut Bench, budget: usize| bench.supervisor.transmit(bench.now, budget, &mut |_, _| ());
    request(&mut bench);
    assert_eq!(offer(&mut bench, 100), 0, "it does not fit");
    bench.pass(Duration::from_millis(1));
    bench.supervisor.poll(bench.now);
    assert_eq!(offer(&mut bench, 100), 0, "no procedure waits for it");
    assert!(!bench.supervisor.wants_to_send());
    bench.pass(Duration::from_millis(100));
    request(&mut bench);
    assert_eq!(offer(&mut bench, 100), 0, "its waiting time starts now");
    bench.pass(Duration::from_micros(500));
    assert!(offer(&mut bench, 1_500) > 1_000);
    // The next datagram in the same table entry starts its own waiting time.
    request(&mut bench);
    offer(&mut bench, 100);
    bench.pass(Duration::from_micros(900));
    request(&mut bench);
    for _ in 0..2 {
        bench.pass(Duration::from_micros(100));
        bench.supervisor.poll(bench.now);
        assert_eq!(offer(&mut bench, 100), 0);
    }
}
