//! Tests from posted words and observations to events, without a bus.

mod addressed;
mod clocks;
mod idle;
mod posted;
#[cfg(feature = "standby")]
mod roles;
mod stages;
mod stale;
mod undeclared;

use alloc::boxed::Box;
use alloc::rc::Rc;
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;
use std::time::Duration;

use ringcat_wire::address::{Position, StationAddress, Wkc};
use ringcat_wire::al::{AlState, AlStatus, AlStatusCode};
use ringcat_wire::register::{DlStatus, PortKind};
use ringcat_wire::sii::Identity;

use self::posted::Posted;
use super::clocks::Clocks;
use super::disturbance::{Disturbance, Wanted};
use super::effect::{Check, Effect, Effects, Shown, Task};
use super::member::{MemberView, Phase};
use super::setup::Setup;
use super::start::Start;
use super::*;
use crate::board::{Board, RingWord, Supervision};
use crate::config::SubDeviceConfig;
use crate::declared::{Move, SubDeviceId};
use crate::event::Event;
use crate::info::SubDeviceInfo;
use crate::junction::JunctionMode;
use crate::layout::{Layout, Rules};
use crate::link::{Link, LinkSet};
use crate::ring::RingState;
use crate::ring_status::{Cable, CableErrors, Redundancy, RedundancyLoss, RingStatus, cables};
use crate::time::Instant;
use crate::topology::{NodeStatus, PortOf, Topology};

/// High bytes of DL_STATUS: a SubDevice between two others, and those at both sides of a break.
const PASS: u8 = 0x5A;
const BEFORE: u8 = 0x56;
const BEHIND: u8 = 0x59;

const OP: Shown = (AlStatus { state: 8, error: false, identification: false, reserved: 0 }, AlStatusCode(0));

/// A change this long after the previous one is reported at once.
const QUIET: Duration = Duration::from_millis(50);

/// A closed ring of `n` SubDevices, all of them members in OP.
struct Ring {
    segment: Segment,
    words: Posted,
    now: Instant,
}

fn station(index: usize) -> StationAddress {
    StationAddress(0x1001 + index as u16)
}

fn node(high: u8) -> NodeStatus {
    let dl_status = DlStatus::from_bits(u16::from(high) << 8);
    NodeStatus { dl_status, receive_times: None, ports: [PortKind::Mii; 4] }
}

fn ring_rules() -> Rules<'static> {
    let lrw = Default::default();
    Rules { links: LinkSet::Ring, supervision: true, lrw, witnesses: &[], session: 0, max_datagrams: None }
}

/// Choices of an application with default options.
fn choices() -> Choices {
    Choices {
        dictionaries: false,
        enhanced_line_crossed: false,
        junctions: JunctionMode::Disabled,
        follow_groups: false,
        idle_operation: false,
        supervision: true,
        pdos: crate::segment::ReadPdos::Missing,
        retries: Retries::Always,
        alias_source: crate::info::AliasSource::Sii,
        sii_assignment: crate::info::SiiAssignment::TowardsPreOp,
    }
}

/// An address that was given to a SubDevice with another one.
fn given(station: StationAddress) -> TemporaryAddress {
    TemporaryAddress { station, before: StationAddress(0x7777) }
}

/// SubDevices with these station addresses and product codes.
fn found(stations: &[(u16, u32)]) -> Scan {
    let info = |(at, (station, product_code)): (usize, &(u16, u32))| SubDeviceInfo {
        position: Position(at as u16),
        station: StationAddress(*station),
        identity: Identity { vendor_id: 2, product_code: *product_code, revision: 1, serial: 0 },
        ..SubDeviceInfo::default()
    };
    let subdevices: Vec<SubDeviceInfo> = stations.iter().enumerate().map(info).collect();
    let topology = Topology::build(&vec![node(PASS); stations.len()], stations.len());
    Scan { subdevices, topology, main_count: stations.len(), redundant_count: 0 }
}

impl Ring {
    fn closed(count: usize) -> Ring {
        Ring::with_clocks(count, Clocks::undeclared())
    }

