//! Dispatch of observations.

use alloc::vec;
use core::time::Duration;

use super::findings::report_comparison;
use crate::event::Event;
use crate::ring::FrameLimit;
use crate::ring_status::CableErrors;
use crate::segment::cable_watch::CableWatch;
use crate::segment::effect::Effects;
use crate::segment::model::Segment;
use crate::segment::observation::Observation;
use crate::segment::ring::Cabled;
use crate::segment::versions::Versions;
use crate::segment::wake::Wake;
use crate::segment::words::Words;
use crate::time::Instant;

/// Pause between two tests of the number of datagrams per frame. Long frames delay a cycle, so there is a pause
/// whatever else disturbs the segment.
const FRAME_TESTS: Duration = Duration::from_secs(10);

impl Segment {
    /// Processes an observation. The effects must be executed in their order.
    pub fn observe(&mut self, seen: Observation<'_>, now: Instant) -> Effects {
        let mut effects = Effects::default();
        let is_apart = matches!(seen, Observation::Words(_) | Observation::Clocks(_) | Observation::Link(_));
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
            Words(words) => self.observe_words(&words, now, effects),
            Link(seen) => self.link_control.observe(seen, effects),
            Idle(seen) => self.observe_idle(seen, now, effects),
            PartOfRound { versions: v, readings: r, others: o, counted: c } => self.observe_part(v, r, o, c),
            Round(round_result) => self.observe_round(&round_result, now, effects),
            RoundEnded(number) => self.end_round(number, now),
            RoundWanted => self.attention.want(),
            RoundWantedIn(pause) => self.attention.again_in(pause, now),
            FramesTested => self.frames_tested_until = now + FRAME_TESTS,
            FramesLimited { versions, limit } => self.limit_frames(versions, limit, effects),
            ScanBegun => self.begin_requested_scan(effects),
            ScanShows { findings, subdevices } => self.report_scan(findings, subdevices, effects),
            Compared(finding) => report_comparison(finding, effects),
            ScanEnded(result) => self.end_scan(result, effects),
            FoundAgain { versions, found } => self.find_again(versions, found),
            Activated(declared) => self.activate(*declared, effects),
            Attached => self.begin_procedures(effects),
            Deactivated => self.deactivate(effects),
            #[cfg(feature = "standby")]
            Standby(seen) => self.observe_standby(seen, effects),
            MoreRead { key, more } => self.observe_more(key, more, effects),
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
            Searched { versions, result } => self.observe_search(versions, result, effects),
            Read { key, read } => self.observe_read(key, read, effects),
            Unexpected(key) => self.observe_unexpected(key, effects),
            Misfit { key, index, attempt, reason } => self.observe_misfit(key, (index, attempt), reason, effects),
            Held { key, index, attempt } => self.hold(key, (index, attempt), now, effects),
            Admitted { key, index, attempt, info } => self.observe_admitted(key, (index, attempt), *info, effects),
            LineChecked { versions, found, in_control } => self.check_line(versions, found, in_control, effects),
            Rescanned { versions, seen, words } => self.adopt(versions, seen, &words, effects),
            GroupsFollowed(changes) => self.hot_connect.follow(changes),
            Moved { versions, moved } => self.observe_moved(versions, moved, effects),
            CableErrors { versions, fresh } => self.observe_cable_errors(versions, fresh, now, effects),
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

    /// A round has ended; `number` is the latest result's.
    fn end_round(&mut self, number: Option<u32>, now: Instant) {
        self.attention.end(now);
        self.words.round.end(number);
    }

    fn limit_frames(&mut self, versions: Versions, limit: FrameLimit, effects: &mut Effects) {
        if versions.cabling != self.cabling.version || !self.was_all_in_reach(versions.isolations) {
            return;
        }
        self.frames_tested_until = Instant::NEVER;
        effects.report(Event::FrameLimit { limit });
    }

    fn observe_cable_errors(&mut self, versions: Versions, fresh: &[CableErrors], now: Instant, effects: &mut Effects) {
        // If the cabling was replaced since, the counts belong to other cables.
        if versions.cabling != self.cabling.version {
            return;
        }
        let cables = &mut self.cabling.cables;
        if self.cable_watches.0 != versions.cabling || self.cable_watches.1.len() != cables.len() {
            self.cable_watches = (versions.cabling, vec![CableWatch::default(); cables.len()]);
        }
        for (((cable, total), fresh), watch) in cables.iter_mut().zip(fresh).zip(&mut self.cable_watches.1) {
            *total = total.plus(*fresh);
            if let Some(errors) = watch.take(*fresh, now) {
                effects.report(Event::CableErrors { cable: *cable, errors });
            }
        }
    }

    fn observe_words(&mut self, words: &Words, now: Instant, effects: &mut Effects) {
        if !self.is_active() {
            return self.observe_idle_words(words, now, effects);
        }
        self.words.before.observe(words, self.board.clocks.holds(), &self.clocks);
        if !self.choices.supervision {
            return;
        }
        let disturbance = self.slot.running();
        let cabled = Cabled { topology: &self.cabling.topology, cables: &self.cabling.cables };
        let ring = self.ring.observe((&mut self.words, words), disturbance, &cabled, now, effects);
        let silence = self.observe_silence(words, now, effects);
        let reported = self.ring.reported();
        let evaluation = self.attention.observe((&mut self.words, words), reported, disturbance, now, effects);
        self.attention.wake = ring.or(evaluation).or(silence.map_or(Wake::NEVER, Wake::at));
    }
}
