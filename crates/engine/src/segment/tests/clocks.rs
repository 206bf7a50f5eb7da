//! Clocks: from measured, written and read values to events, references and the next measurement.

mod stale;

use crate::board::clocks::References;
use crate::clocks::Delays;
use crate::clocks::Measured;
use crate::config::ClockConfig;
use crate::segment::clocks::{Answer, ClockFinding, ClockKey, ClockObservation, ClockVersions, Difference, Due, Node};

use super::*;

/// A closed ring of `count` clocks, 100 ns apart, that are set up.
fn set_up(count: usize) -> Ring {
    let mut ring = declared(count);
    let measured = measured(count, 100);
    let effects = ring.clocks(ClockObservation::SetUpBegun);
    assert_eq!(effects, []);
    ring.finds(ClockFinding::Measured(&measured));
    let effects = ring.finds(ClockFinding::SetUp);
    assert_eq!(reports(&effects), [Event::ReferenceClock { position: Some(Position(0)) }]);
    assert!(effects.contains(&Effect::Start(Task::CompensateDrift)));
    ring.finds(ClockFinding::Compensated);
    ring
}

fn declared(count: usize) -> Ring {
    let info = |index: usize| {
        let mut info = SubDeviceInfo { position: Position(index as u16), ..SubDeviceInfo::default() };
        info.station = station(index);
        info.controller.features.dc = true;
        info
    };
    let scanned: Vec<SubDeviceInfo> = (0..count).map(info).collect();
    let config = ClockConfig { lock_samples: 3, ..ClockConfig::default() };
    Ring::with_clocks(count, Clocks::new(Some(config), &scanned, &Topology::default(), |_| None))
}

fn measured(count: usize, apart_ns: i64) -> Measured {
    let units = (0..count as i64).map(|index| Some((index * apart_ns) << crate::clocks::FRACTION)).collect();
    let delays = Delays { units, trees: vec![0; count], ..Delays::default() };
    Measured {
        stations: (0..count).map(station).collect(),
        delays,
        drift_ppb: vec![None; count],
        ..Measured::default()
    }
}

fn answer(link: Link, difference_ns: i32) -> Option<Answer> {
    Some(Answer { link: Some(link), difference: Difference::Own(difference_ns), deviation_ppb: 0 })
}

impl Ring {
    fn clocks(&mut self, seen: ClockObservation<'_>) -> Vec<Effect> {
        self.observe(Observation::Clocks(seen))
    }

    fn finds_of(&mut self, versions: ClockVersions, finding: ClockFinding<'_>) -> Vec<Effect> {
        self.clocks(ClockObservation::Found(versions, finding))
    }

    /// A finding that was asked for just now.
    fn finds(&mut self, finding: ClockFinding<'_>) -> Vec<Effect> {
        let versions = self.segment.clock_versions();
        self.finds_of(versions, finding)
    }

    fn answers(&mut self, answers: &[Option<Answer>]) -> Vec<Event> {
        let versions = self.segment.clock_versions();
        self.answers_of(versions, answers)
    }

    fn answers_of(&mut self, versions: ClockVersions, answers: &[Option<Answer>]) -> Vec<Event> {
        let answered = |(node, answer): (&Node, &Option<Answer>)| Some((node.key(), (*answer)?));
        let answers = &self.segment.clocks().nodes.iter().zip(answers).filter_map(answered).collect();
        reports(&self.finds_of(versions, ClockFinding::Answers { answers, is_explained: true }))
    }

    fn key(&self, index: usize) -> ClockKey {
        self.node(index).key()
    }

    fn node(&self, index: usize) -> &Node {
        self.segment.clocks().node_at(station(index)).unwrap()
    }

    /// A clock shows another offset than the written one.
    fn loses_registers(&mut self, index: usize) {
        let (key, written_ns) = (self.key(index), self.node(index).offset_ns);
        let read = !(written_ns as u32);
        self.finds(ClockFinding::OffsetRead { key, written_ns, read });
    }

    fn references(&self) -> References {
        self.segment.board.clocks.references().0
    }
}

#[test]
fn clocks_lock_after_their_samples_and_that_is_reported_once() {
    let mut ring = set_up(3);
    let good = [answer(Link::Main, 0), answer(Link::Main, -40), answer(Link::Main, 90)];
    assert_eq!(ring.answers(&good), []);
    let bad = [good[0], good[1], answer(Link::Main, 101)];
    assert_eq!(ring.answers(&bad), [], "the samples have to come in a row");
    assert_eq!([ring.answers(&good), ring.answers(&good)].concat(), []);
    assert_eq!(ring.answers(&good), [Event::ClocksLocked { largest_ns: 90 }]);
    assert_eq!(ring.answers(&good), []);
    assert!(ring.segment.clocks().are_locked());
}

