//! Flights of a domain of three SubDevices with one byte out and one byte in each, on a ring.

mod answers;
mod parts;
#[cfg(feature = "standby")]
mod standby;
mod tries;
mod under_way;

use core::time::Duration;
use std::vec;

use ringcat_wire::frame::MacAddress;
use ringcat_wire::source_address::MacCodec;

use super::*;
use crate::board::Supervision;
use crate::declared::SubDeviceId;
use crate::direction::Direction;
use crate::domain::Freshness;
use crate::layout::{AreaSpec, DomainSpec, ImageOrder};
use crate::queue::{Consumer, queue};
use crate::ring::RingState;
use ringcat_wire::address::Wkc;

const DOMAIN: DomainId = DomainId(0);
const PERIOD: Duration = Duration::from_millis(1);
/// Places in the frame: LWR with three bytes, LRD with three bytes, LRD of presence with three, BRD with two.
const OUTPUTS_AT: usize = 26;
const LWR_WKC_AT: usize = 29;
const INPUTS_AT: usize = 41;
const LRD_WKC_AT: usize = 44;
const PRESENCE_AT: usize = 56;
const PRESENCE_WKC_AT: usize = 59;
const AL_STATUS_AT: usize = 71;
const BRD_WKC_AT: usize = 73;
/// Inputs in the image lie behind the outputs.
const IMAGE_INPUTS: core::ops::Range<usize> = 3..6;

struct Ring {
    exchange: Exchange,
    board: Arc<Board>,
    events: Consumer,
    now: Instant,
}

impl Ring {
    fn new() -> Ring {
        Ring::with_optional(vec![])
    }

    fn with_optional(optional: Vec<bool>) -> Ring {
        Ring::with(optional, 1)
    }

    fn with(optional: Vec<bool>, under_way: u8) -> Ring {
        let area = |subdevice, direction| AreaSpec { subdevice, sync_manager: direction as u8, direction, length: 1 };
        let areas = (0..3).flat_map(|s| [area(s, Direction::Outputs), area(s, Direction::Inputs)]).collect();
        let spec = DomainSpec { period: PERIOD, under_way, lrw: true, areas, image: ImageOrder::Packed };
        let layout = Layout::new(&[spec], LinkSet::Ring, true).unwrap();
        let board = Arc::new(Board::new(3).with_optional(optional));
        (0..3).for_each(|subdevice| board.set_taking_part(subdevice, true));
        let (producer, events) = queue(16);
        let (main, redundant) = (MacAddress([0, 1, 2, 3, 4, 5]), MacAddress([0, 1, 2, 3, 4, 6]));
        let identity = Identity::new(MacCodec::FlagsFirst, main, Some(redundant));
        let exchange = Exchange::new(identity, LinkSet::Ring, &layout, board.clone(), producer);
        Ring { exchange, board, events, now: Instant(0) }
    }

    /// Queues and sends; returns the copies, which must be equal except for the mark of the redundant one.
    fn send(&mut self) -> [Vec<u8>; 2] {
        assert!(self.exchange.queue(DOMAIN, self.now));
        let mut copies = [vec![], vec![]];
        self.exchange.send(self.now, &mut |link, bytes| copies[link.index()] = bytes.to_vec());
        let mut unmarked = copies[1].clone();
        assert_eq!(unmarked[6], 0x08);
        unmarked[6] = 0;
        assert_eq!((copies[0].len(), &unmarked), (75, &copies[0]));
        copies
    }

    fn receive(&mut self, arrived_on: Link, bytes: &[u8]) -> Received {
        self.exchange.receive(arrived_on, bytes, self.now)
    }

    /// Lets the cycle pass and evaluates.
    fn evaluate(&mut self) -> DomainStatus {
        self.now += PERIOD;
        self.exchange.process(DOMAIN, self.now)
    }

    fn inputs(&self) -> &[u8] {
        &self.exchange.image(DOMAIN)[IMAGE_INPUTS]
    }

