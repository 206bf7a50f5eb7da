//! Effects of observations of clocks (protocol 7).

#[cfg(feature = "standby")]
mod adopt;
mod answers;
mod delays;
mod times;

use alloc::string::String;
use alloc::vec::Vec;

use ringcat_wire::address::{Position, StationAddress};

use crate::board::clocks::References;
use crate::clocks::{Cables, KnownClocks, Measured};
use crate::config::ReferenceClock;
use crate::declared::SubDeviceId;
use crate::event::Event;
use crate::link::Link;
use crate::segment::clocks::{
    ClockObservation, Compensation, Delays, Due, HiddenDelay, Life, Node, Running, Unwritten,
};
use crate::segment::effect::{Effects, Task};
use crate::segment::model::Segment;
use crate::time::Instant;

impl Segment {
    /// Processes an observation of clocks.
    pub(super) fn observe_clocks(&mut self, seen: ClockObservation<'_>, now: Instant, effects: &mut Effects) {
        match seen {
            ClockObservation::ReferenceChosen(reference) => self.observe_choice(reference, effects),
            ClockObservation::SetUpBegun => self.observe_begun_set_up(),
            ClockObservation::SetUpFailed(reason) => self.observe_failed_set_up(reason, effects),
            ClockObservation::SegmentChanged => self.doubt(now),
            ClockObservation::LatchModes(modes) => self.observe_latch_modes(modes),
            ClockObservation::Cables(cables) => self.clocks.cables = cables,
            ClockObservation::OpenedWithoutResult(wiring) => self.clocks.opened_without_result = wiring,
            ClockObservation::Known(known) => self.known_clocks = Some(known),
            ClockObservation::Recalled(known) => self.observe_recall(known),
            ClockObservation::Measured(measured) => self.clocks.take_over(measured),
            ClockObservation::Latched { latched, wanted } => self.clocks.set_offsets(latched, wanted),
            ClockObservation::SetUp => self.observe_set_up(effects),
            #[cfg(feature = "standby")]
            ClockObservation::Adopted(adopted) => self.observe_adopted(adopted, now, effects),

            ClockObservation::MeasuredAgain(measured) => self.observe_measured_again(measured),
            ClockObservation::DelaysWritten(link) => self.observe_written(link),
            ClockObservation::DelaysNotWritten(reason) => effects.report(Event::ClocksFailed { reason }),
            ClockObservation::MeasurementEnded { failed, holds } => {
                self.observe_end_of_measurement(failed, holds, effects);
            }
            ClockObservation::WentOnUnlocked { member, reason } => {
                effects.report(Event::WentOnUnlocked { subdevice: SubDeviceId(member), reason });
            }
            ClockObservation::FiltersWritten(filters) => self.observe_filters(filters),

            ClockObservation::Came { member } => self.observe_clock(member),
            ClockObservation::RegistersLost(station) => self.observe_lost_registers(station, now),
            ClockObservation::LatchedFor { station, latched, host } => self.clocks.set_offset(station, latched, host),
            ClockObservation::OneSetUp(station) => {
                if let Some(node) = self.clocks.node_at_mut(station) {
                    (node.is_unset, node.missed_offset) = (false, false);
                }
            }
            ClockObservation::TimeWanted => self.compensate(effects),
            ClockObservation::Compensated => {
                if let Some(running) = self.clocks.running_mut() {
                    running.compensation = Compensation::Idle;
                }
            }

            ClockObservation::Answers { answers, is_explained, holds } => {
                self.observe_differences(answers, effects);
                self.follow_links(answers, is_explained, holds, now, effects);
            }
            ClockObservation::Followed { holds } => self.follow(holds),
            ClockObservation::Signals { station, are_starting } => {
                if let Some(node) = self.clocks.node_at_mut(station) {
                    node.has_signals = are_starting;
                }
            }
            seen => self.observe_time(seen, effects),
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

    fn observe_failed_set_up(&mut self, reason: String, effects: &mut Effects) {
        let reported = match &self.clocks.life {
            Life::NotSetUp(reported) => reported.as_ref(),
            Life::Undeclared | Life::Starting | Life::StartingWithoutBranches | Life::Running(_) => None,
        };
        if reported != Some(&reason) {
            effects.report(Event::ClocksFailed { reason: reason.clone() });
        }
        self.clocks.life = Life::NotSetUp(Some(reason));
        self.compared.begin(&self.board);
    }

    fn observe_set_up(&mut self, effects: &mut Effects) {
        self.clocks.life = Life::Running(Running::default());
        self.compared.begin(&self.board);
        // What the exchange predicts until it has read a reference: the application's time may be another one by now.
        let epoch = self.clocks.epoch;
        self.board.clocks.times.post_timeline(self.clocks.times.turn(0, (0, 0), epoch));
        self.board.clocks.post_references(self.clocks.references());
        self.report_reference(effects);
        self.report_hidden(effects);
        self.compensate(effects);
    }

    /// The segment has changed. The delays of clocks that are set up are doubtful until they are measured again; a
    /// failure of the set-up is reported anew.
    fn doubt(&mut self, now: Instant) {
        match &mut self.clocks.life {
            Life::Running(Running { delays: delays @ Delays::Valid, .. }) => *delays = Delays::Doubtful(now),
            Life::NotSetUp(reported) => *reported = None,
            Life::Undeclared | Life::Starting | Life::StartingWithoutBranches | Life::Running(_) => {}
        }
    }

    /// Cable times and latch modes are those of a former measurement.
    fn observe_recall(&mut self, known: &KnownClocks) {
        self.clocks.cables = Cables::of(&known.cables);
        let modes: Vec<(StationAddress, bool)> = known.backwards.iter().map(|it| (*it, true)).collect();
        self.observe_latch_modes(&modes);
    }

    fn observe_latch_modes(&mut self, modes: &[(StationAddress, bool)]) {
        for node in &mut self.clocks.nodes {
            if let Some((_, backwards)) = modes.iter().find(|(station, _)| *station == node.station) {
                node.latches_backwards = *backwards;
            }
        }
    }

    fn observe_filters(&mut self, filters: &[(StationAddress, [u8; 2])]) {
        for (station, depths) in filters {
            if let Some(node) = self.clocks.node_at_mut(*station) {
                node.filter_depths = Some(*depths);
            }
        }
        // Another procedure may have written them while delays or offsets are due.
        if let Some(running) = self.clocks.running_mut().filter(|running| running.due == Due::Filters) {
            running.due = Due::Nothing;
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

    fn observe_lost_registers(&mut self, station: StationAddress, now: Instant) {
        let Some(node) = self.clocks.node_at_mut(station) else { return };
        (node.is_unset, node.latches_backwards, node.filter_depths) = (true, false, None);
        node.has_signals = false;
        if self.clocks.reference == Some(station) {
            self.clocks.reference = None;
        }
        self.doubt(now);
    }

    fn observe_measured_again(&mut self, measured: &Measured) {
        let changes = self.clocks.measure_again(measured);
        let Some(running) = self.clocks.running_mut() else { return };
        for link in changes.links {
            running.unwritten.links[link.index()] = true;
        }
        if changes.clocks > 0 {
            (running.unwritten.clocks, running.unwritten.largest_ns) = (changes.clocks, changes.largest_ns);
        }
        if running.unwritten.links.contains(&true) {
            // No time is distributed while delays have different origins.
            self.board.clocks.post_references(References::default());
        }
    }

    fn observe_written(&mut self, link: Link) {
        if let Some(running) = self.clocks.running_mut() {
            running.unwritten.links[link.index()] = false;
        }
    }

    fn observe_end_of_measurement(&mut self, failed: Option<String>, holds: u32, effects: &mut Effects) {
        let Some(running) = self.clocks.running_mut() else { return };
        running.delays = Delays::Valid;
        let Unwritten { clocks, largest_ns, .. } = running.unwritten;
        match failed {
            Some(reason) => effects.report(Event::ClocksFailed { reason }),
            None => {
                running.unwritten = Unwritten::default();
                if clocks > 0 {
                    effects.report(Event::DelaysChanged { clocks, largest_ns });
                }
            }
        }
        self.elect(effects);
        self.report_hidden(effects);
        self.follow(holds);
    }

    /// Posts the wanted references and resumes the distribution.
    fn follow(&mut self, holds: u32) {
        self.board.clocks.post_references(self.clocks.references());
        self.board.clocks.answer(holds);
        if let Some(running) = self.clocks.running_mut() {
            running.due = Due::Filters;
        }
    }

    /// Replaces a lost reference. Returns whether there is another one.
    fn elect(&mut self, effects: &mut Effects) -> bool {
        let clocks = &mut self.clocks;
        let before = clocks.reference;
        let is_there = |node: &Node| node.link.is_some() && !node.is_unset;
        if !clocks.reference_node().is_some_and(is_there) {
            clocks.reference = clocks.elect(|node| node.link.is_some() && node.unit.is_some());
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
            self.clocks.reference = chosen;
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