    fn with_clocks(count: usize, clocks: Clocks) -> Ring {
        let info = |index: usize| {
            let identity = Identity { vendor_id: 2, product_code: 7, revision: 1, serial: 0 };
            let (position, station) = (Position(index as u16), station(index));
            SubDeviceInfo { position, station, identity, ..SubDeviceInfo::default() }
        };
        let member = |index: usize| {
            let info = Some(Rc::new(info(index)));
            SubDevice::declared(SubDeviceConfig::at_position(index as u16), info, station(index), Err(None))
        };
        let topology = Topology::build(&vec![node(PASS); count], count);
        let cables = cables(&topology, LinkSet::Ring).into_iter().map(|cable| (cable, CableErrors::default()));
        let (subdevices, topology_found) = ((0..count).map(info).collect(), topology.clone());
        let scan = Scan { subdevices, topology: topology_found, main_count: count, redundant_count: 0 };
        let cabling = Cabling {
            types: Vec::new(),
            cables: cables.collect(),
            topology,
            stations: (0..count).map(station).collect(),
            closings: Vec::new(),
            version: 0,
        };
        let declared = Declared {
            subdevices: SubDevices::new((0..count).map(member).collect(), []),
            layout: Layout::with(&[], ring_rules()).unwrap(),
            clocks,
            cabling,
            ring: RingStatus { redundancy: Redundancy::Unknown, ..RingStatus::default() },
            carriers: [Some(true); 2],
            board: Arc::new(Board::new(count)),
        };
        let mut segment = Segment::new(choices());
        segment.observe(Observation::ScanBegun, Instant(0));
        segment.observe(Observation::ScanEnded(Ok(scan)), Instant(0));
        segment.observe(Observation::Activated(Box::new(declared)), Instant(0));
        let counts = Supervision { main: Wkc(count as u16), al_status: [8, 0], ..Supervision::default() };
        let words = Posted {
            links: LinkSet::Ring,
            carriers: [Some(true); 2],
            ring: RingWord { state: RingState::Closed, changes: 1, ..RingWord::default() },
            supervision: Some((1, counts)),
            cycles: 1,
        };
        let mut ring = Ring { segment, words, now: Instant(0) };
        for member in ring.segment.subdevices.members_mut() {
            member.phase = Phase::Settled(AlState::Op);
        }
        // Counts become valid after several equal results; the first scans give no events.
        for _ in 0..6 {
            ring.cycle();
            ring.scan(&vec![PASS; count]);
        }
        ring
    }

    fn member(&self, index: usize) -> MemberView<'_> {
        self.segment.member(index).unwrap()
    }

    fn observe(&mut self, seen: Observation<'_>) -> Vec<Effect> {
        self.segment.observe(seen, self.now).0
    }

    /// The next cycle.
    fn cycle(&mut self) -> Vec<Effect> {
        self.now += Duration::from_millis(1);
        if let Some((number, _)) = &mut self.words.supervision {
            *number += 1;
        }
        self.words.cycles += 1;
        let words = self.words.words();
        self.observe(Observation::Words(words))
    }

    /// A round of reads with all in OP; 0 for a silent SubDevice.
    fn scan(&mut self, high: &[u8]) -> Vec<Effect> {
        let (status, code) = OP;
        let readings: Vec<Reading> = high
            .iter()
            .map(|high| match high {
                0 => Reading::Silent,
                high => Reading::Answer { status, code, dl_status: node(*high).dl_status },
            })
            .collect();
        let before: Vec<Phase> = self.segment.members().map(|member| member.phase).collect();
        let counted = self.words.supervision.map(|(_, seen)| seen.total());
        let versions = self.segment.versions();
        let round_result = RoundResult { versions, readings: &readings, before: &before, unassigned: &[], counted };
        let effects = self.observe(Observation::Round(round_result));
        let number = self.words.supervision.map(|(number, _)| number);
        self.observe(Observation::RoundEnded(number));
        effects
    }

    fn counts(&mut self, main: u16, redundant: u16, state: RingState) {
        let seen = Supervision {
            main: Wkc(main),
            redundant: Wkc(redundant),
            al_status: [8, 8],
            irq: 0,
            returned: state == RingState::Open,
        };
        let number = self.words.supervision.map_or(0, |(number, _)| number);
        self.words.supervision = Some((number, seen));
        self.words.ring.state = state;
        self.words.ring.returned = (state == RingState::Open).then_some((Link::Main, main));
        self.words.ring.changes += 1;
    }
}