    fn freshness(&self) -> [Freshness; 3] {
        [0, 1, 2].map(|subdevice| self.exchange.freshness(DOMAIN, SubDeviceId(subdevice)))
    }
}

/// Answer of these SubDevices to a frame; their inputs are `base` plus their number.
fn process(frame: &mut [u8], subdevices: &[usize], base: u8) {
    frame[6] |= 0x02;
    for subdevice in subdevices {
        frame[INPUTS_AT + subdevice] |= base + *subdevice as u8;
        frame[PRESENCE_AT + subdevice] |= 0x08;
        for at in [LWR_WKC_AT, LRD_WKC_AT, PRESENCE_WKC_AT, BRD_WKC_AT] {
            frame[at] += 1;
        }
        frame[AL_STATUS_AT] |= 0x08;
    }
}

// covers: CR-24
#[test]
fn in_a_closed_ring_the_complete_copy_is_delivered_without_waiting_for_the_other() {
    let mut ring = Ring::new();
    ring.exchange.image_mut(DOMAIN)[..3].copy_from_slice(&[7, 8, 9]);
    let [mut main, redundant] = ring.send();
    assert_eq!(main[OUTPUTS_AT..OUTPUTS_AT + 3], [7, 8, 9]);
    process(&mut main, &[0, 1, 2], 0x40);
    assert_eq!(ring.receive(Link::Redundant, &main), Received::Taken);
    assert_eq!(ring.inputs(), [0x40, 0x41, 0x42]);
    assert_eq!(ring.receive(Link::Main, &redundant), Received::Taken);
    let status = ring.evaluate();
    assert_eq!((status.wkc, status.expected, status.state), (6, 6, DomainState::Complete));
    assert_eq!(ring.exchange.ring(), RingState::Closed);
    assert_eq!(ring.freshness(), [Freshness::Fresh; 3]);
    let seen = Supervision { main: Wkc(3), redundant: Wkc(0), al_status: [8, 0], irq: 0, returned: false };
    assert_eq!(ring.board.supervision(), Some((1, seen)));
    assert!(ring.events.pop().is_some() && ring.events.pop().is_none(), "one change of state");
}

// covers: domains
#[test]
fn the_event_of_a_complete_cycle_counts_the_incomplete_ones_before_it() {
    for lost in 1..5 {
        let mut ring = Ring::new();
        let cycle = |ring: &mut Ring, is_lost: bool| {
            let [mut main, redundant] = ring.send();
            process(&mut main, if is_lost { &[0, 1] } else { &[0, 1, 2] }, 0x40);
            ring.receive(Link::Redundant, &main);
            ring.receive(Link::Main, &redundant);
            ring.evaluate();
        };
        cycle(&mut ring, false);
        (0..lost).for_each(|_| cycle(&mut ring, true));
        cycle(&mut ring, false);
        let events = core::iter::from_fn(|| ring.events.pop().and_then(CyclicEvent::unpack));
        let counts = events.map(|event| match event {
            CyclicEvent::Domain { incomplete, .. } => incomplete,
            other => panic!("{other:?}"),
        });
        assert_eq!(counts.collect::<Vec<_>>(), [0, 1, lost]);
    }
}

// covers: ring-merge
#[test]
fn inputs_of_the_first_copy_stay_where_a_second_one_was_processed_again() {
    let mut ring = Ring::new();
    for again in [false, true] {
        let [mut main, mut redundant] = ring.send();
        process(&mut main, &[0, 1, 2], 0x40);
        process(&mut redundant, if again { &[2] } else { &[] }, 0x50);
        assert_eq!(ring.receive(Link::Redundant, &main), Received::Taken);
        assert_eq!(ring.receive(Link::Redundant, &redundant), Received::Taken);
        assert_eq!(ring.inputs(), [0x40, 0x41, 0x42]);
        let status = ring.evaluate();
        assert_eq!(status.state, if again { DomainState::Incomplete } else { DomainState::Complete });
        assert_eq!(status.wkc, 6 + 2 * u32::from(again));
        assert_eq!(ring.freshness(), [Freshness::Fresh; 3]);
    }
}

