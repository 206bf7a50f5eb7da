//! Dispatch of observations.

use alloc::vec::Vec;

use crate::event::Event;
use crate::ring::FrameLimit;
use crate::ring_status::CableErrors;
use crate::segment::effect::Effects;
use crate::segment::model::Segment;
use crate::segment::observation::Observation;
use crate::segment::ring::{Cabled, Words};
use crate::segment::versions::Versions;
use crate::segment::wake::Wake;
use crate::time::Instant;

impl Segment {
    /// Processes an observation. The effects must be executed in their order.
    pub fn observe(&mut self, seen: Observation<'_>, now: Instant) -> Effects {
        let mut effects = Effects::default();
        let is_apart = matches!(seen, Observation::Words(_) | Observation::Clocks(_));
        self.observed = self.observed.wrapping_add(u32::from(!is_apart));
        self.take(seen, now, &mut effects);
        self.hot_connect.observe(&self.subdevices, &mut effects);
        self.keep_undeclared(now, &mut effects);
        effects
    }

    /// Processes an observation.
    fn take(&mut self, seen: Observation<'_>, now: Instant, effects: &mut Effects) {
        use Observation::*;
        match seen {
            Words(words) if self.is_active() => self.observe_words(&words, now, effects),
            Words(words) => self.observe_idle_words(&words, now, effects),
            Idle(seen) => self.observe_idle(seen, now, effects),
            PartOfRound { versions: v, readings: r, others: o, counted: c } => self.observe_part(v, r, o, c),
            Round(round_result) => self.observe_round(&round_result, now, effects),
            RoundEnded(number) => self.attention.end(number, now),
            RoundWanted => self.attention.want(),
            RoundWantedIn(pause) => self.attention.again_in(pause, now),
            FramesTested(until) => self.frames_tested_until = until,
            FramesLimited(limit) => self.limit_frames(limit, effects),
            ScanBegun => self.begin_scan(true),
            ScanShows(findings) => self.report_findings(findings, effects),
            Compared(event) => effects.report(event),
            ScanEnded(result) => self.end_scan(result, effects),
            FoundAgain { versions, found } => self.find_again(versions, found),
            Activated(declared) => self.activate(*declared, effects),
            Attached => self.begin_procedures(effects),
            Deactivated => self.deactivate(),
            #[cfg(feature = "standby")]
            Standby(seen) => self.observe_standby(seen, effects),
            SiiCompleted { key, read } => self.observe_whole_sii(key, read, effects),
            Started => self.start_all(effects),
            OfMember { index, attempt, finding } => self.observe_finding((index, attempt), finding, now, effects),
            Proven { index, mapping } => self.observe_proof(index, mapping),
            NotProven { index, mapping, what } => self.observe_missing_inputs((index, mapping), what, effects),
            Requested { subdevice, state } => self.observe_request(subdevice, state, now, effects),
            Retried(subdevice) => self.observe_retry(subdevice, now),
            Undeclared(seen) => self.observe_undeclared(seen, now, effects),
            IncidentsForgotten => self.forget_incidents(),
            Places { versions, view } => self.observe_places(versions, view),
            Readdressing(old) => self.observe_readdressing(old),
            Offered(station) => self.addresses.offered(station),
            Given { versions, view, given } => self.observe_given(versions, view, given, now, effects),
            Searched(result) => self.observe_search(result, effects),
            Read { key, read } => self.observe_read(key, read, effects),
            Unexpected(key) => self.observe_unexpected(key, effects),
            Misfit { key, index, attempt, reason } => self.observe_misfit(key, (index, attempt), reason, effects),
            Held { key, index, attempt } => self.hold(key, (index, attempt), now, effects),
            Admitted { key, index, attempt, info } => self.observe_admitted(key, (index, attempt), *info, effects),
            LineChecked { versions, found, in_control } => self.check_line(versions, found, in_control, effects),
            Rescanned { versions, seen, words } => self.adopt(versions, seen, &words, effects),
            GroupsFollowed(changes) => self.hot_connect.follow(changes),
            Moved { versions, moved } => self.observe_moved(versions, moved, effects),
            CableErrors { versions, fresh, rising } => self.observe_cable_errors(versions, (fresh, rising), effects),
            Clocks(seen) => self.observe_clocks(seen, now, effects),
            Wanted(wanted) => self.slot.want(wanted),
            Undisturbed(number) => self.slot.end(number),
            Isolated { versions, found, words } => self.observe_isolated(versions, found, (&words, now), effects),
            PortsFollowed(station) => self.follow_ports(station),
            PortsAltered(before) => self.alter_ports(before),
            PortsOrdered { station, control } => self.begin_order(station, control),
            PortsWritten(station) => self.end_order(station),
            PortsRead { station, orders, control } => self.note_control(station, orders, control),
            Blocked(ports) => self.blocked.extend(ports),
            Unblocking => self.blocked.clear(),
        }
    }

    fn limit_frames(&mut self, limit: FrameLimit, effects: &mut Effects) {
        self.frames_tested_until = Instant::NEVER;
        effects.report(Event::FrameLimit { limit });
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
        self.compared.observe(words, self.board.clocks.holds(), &self.clocks);
        if !self.choices.supervision {
            return;
        }
        let disturbance = self.slot.running();
        let cabled = Cabled { topology: &self.cabling.topology, cables: &self.cabling.cables };
        let ring = self.ring.observe(words, disturbance, &cabled, now, effects);
        let silence = self.observe_silence(words, now, effects);
        let reported = self.ring.reported();
        let evaluation = self.attention.observe(words, reported, disturbance, now, effects);
        self.attention.wake = ring.or(evaluation).or(silence.map_or(Wake::NEVER, Wake::at));
    }
}
