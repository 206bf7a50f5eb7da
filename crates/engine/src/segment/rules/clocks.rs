//! Effects of observations of clocks (protocol 7).

#[cfg(feature = "standby")]
mod adopt;
mod answers;
mod delays;
mod findings;
mod times;

use ringcat_wire::address::Position;

use crate::clocks::{Cables, KnownClocks};
use crate::config::ReferenceClock;
use crate::event::Event;
use crate::link::Link;
use crate::segment::clocks::{ClockKey, ClockObservation, Compensation, Delays, Due, HiddenDelay, Life, Node, Running};
use crate::segment::effect::{Effects, Task};
use crate::segment::model::Segment;
use crate::time::Instant;

impl Segment {
    /// Processes an observation of clocks.
    pub(super) fn observe_clocks(&mut self, seen: ClockObservation<'_>, now: Instant, effects: &mut Effects) {
        match seen {
            ClockObservation::Found(versions, finding) => {
                self.observe_clock_finding(&versions, finding, now, effects);
            }
            ClockObservation::ReferenceChosen(reference) => self.observe_choice(reference, effects),
            ClockObservation::Known(known) => self.known_clocks = Some(known),
            ClockObservation::SetUpBegun => self.observe_begun_set_up(),
            ClockObservation::SegmentChanged => self.doubt(now),
            ClockObservation::Came { member } => self.observe_clock(member),
            ClockObservation::TimeWanted => self.compensate(effects),
            ClockObservation::LatchModes(modes) => self.observe_latch_modes(modes),
            ClockObservation::Signals { key, are_starting } => {
                if let Some(node) = self.clocks.node_of_mut(key) {
                    node.has_signals = are_starting;
                }
            }
            ClockObservation::SlideBegun => {
                self.clocks.times.take_shift_in_effect(self.board.clocks.times.wanted());
            }
            ClockObservation::SteppingBack(step_ns) => self.observe_step_back(step_ns),
        }
        self.post_clock_words();
    }

    /// Posts the clock words for the exchange.
    fn post_clock_words(&self) {
        let words = &self.board.clocks;
        if matches!(self.clocks.life, Life::NotSetUp(_) | Life::Running(_)) && self.clocks.is_any() {
            words.guard_ports();
        }
        let in_front = |link| self.clocks.in_front_on(link).is_some_and(|(_, nodes)| !nodes.is_empty());
        words.post_in_front(Link::ALL.into_iter().any(in_front));
    }

    fn observe_set_up(&mut self, effects: &mut Effects) {
        self.clocks.life = Life::Running(Running::default());
        self.words.before.begin(&self.board);
        // What the exchange predicts until it has read a reference: the application's time may be another one by now.
        let epoch = self.clocks.epoch;
        self.board.clocks.times.post_timeline(self.clocks.times.turn(0, (0, 0), epoch));
        self.board.clocks.post_references(self.clocks.references());
        self.report_reference(effects);
        self.report_hidden(effects);
        if self.clocks.elect(|_| true) != self.clocks.reference {
            // Another reference was chosen meanwhile.
            self.observe_choice(self.clocks.config.reference, effects);
        }
        self.compensate(effects);
    }

    /// The segment has changed. The delays of clocks that are set up are doubtful until they are measured again; a
    /// failure of the set-up is reported anew.
    fn doubt(&mut self, now: Instant) {
        self.clocks.changes.doubts = self.clocks.changes.doubts.wrapping_add(1);
        match &mut self.clocks.life {
            Life::Running(Running { delays: delays @ Delays::Valid, .. }) => *delays = Delays::Doubtful(now),
            Life::NotSetUp(reported) => *reported = None,
            Life::Undeclared | Life::Starting | Life::StartingWithoutBranches | Life::Running(_) => {}
        }
    }

    /// Cable times and latch modes are those of a former measurement.
    fn observe_recall(&mut self, known: &KnownClocks) {
        self.clocks.cables = Cables::of(&known.cables);
        for node in &mut self.clocks.nodes {
            node.latches_backwards |= known.backwards.contains(&node.station);
        }
    }

    fn observe_latch_modes(&mut self, modes: &[(ClockKey, bool)]) {
        for (key, backwards) in modes {
            if let Some(node) = self.clocks.node_of_mut(*key) {
                node.latches_backwards = *backwards;
            }
        }
    }

    /// The static drift compensation starts, unless it is under way.
    fn compensate(&mut self, effects: &mut Effects) {
        let Some(running) = self.clocks.running_mut() else { return };
        if running.compensation == Compensation::Idle && !self.board.clocks.times.is_called() {
            running.compensation = Compensation::Running;
            effects.start(Task::CompensateDrift);
        }
    }

    /// A clock that was not found by the scan.
    fn observe_clock(&mut self, member: usize) {
        let Some(declared) = self.subdevices.member(member) else { return };
        if let Some(info) = declared.info
            && self.clocks.of_member(member).is_none()
        {
            self.clocks.nodes.push(Node::new(info, Some((member, &*declared.config))));
        }
    }

    /// Posts the wanted references and resumes the distribution.
    fn follow(&mut self, holds: u32) {
        self.board.clocks.post_references(self.clocks.references());
        self.board.clocks.answer(holds);
        self.set_due(Due::Filters);
    }

    fn set_due(&mut self, due: Due) {
        if let Some(running) = self.clocks.running_mut() {
            running.due = due;
        }
    }

    /// Replaces a lost reference. Returns whether there is another one.
    fn elect(&mut self, effects: &mut Effects) -> bool {
        let clocks = &mut self.clocks;
        let before = clocks.reference;
        let is_there = |node: &Node| node.link.is_some() && !node.is_unset;
        if !clocks.reference_node().is_some_and(is_there) {
            clocks.refer_to(clocks.elect(|node| node.link.is_some() && node.unit.is_some()));
        }
        if clocks.reference == before {
            return false;
        }
        self.report_reference(effects);
        true
    }

    /// The next answers show that the distributed references are others: delays are written from the new one first.
    fn observe_choice(&mut self, reference: ReferenceClock, effects: &mut Effects) {
        self.clocks.config.reference = reference;
        if !self.clocks.are_set_up() {
            return;
        }
        let chosen = self.clocks.elect(|node| node.link.is_some() && node.unit.is_some());
        if chosen.is_some() && chosen != self.clocks.reference {
            self.clocks.refer_to(chosen);
            self.report_reference(effects);
        }
    }

    fn report_reference(&self, effects: &mut Effects) {
        let reference = self.clocks.reference_node();
        let event = Event::ReferenceClock { position: reference.map(|node| Position(node.position)) };
        match reference {
            Some(node) => effects.report_of(event, self.occupant(node.station)),
            None => effects.report(event),
        }
    }

    /// Reports delays that are not known, except those that are already reported.
    fn report_hidden(&mut self, effects: &mut Effects) {
        for index in 0..self.clocks.nodes.len() {
            let hidden = self.clocks.hidden(&self.clocks.nodes[index]);
            let node = &mut self.clocks.nodes[index];
            let fork = |hidden: HiddenDelay| hidden.fork.map(|fork| usize::from(fork.0));
            let now = hidden.map(|hidden| (fork(hidden), hidden.is_estimated));
            let before = core::mem::replace(&mut node.reported_hidden, now);
            let Some(HiddenDelay { fork, range, is_estimated }) = hidden.filter(|_| now != before) else { continue };
            let (position, station) = (Position(node.position), node.station);
            let event = Event::DelayUnknown { position, fork, range, is_estimated };
            effects.report_of(event, self.occupant(station));
        }
    }
}