#[test]
fn a_zero_copy_that_comes_first_does_not_hide_the_complete_one() {
    let mut ring = Ring::new();
    let [mut main, redundant] = ring.send();
    process(&mut main, &[0, 1, 2], 0x40);
    ring.receive(Link::Main, &redundant);
    assert_eq!(ring.inputs(), [0; 3]);
    ring.receive(Link::Redundant, &main);
    assert_eq!(ring.inputs(), [0x40, 0x41, 0x42]);
    assert_eq!(ring.evaluate().state, DomainState::Complete);
}

#[test]
fn in_a_cut_ring_both_copies_make_one_answer() {
    for before in 0..=3 {
        let mut ring = Ring::new();
        let [mut main, mut redundant] = ring.send();
        let (near, far) = [0, 1, 2].split_at(before);
        process(&mut main, near, 0x40);
        process(&mut redundant, far, 0x40);
        ring.receive(Link::Main, &main);
        ring.receive(Link::Redundant, &redundant);
        let status = ring.evaluate();
        assert_eq!((ring.inputs(), status.state), (&[0x40, 0x41, 0x42][..], DomainState::Complete), "cut at {before}");
        assert_eq!((status.wkc, ring.exchange.ring()), (6, RingState::Open));
        let (_, seen) = ring.board.supervision().unwrap();
        assert_eq!((seen.main, seen.redundant), (Wkc(before as u16), Wkc(3 - before as u16)));
    }
}

// covers: freshness
#[test]
fn a_missing_subdevice_keeps_its_last_inputs_and_the_others_are_new_at_once() {
    let mut ring = Ring::new();
    for (answering, base) in [(&[0, 1, 2][..], 0x10), (&[0, 2][..], 0x20)] {
        let [mut main, redundant] = ring.send();
        process(&mut main, answering, base);
        ring.receive(Link::Redundant, &main);
        ring.receive(Link::Main, &redundant);
        ring.evaluate();
    }
    assert_eq!(
        (ring.inputs(), ring.exchange.status(DOMAIN).unwrap().state),
        (&[0x20, 0x11, 0x22][..], DomainState::Incomplete)
    );
    assert_eq!(ring.freshness(), [Freshness::Fresh, Freshness::Stale { cycles: 1 }, Freshness::Fresh]);
    assert_eq!([0, 1, 2].map(|subdevice| ring.exchange.al_status(SubDeviceId(subdevice))), [Some(8), Some(0), Some(8)]);
}

#[test]
fn inputs_of_those_that_take_part_are_new_and_the_missing_one_keeps_its_last() {
    for missing in 0..3 {
        let mut ring = Ring::new();
        let there: Vec<usize> = (0..3).filter(|subdevice| *subdevice != missing).collect();
        for (answering, base) in [(&[0, 1, 2][..], 0x10), (&there, 0x20)] {
            ring.board.set_taking_part(missing, answering.len() == 3);
            let [mut main, redundant] = ring.send();
            process(&mut main, answering, base);
            ring.receive(Link::Redundant, &main);
            ring.receive(Link::Main, &redundant);
            ring.evaluate();
        }
        let mut inputs = [0x20, 0x21, 0x22];
        inputs[missing] -= 0x10;
        assert_eq!(ring.inputs(), inputs);
        let mut freshness = [Freshness::Fresh; 3];
        freshness[missing] = Freshness::Stale { cycles: 1 };
        assert_eq!(ring.freshness(), freshness);
    }
}