const fn of_member((index, attempt): (usize, u32), finding: MemberFinding<'_>) -> Observation<'_> {
    Observation::OfMember { index, attempt, finding }
}

fn reports(effects: &[Effect]) -> Vec<Event> {
    let event = |effect: &Effect| match effect {
        Effect::Report(event) | Effect::ReportOf(event, _) => Some(event.clone()),
        _ => None,
    };
    effects.iter().filter_map(event).collect()
}

const fn cable(near: (usize, u8), far: (usize, u8)) -> Cable {
    Cable { near: Some(PortOf { node: near.0, port: near.1 }), far: Some(PortOf { node: far.0, port: far.1 }) }
}

#[test]
fn a_cut_is_reported_in_the_cycle_that_shows_it_and_located_by_the_next_scan() {
    for count in [2, 3, 8, 64] {
        for at in 1..count {
            let mut ring = Ring::closed(count);
            let (main, redundant) = (at as u16, (count - at) as u16);
            ring.now += QUIET;
            ring.counts(main, redundant, RingState::Open);
            let effects = ring.cycle();
            let opened = [Event::RingOpened { main, redundant }, Event::RedundancyLost { cause: RedundancyLoss::Open }];
            assert_eq!(reports(&effects), opened, "{at} of {count}");
            assert!(effects.contains(&Effect::MainCount(main)));
            assert!(effects.contains(&Effect::Start(Task::Round { routine: false })));
            let mut high = vec![PASS; count];
            (high[at - 1], high[at]) = (BEFORE, BEHIND);
            let place = cable((at - 1, 1), (at, 0));
            let effects = ring.scan(&high);
            assert_eq!(reports(&effects), [Event::BreakLocated { cable: place }], "{at} of {count}");
            assert!(effects.contains(&Effect::Start(Task::ExamineCabling { in_control: false })));
            assert_eq!(ring.segment.ring_status().place, Some(place));
            assert_eq!(reports(&ring.cycle()), [], "each edge once");
            ring.counts(count as u16, 0, RingState::Closed);
            ring.now += QUIET;
            let closed =
                [Event::RingClosed { main: count as u16, redundant: 0, place: Some(place) }, Event::RedundancyRegained];
            assert_eq!(reports(&ring.cycle()), closed, "{at} of {count}");
        }
    }
}

#[test]
fn counts_from_before_a_cut_are_not_reported_for_the_open_ring() {
    let mut ring = Ring::closed(8);
    ring.now += QUIET;
    // A frame without a supervision datagram has shown the cut; results from before the cut arrive one after the other.
    ring.counts(8, 0, RingState::Open);
    ring.words.ring.returned = None;
    for _ in 0..4 {
        if let Some((_, seen)) = &mut ring.words.supervision {
            seen.returned = false;
        }
        assert_eq!(reports(&ring.cycle()), []);
    }
    let changes = ring.words.ring.changes;
    ring.counts(3, 5, RingState::Open);
    (ring.words.ring.changes, ring.words.ring.returned) = (changes, None);
    let events: Vec<Event> = (0..4).flat_map(|_| reports(&ring.cycle())).collect();
    assert!(events.contains(&Event::RingOpened { main: 3, redundant: 5 }), "{events:?}");
}

#[test]
fn rings_opened_on_purpose_are_not_reported() {
    for disturbance in [Disturbance::OpenByLink, Disturbance::OpenByPort] {
        let mut ring = Ring::closed(4);
        ring.observe(Observation::Wanted(Wanted { disturbance, number: 0 }));
        assert_eq!(ring.segment.disturbance(), Some(disturbance));
        ring.counts(4, 0, RingState::Open);
        assert_eq!(reports(&ring.cycle()), [], "{disturbance:?}");
        ring.counts(4, 0, RingState::Closed);
        assert_eq!(reports(&ring.cycle()), [], "{disturbance:?}");
        ring.observe(Observation::Undisturbed(0));
        assert_eq!(reports(&ring.cycle()), [], "{disturbance:?}");
    }
}

#[test]
fn a_member_is_lost_when_counts_confirm_it_or_after_two_silent_scans() {
    let mut ring = Ring::closed(3);
    let silent = ring.scan(&[PASS, PASS, 0]);
    assert_eq!(reports(&silent), [], "three are counted: a frame may have gone another way");
    let lost = ring.scan(&[PASS, PASS, 0]);
    assert_eq!(reports(&lost), [Event::Lost { subdevice: SubDeviceId(2) }]);
    assert!(lost.contains(&Effect::SuspendMailbox { index: 2 }));
    let mut ring = Ring::closed(3);
    ring.counts(2, 0, RingState::Closed);
    ring.cycle();
    assert_eq!(reports(&ring.scan(&[PASS, PASS, 0])), [Event::Lost { subdevice: SubDeviceId(2) }]);
    ring.counts(3, 0, RingState::Closed);
    ring.cycle();
    let back = ring.scan(&[PASS; 3]);
    assert_eq!(reports(&back), [], "another one may have its address");
    let check = Check::Return;
    let task = Task::BringUp { index: 2, attempt: 2, from: Start::Unknown, reported: None, check };
    assert!(back.contains(&Effect::Start(task)), "{back:?}");
    let back = ring.observe(of_member((2, 2), MemberFinding::Returned));
    assert_eq!(reports(&back), [Event::Returned { subdevice: SubDeviceId(2) }]);
}

#[test]
fn scans_during_an_isolation_do_not_change_member_states() {
    let mut ring = Ring::closed(3);
    let versions = ring.segment.versions();
    ring.observe(Observation::Wanted(Wanted { disturbance: Disturbance::IsolateRings, number: 0 }));
    ring.observe(Observation::Undisturbed(0));
    let before = [Phase::Settled(AlState::Op); 3];
    for _ in 0..3 {
        let round_result = RoundResult {
            versions,
            readings: &[Reading::Silent; 3],
            before: &before,
            unassigned: &[],
            counted: Some(Wkc(0)),
        };
        assert_eq!(reports(&ring.observe(Observation::Round(round_result))), []);
    }
    assert_eq!(ring.member(0).phase, Phase::Settled(AlState::Op));
}

#[test]
fn results_of_an_ended_attempt_are_ignored() {
    let mut ring = Ring::closed(1);
    ring.observe(of_member((0, 0), MemberFinding::Undone("FMMUs".into())));
    assert_eq!(ring.member(0).phase, Phase::Configuring);
    for late in [
        of_member((0, 0), MemberFinding::Reached(AlState::Op)),
        of_member((0, 0), MemberFinding::Unreachable),
        of_member((0, 0), MemberFinding::Undone("FMMUs".into())),
        of_member((7, 0), MemberFinding::Reached(AlState::Op)),
    ] {
        assert_eq!(ring.observe(late), []);
        assert_eq!(ring.member(0).phase, Phase::Configuring);
    }
    let effects = ring.observe(of_member((0, 1), MemberFinding::Reached(AlState::Op)));
    assert_eq!(reports(&effects), [Event::StateReached { subdevice: SubDeviceId(0), state: AlState::Op }]);
}

#[test]
fn inputs_read_before_a_mapping_do_not_prove_it() {
    let mut ring = Ring::closed(1);
    let step = |step| of_member((0, 0), MemberFinding::ProcessData(step));
    ring.observe(step(ProcessDataStep::Joined));
    let before = ring.member(0).mapping;
    ring.observe(step(ProcessDataStep::Left));
    ring.observe(step(ProcessDataStep::Mapped));
    assert!(ring.segment.board.is_unproven(0));
    ring.observe(Observation::Proven { index: 0, mapping: before });
    assert!(ring.segment.board.is_unproven(0), "they were read before");
    let mapping = ring.member(0).mapping;
    ring.observe(Observation::Proven { index: 0, mapping });
    assert!(!ring.segment.board.is_unproven(0));
}

#[test]
fn a_lost_and_a_returned_carrier_are_reported_once_each() {
    let mut ring = Ring::closed(2);
    ring.words.carriers[1] = Some(false);
    assert_eq!(reports(&ring.cycle()), [Event::LinkDown { link: Link::Redundant }]);
    assert_eq!(reports(&ring.cycle()), []);
    ring.now += QUIET;
    ring.words.carriers[1] = Some(true);
    assert_eq!(reports(&ring.cycle()), [Event::LinkUp { link: Link::Redundant }]);
}

#[test]
fn without_changes_the_model_sleeps_until_the_next_routine_scan() {
    let mut ring = Ring::closed(4);
    ring.cycle();
    ring.scan(&[PASS; 4]);
    let effects = ring.cycle();
    assert_eq!(effects, []);
    let wake = ring.segment.next_evaluation().at;
    assert!(wake > ring.now + Duration::from_millis(900), "an evaluation at {wake:?}, now {:?}", ring.now);
}

/// Evaluates the same words whenever the model requests it, for a second; returns how often. Rounds end at once.
fn evaluations_without_changes(ring: &mut Ring, high: &[u8]) -> usize {
    let (words, end) = (ring.words.words(), ring.now + Duration::from_secs(1));
    let mut count = 0;
    loop {
        let effects = ring.observe(Observation::Words(words));
        if effects.iter().any(|effect| matches!(effect, Effect::Start(Task::Round { .. }))) {
            ring.scan(high);
            continue;
        }
        count += 1;
        ring.now = ring.now.max(ring.segment.next_evaluation().at);
        if ring.now >= end {
            return count;
        }
    }
}

#[test]
fn the_model_is_not_evaluated_again_and_again_when_an_application_stops_cycling() {
    // The last result counts another number than the one before.
    let mut ring = Ring::closed(4);
    ring.counts(3, 0, RingState::Closed);
    ring.words.ring.changes -= 1;
    ring.cycle();
    let count = evaluations_without_changes(&mut ring, &[PASS, PASS, PASS, 0]);
    assert!(count <= 5, "counts that never settle: {count} evaluations");
    // The ring was opened, and no result shows it.
    let mut ring = Ring::closed(4);
    ring.now += QUIET;
    ring.counts(4, 0, RingState::Open);
    ring.words.ring.returned = None;
    ring.words.supervision.as_mut().unwrap().1.returned = false;
    ring.cycle();
    let count = evaluations_without_changes(&mut ring, &[PASS; 4]);
    assert!(count <= 5, "counts from before: {count} evaluations");
    // The ECAT event of a port was set, and stays.
    let mut ring = Ring::closed(4);
    ring.words.supervision.as_mut().unwrap().1.irq = 4;
    ring.cycle();
    let count = evaluations_without_changes(&mut ring, &[PASS; 4]);
    assert!(count <= 5, "an ECAT event: {count} evaluations");
}

// covers: ring-flap
#[test]
fn a_held_back_change_is_evaluated_when_it_may_be_reported_and_not_before() {
    let mut ring = Ring::closed(4);
    ring.now += QUIET;
    ring.words.carriers[1] = Some(false);
    ring.cycle();
    ring.words.carriers[1] = Some(true);
    ring.cycle();
    ring.scan(&[PASS; 4]);
    let since = ring.now;
    let count = evaluations_without_changes(&mut ring, &[PASS; 4]);
    assert!(count <= 6, "{count} evaluations");
    assert!(ring.now > since);
    assert!(reports(&ring.cycle()).is_empty(), "the carrier was reported when it was due");
}
