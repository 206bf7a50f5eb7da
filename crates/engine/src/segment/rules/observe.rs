//! Dispatch of observations.

use alloc::vec::Vec;

use crate::event::Event;
use crate::ring_status::CableErrors;
use crate::segment::effect::Effects;
use crate::segment::model::Segment;
use crate::segment::observation::Observation;
use crate::segment::ring::{Cabled, Words};
use crate::segment::versions::Versions;
use crate::time::Instant;

impl Segment {
    /// Processes an observation. The effects must be executed in their order.
    pub fn observe(&mut self, seen: Observation<'_>, now: Instant) -> Effects {
        let mut effects = Effects::default();
        self.take(seen, now, &mut effects);
        self.hot_connect.observe(&self.subdevices, &mut effects);
        self.keep_undeclared(now, &mut effects);
        effects
    }

    /// Processes an observation.
    fn take(&mut self, seen: Observation<'_>, now: Instant, effects: &mut Effects) {
        match seen {
            Observation::Words(words) if self.is_active() => self.observe_words(&words, now, effects),
            Observation::Words(words) => self.observe_idle_words(&words, now, effects),
            Observation::Idle(seen) => self.observe_idle(seen, now, effects),
            Observation::PartOfRound { versions, readings, others, counted } => {
                self.observe_part_of_round(versions, readings, others, counted);
            }
            Observation::Round(round_result) => self.observe_round(&round_result, now, effects),
            Observation::RoundEnded(number) => self.attention.end(number, now),
            Observation::RoundWanted => self.attention.want(),
            Observation::RoundWantedIn(pause) => self.attention.again_in(pause, now),
            Observation::FramesTested(until) => self.frames_tested_until = until,
            Observation::FramesLimited(limit) => {
                self.frames_tested_until = Instant::NEVER;
                effects.report(Event::FrameLimit { limit });
            }
            Observation::ScanBegun => self.begin_scan(),
            Observation::ScanShows(findings) => self.report_findings(findings, effects),
            Observation::Compared(event) => effects.report(event),
            Observation::ScanEnded(result) => self.end_scan(result, effects),
            Observation::FoundAgain { versions, found } => self.find_again(versions, found),
            Observation::Activated(declared) => self.activate(*declared, effects),
            Observation::Attached => self.begin_procedures(effects),
            Observation::Deactivated => self.deactivate(),
            Observation::SiiCompleted { key, read } => self.observe_whole_sii(key, read, effects),
            Observation::Started => self.start_all(effects),
            Observation::OfMember { index, attempt, finding } => {
                self.observe_finding((index, attempt), finding, now, effects);
            }
            Observation::Proven { index, mapping } => self.observe_proof(index, mapping),
            Observation::NotProven { index, mapping, what } => {
                self.observe_missing_inputs((index, mapping), what, effects);
            }
            Observation::Requested { subdevice, state } => self.observe_request(subdevice, state, now, effects),
            Observation::Retried(subdevice) => self.observe_retry(subdevice, now),
            Observation::Undeclared(seen) => self.observe_undeclared(seen, now, effects),
            Observation::IncidentsForgotten => self.forget_incidents(),
            Observation::Places { versions, view } => self.observe_places(versions, view),
            Observation::Readdressing(old) => self.observe_readdressing(old),
            Observation::Offered(station) => self.addresses.offered(station),
            Observation::Given { versions, view, given } => self.observe_given(versions, view, given, now, effects),
            Observation::Searched(result) => self.observe_search(result, effects),
            Observation::Read { key, read } => self.observe_read(key, read, effects),
            Observation::Unexpected(key) => self.observe_unexpected(key, effects),
            Observation::Misfit { key, index, attempt, reason } => {
                self.observe_misfit(key, (index, attempt), reason, effects);
            }
            Observation::Held { key, index, attempt } => self.hold(key, (index, attempt), now, effects),
            Observation::Admitted { key, index, attempt, info } => {
                self.observe_admitted(key, (index, attempt), *info, effects);
            }

            Observation::LineChecked { versions, found, in_control } => {
                self.observe_line_check(versions, found, in_control, effects);
            }
            Observation::Rescanned { versions, seen, words } => self.adopt(versions, seen, &words, effects),
            Observation::GroupsFollowed(changes) => self.hot_connect.follow(changes),
            Observation::Moved { versions, moved } => self.observe_moved(versions, moved, effects),
            Observation::CableErrors { versions, fresh, rising } => {
                self.observe_cable_errors(versions, (fresh, rising), effects);
            }
            Observation::Clocks(seen) => self.observe_clocks(seen, now, effects),
            Observation::Wanted(wanted) => self.slot.want(wanted),
            Observation::Undisturbed(number) => self.slot.end(number),
            Observation::Isolated { versions, found, words } => {
                self.observe_isolated(versions, found, (&words, now), effects);
            }
            Observation::PortsOrdered { station, control } => self.begin_order(station, control),
            Observation::PortsWritten(station) => self.end_order(station),
            Observation::PortsRead { station, orders, control } => self.note_control(station, orders, control),
            Observation::Blocked(ports) => self.blocked.extend(ports),
            Observation::Unblocking => self.blocked.clear(),
        }
    }

    fn observe_cable_errors(
        &mut self,
        versions: Versions,
        (fresh, rising): (&[CableErrors], Vec<Event>),
        effects: &mut Effects,
    ) {
        // If the cabling was replaced since, the counts belong to other cables.
        if versions.cabling != self.cabling.version {
            return;
        }
        for ((_, total), fresh) in self.cabling.cables.iter_mut().zip(fresh) {
            *total = total.plus(*fresh);
        }
        rising.into_iter().for_each(|event| effects.report(event));
    }

    fn observe_words(&mut self, words: &Words, now: Instant, effects: &mut Effects) {
        let disturbance = self.slot.running();
        let cabled = Cabled { topology: &self.cabling.topology, cables: &self.cabling.cables };
        let ring = self.ring.observe(words, disturbance, &cabled, now, effects);
        let silence = self.observe_silence(words, now, effects);
        let reported = self.ring.reported();
        let evaluation = self.attention.observe(words, reported, disturbance, now, effects);
        self.attention.wake = [ring, silence, Some(evaluation)].into_iter().flatten().min().unwrap_or(Instant::NEVER);
    }
}