/// The copies of a frame that one SubDevice with an input did not process, but another one that is not expected did.
// covers: freshness
#[test]
fn a_sum_that_fits_by_chance_makes_no_inputs_fresh() {
    let mut ring = Ring::new();
    for (answering, base) in [(&[0, 1, 2][..], 0x10), (&[0, 2][..], 0x20)] {
        // The engine still assumes that 2 is absent and 1 present.
        ring.board.set_taking_part(2, answering.len() == 3);
        let [mut main, redundant] = ring.send();
        process(&mut main, answering, base);
        ring.receive(Link::Redundant, &main);
        ring.receive(Link::Main, &redundant);
        ring.evaluate();
    }
    assert_eq!(ring.inputs(), [0x20, 0x11, 0x22]);
    assert_eq!(ring.freshness(), [Freshness::Fresh, Freshness::Stale { cycles: 1 }, Freshness::Fresh]);
}

/// A SubDevice processes both copies while another one loses its power: the sum is that of all.
// covers: freshness
#[test]
fn a_subdevice_that_processed_both_copies_does_not_stand_for_one_that_is_gone() {
    let mut ring = Ring::new();
    let [mut main, mut redundant] = ring.send();
    process(&mut main, &[0, 1], 0x10);
    process(&mut redundant, &[1], 0x40);
    ring.receive(Link::Main, &main);
    ring.receive(Link::Redundant, &redundant);
    let status = ring.evaluate();
    assert_eq!((status.wkc, status.expected, status.state), (6, 6, DomainState::Incomplete));
    assert_eq!(ring.inputs(), [0x10, 0x11, 0]);
    assert_eq!(ring.freshness(), [Freshness::Fresh, Freshness::Fresh, Freshness::Never]);
}

/// One SubDevice on its way to SAFEOP takes outputs and may answer reads with undefined memory content: the inputs of
/// the others stay fresh, its own do not.
#[test]
fn a_subdevice_below_safeop_costs_the_others_nothing_and_is_not_fresh() {
    for gives in [false, true] {
        let mut ring = Ring::new();
        ring.board.set_taking_part(1, false);
        ring.board.set_unproven(1, true);
        let [mut main, redundant] = ring.send();
        process(&mut main, &[0, 2], 0x10);
        frame_of_one_in_preop(&mut main, 1, gives);
        ring.receive(Link::Redundant, &main);
        ring.receive(Link::Main, &redundant);
        ring.evaluate();
        let expected = [Freshness::Fresh, Freshness::Never, Freshness::Fresh];
        assert_eq!(ring.freshness(), expected, "gives inputs: {gives}");
        assert_eq!(ring.exchange.al_status(SubDeviceId(1)), Some(2));
    }
}

/// Answer to a frame of a SubDevice in PREOP whose FMMUs are set.
fn frame_of_one_in_preop(frame: &mut [u8], subdevice: usize, gives_inputs: bool) {
    frame[PRESENCE_AT + subdevice] |= 0x02;
    for at in [LWR_WKC_AT, PRESENCE_WKC_AT, BRD_WKC_AT] {
        frame[at] += 1;
    }
    if gives_inputs {
        frame[INPUTS_AT + subdevice] = 0x77;
        frame[LRD_WKC_AT] += 1;
    }
}

/// The presence bytes and their working counter disagree: a SubDevice processed one copy twice.
#[test]
fn a_copy_that_a_subdevice_processed_twice_makes_nothing_fresh() {
    let mut ring = Ring::new();
    let [mut main, redundant] = ring.send();
    process(&mut main, &[0, 1], 0x10);
    process(&mut main, &[1], 0x10);
    ring.receive(Link::Redundant, &main);
    ring.receive(Link::Main, &redundant);
    ring.evaluate();
    assert_eq!((ring.inputs(), ring.freshness()), (&[0; 3][..], [Freshness::Never; 3]));
}

// covers: CR-06
#[test]
fn one_lost_copy_of_a_closed_ring_costs_nothing_and_both_lost_cost_a_cycle() {
    let mut ring = Ring::new();
    let [mut main, _] = ring.send();
    process(&mut main, &[0, 1, 2], 0x10);
    ring.receive(Link::Redundant, &main);
    assert_eq!(ring.evaluate().state, DomainState::Complete);
    ring.send();
    assert_eq!(ring.exchange.counters().copies_lost, 1);
    assert_eq!(ring.evaluate().state, DomainState::Zero);
    assert_eq!((ring.exchange.counters().lost, ring.inputs()), (1, &[0x10, 0x11, 0x12][..]));
}

