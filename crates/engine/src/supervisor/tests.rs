//! Tests of the acyclic half with prepared answers: packing, pairing, retries, time limits, timers.

mod budget;
mod copies;
mod together;

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
        "station 0x1001, register 0x0130: expected working counter 1, got 0: the SubDevice does not answer, or has no \
         such register"
    );
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
    let (board, request_counter) = (Arc::new(Board::new(1)), RequestCounter::default());
    bench.supervisor.attach(board.clone());
    bench.supervisor.attach_request_counter(request_counter.clone());
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
    request_counter.increment();
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