#[test]
fn differences_during_the_drift_compensation_lock_nothing() {
    let mut ring = set_up(2);
    assert_eq!(ring.clocks(ClockObservation::TimeWanted), [Effect::Start(Task::CompensateDrift)]);
    assert_eq!(ring.clocks(ClockObservation::TimeWanted), [], "one at a time");
    let good = [answer(Link::Main, 0); 2];
    (0..10).for_each(|_| assert_eq!(ring.answers(&good), []));
    ring.finds(ClockFinding::Compensated);
    assert_eq!((0..3).flat_map(|_| ring.answers(&good)).count(), 1);
}

#[test]
fn a_set_up_that_fails_is_reported_once_until_the_segment_changes() {
    let mut ring = declared(2);
    let mut failed = |reason: &str| reports(&ring.finds(ClockFinding::SetUpFailed(reason.into()))).len();
    assert_eq!([failed("a"), failed("a"), failed("b"), failed("b")], [1, 0, 1, 0]);
    ring.clocks(ClockObservation::SegmentChanged);
    assert_eq!(reports(&ring.finds(ClockFinding::SetUpFailed("b".into()))).len(), 1);
    assert!(!ring.segment.clocks().are_set_up());
}

#[test]
fn a_link_change_needs_two_answers_and_gives_both_links_references() {
    let mut ring = set_up(3);
    assert_eq!(ring.references(), References { main: Some(station(0)), ..References::default() });
    let split = [answer(Link::Main, 0), answer(Link::Main, 0), answer(Link::Redundant, 0)];
    assert_eq!(ring.answers(&split), []);
    assert_eq!(ring.references().redundant, None, "answers of both states are possible");
    assert_eq!(ring.answers(&split), []);
    // Delays that had the first clock as origin have the third one there.
    assert_eq!((ring.segment.clocks().due(), ring.references()), (Due::Delays, References::default()));
    assert_eq!(ring.segment.clocks().unwritten(), [Link::Redundant]);
    ring.finds(ClockFinding::DelaysWritten(Link::Redundant));
    ring.finds(ClockFinding::Followed);
    assert_eq!(ring.references().redundant, Some(station(2)));
    assert_eq!(ring.segment.clocks().due(), Due::Filters);
}

#[test]
fn a_lost_reference_is_replaced_by_the_next_clock() {
    let mut ring = set_up(3);
    let without = [Some(Answer::default()), answer(Link::Main, 0), answer(Link::Main, 0)];
    assert_eq!(ring.answers(&without), []);
    assert_eq!(ring.answers(&without), [Event::ReferenceClock { position: Some(Position(1)) }]);
}

#[test]
fn delays_that_could_not_be_written_are_written_after_the_next_measurement() {
    let mut ring = set_up(3);
    ring.clocks(ClockObservation::SegmentChanged);
    let now = measured(3, 300);
    ring.finds(ClockFinding::MeasuredAgain(&now));
    assert_eq!(ring.references(), References::default(), "no time is distributed meanwhile");
    // The bus fails before they are written; the next measurement gives the same delays.
    ring.finds(ClockFinding::MeasuredAgain(&now));
    assert_eq!(ring.segment.clocks().unwritten(), [Link::Main]);
    ring.finds(ClockFinding::DelaysWritten(Link::Main));
    let ended = ring.finds(ClockFinding::MeasurementEnded { failed: None });
    assert_eq!(reports(&ended), [Event::DelaysChanged { clocks: 2, largest_ns: 400 }]);
    assert_eq!(ring.references().main, Some(station(0)));
    assert_eq!(ring.segment.clocks().doubtful_since(), None);
}

#[test]
fn a_clock_that_lost_its_registers_is_no_reference_and_starts_a_measurement() {
    let mut ring = set_up(2);
    assert_eq!(ring.segment.clocks().doubtful_since(), None);
    ring.now = Instant(7_000_000);
    ring.loses_registers(0);
    assert_eq!(ring.segment.clocks().doubtful_since(), Some(ring.now));
    assert_eq!(ring.segment.clocks().reference, None);
    let ended = ring.finds(ClockFinding::MeasurementEnded { failed: None });
    assert_eq!(reports(&ended), [Event::ReferenceClock { position: Some(Position(1)) }]);
}