#[test]
fn a_copy_that_is_not_complete_is_given_up_at_the_deadline_and_its_inputs_are_new() {
    let mut ring = Ring::new();
    let [mut main, _] = ring.send();
    process(&mut main, &[0], 0x10);
    ring.receive(Link::Main, &main);
    let early = ring.exchange.process(DOMAIN, ring.now + PERIOD / 2);
    assert!(early.pending && !ring.exchange.queue(DOMAIN, ring.now + PERIOD / 2));
    let status = ring.evaluate();
    assert_eq!((status.wkc, status.state, status.skipped), (2, DomainState::Incomplete, 1));
    assert_eq!((ring.exchange.counters().half, ring.inputs()), (1, &[0x10, 0, 0][..]));
    assert_eq!(ring.freshness(), [Freshness::Fresh, Freshness::Never, Freshness::Never]);
}

#[test]
fn a_copy_that_met_a_subdevice_twice_is_incomplete_though_it_was_delivered() {
    let mut ring = Ring::new();
    let [mut main, mut redundant] = ring.send();
    process(&mut main, &[0, 1, 2], 0x10);
    process(&mut redundant, &[2], 0x10);
    ring.receive(Link::Redundant, &main);
    ring.receive(Link::Main, &redundant);
    let status = ring.evaluate();
    assert_eq!((status.wkc, status.state), (8, DomainState::Incomplete));
}

// covers: domains
#[test]
fn a_domain_is_complete_without_its_optional_subdevice_but_no_other() {
    for (missing, state) in [(1, DomainState::Complete), (2, DomainState::Incomplete)] {
        let mut ring = Ring::with_optional(vec![false, true, false]);
        ring.board.set_taking_part(missing, false);
        let evaluated = [0, 1].map(|_| {
            let [mut main, redundant] = ring.send();
            let present: Vec<usize> = (0..3).filter(|subdevice| *subdevice != missing).collect();
            process(&mut main, &present, 0x40);
            ring.receive(Link::Redundant, &main);
            ring.receive(Link::Main, &redundant);
            ring.evaluate().state
        });
        assert_eq!(evaluated[1], state, "without {missing}");
        assert_eq!(ring.freshness()[0], Freshness::Fresh);
    }
}

#[test]
fn a_domain_queued_twice_leaves_once_with_its_last_outputs() {
    let spec = |subdevice| {
        let areas = vec![AreaSpec { subdevice, sync_manager: 0, direction: Direction::Outputs, length: 1 }];
        DomainSpec { period: PERIOD, under_way: 1, lrw: false, areas, image: ImageOrder::Packed }
    };
    let layout = Layout::new(&[spec(0), spec(1)], LinkSet::Single, false).unwrap();
    let identity = Identity::new(MacCodec::FlagsFirst, MacAddress([0, 1, 2, 3, 4, 5]), None);
    let (producer, _events) = queue(16);
    let board = Arc::new(Board::new(2));
    (0..2).for_each(|subdevice| board.set_taking_part(subdevice, true));
    let mut exchange = Exchange::new(identity, LinkSet::Single, &layout, board, producer);
    for round in 0..3 {
        let now = Instant(0) + PERIOD * round;
        for (domain, value) in [(0, 1), (0, 2), (1, 3), (1, 4), (0, 5)] {
            exchange.process(DomainId(domain), now);
            exchange.image_mut(DomainId(domain))[0] = value;
            assert!(exchange.queue(DomainId(domain), now));
        }
        let mut frames = vec![];
        exchange.send(now, &mut |_, bytes| frames.push(bytes.to_vec()));
        let outputs: Vec<u8> = frames.iter().map(|frame| frame[OUTPUTS_AT]).collect();
        assert_eq!(outputs, [5, 4], "round {round}");
        for mut frame in frames {
            frame[6] |= 0x02;
            assert_eq!(exchange.receive(Link::Main, &frame, now), Received::Taken);
        }
    }
    let counters = exchange.counters();
    assert_eq!((counters.sent, counters.received, counters.late, counters.lost), (6, 6, 0, 0));
}

/// Two domains with one byte in of one SubDevice each, and one with two frames: lengths of the frames that leave.
struct Starting {
    exchange: Exchange,
    board: Arc<Board>,
    now: Instant,
}

impl Starting {
    fn new() -> Starting {
        let spec = |subdevices: core::ops::Range<usize>, length| {
            let area = |subdevice| AreaSpec { subdevice, sync_manager: 3, direction: Direction::Inputs, length };
            DomainSpec {
                period: PERIOD,
                under_way: 1,
                lrw: true,
                areas: subdevices.map(area).collect(),
                image: ImageOrder::Packed,
            }
        };
        let layout = Layout::new(&[spec(0..1, 4), spec(1..3, 1000)], LinkSet::Single, true).unwrap();
        let board = Arc::new(Board::new(3));
        let identity = Identity::new(MacCodec::FlagsFirst, MacAddress([0, 1, 2, 3, 4, 5]), None);
        let exchange = Exchange::new(identity, LinkSet::Single, &layout, board.clone(), queue(16).0);
        Starting { exchange, board, now: Instant(0) }
    }

    /// A cycle in which `wkc` comes back in the last datagram of each frame, behind which another may pad it; lengths
    /// of the frames.
    fn cycle(&mut self, wkc: u16) -> Vec<usize> {
        self.now += PERIOD;
        let domains = [DomainId(0), DomainId(1)];
        assert_eq!(domains.map(|domain| self.exchange.queue(domain, self.now)), [true; 2]);
        let mut frames = vec![];
        self.exchange.send(self.now, &mut |_, bytes| frames.push(bytes.to_vec()));
        for mut frame in frames.clone() {
            frame[6] |= 0x02;
            let end = 16 + usize::from(u16::from_le_bytes([frame[14], frame[15]]) & 0x07FF);
            frame[end - 2..end].copy_from_slice(&wkc.to_le_bytes());
            frame.resize(frame.len() + 1500, 0xEE);
            assert_eq!(self.exchange.receive(Link::Main, &frame, self.now), Received::Taken);
        }
        for domain in domains {
            self.exchange.process(domain, self.now);
        }
        frames.iter().map(Vec::len).collect()
    }

    fn states(&self) -> [DomainState; 2] {
        [0, 1].map(|domain| self.exchange.status(DomainId(domain)).unwrap().state)
    }
}

// covers: layout
#[test]
fn a_frame_carries_process_data_from_its_first_subdevice_with_fmmus_on() {
    let mut start = Starting::new();
    assert_eq!(start.cycle(3), [60, 60, 60]);
    let (count, seen) = start.board.supervision().unwrap();
    assert_eq!((count, seen.main, start.states()), (1, Wkc(3), [DomainState::Zero; 2]));
    start.board.set_taking_part(2, true);
    assert_eq!(start.cycle(1), [60, 60, 1028]);
    assert_eq!(start.states(), [DomainState::Zero, DomainState::Incomplete]);
    let freshness = [1, 2].map(|subdevice| start.exchange.freshness(DomainId(1), SubDeviceId(subdevice)));
    assert_eq!(freshness, [Freshness::Never, Freshness::Fresh]);
    start.board.set_taking_part(2, false);
    assert_eq!(start.cycle(0), [60, 60, 1028], "what has its FMMUs may come back with them");
    (0..3).for_each(|subdevice| start.board.set_taking_part(subdevice, true));
    assert_eq!(start.cycle(1), [60, 1028, 1028]);
    assert_eq!(start.states(), [DomainState::Zero, DomainState::Complete], "its last datagram is supervision");
    assert_eq!(start.exchange.counters().corrupt, 0);
}
