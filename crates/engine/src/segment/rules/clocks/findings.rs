//! Effects of findings of clocks. Each is refused if what it was asked of has changed since:
//!
//! * all of them after the beginning of another set-up;
//! * measured times, answers and the end of a set-up, if SubDevices were out of reach on purpose meanwhile;
//! * values of one clock after it has lost its registers ([`ClockKey`](crate::segment::clocks::ClockKey)): what was
//!   read of, or written to, the registers before is not true of those that it has now;
//! * written delays and filters after a change of delays, of links or of references; written offsets and differences
//!   after another change of all offsets; the time of a reference after both;
//! * the end of a measurement, as far as the delays have become doubtful again since.

use alloc::string::String;

use crate::clocks::Measured;
use crate::declared::SubDeviceId;
use crate::event::Event;
use crate::link::Link;
use crate::segment::clocks::{
    ClockFinding, ClockKey, ClockVersions, Delays, Due, LatchedTimes, Life, Running, Unwritten,
};
use crate::segment::effect::Effects;
use crate::segment::model::Segment;
use crate::time::Instant;

impl Segment {
    /// Processes a finding of clocks, unless another set-up has begun since.
    pub(super) fn observe_clock_finding(
        &mut self,
        versions: &ClockVersions,
        seen: ClockFinding<'_>,
        now: Instant,
        effects: &mut Effects,
    ) {
        use ClockFinding::*;
        if versions.changes.set_ups != self.clocks.changes.set_ups {
            return;
        }
        let was_in_reach = self.was_all_in_reach(versions.isolations);
        match seen {
            SetUpFailed(reason) => self.observe_failed_set_up(Some(reason), effects),
            SetUp if was_in_reach => self.observe_set_up(effects),
            SetUp => self.observe_failed_set_up(None, effects),
            #[cfg(feature = "standby")]
            Adopted(adopted) => self.observe_adopted(adopted, now, effects),

            Cables(_)
            | OpenedWithoutResult(_)
            | Recalled(_)
            | Measured(_)
            | Latched { .. }
            | MeasuredAgain(_)
            | Answers { .. }
                if !was_in_reach => {}
            Cables(cables) => self.clocks.cables = cables,
            OpenedWithoutResult(wiring) => self.clocks.opened_without_result = wiring,
            Recalled(known) => self.observe_recall(known),
            Measured(measured) => self.clocks.take_over(measured),
            Latched { latched, wanted } => self.clocks.set_offsets(latched, wanted),
            MeasuredAgain(measured) => self.observe_measured_again(measured),
            Answers { answers, is_explained } => {
                if self.are_offsets_as_in(versions) {
                    self.observe_differences(answers, effects);
                }
                self.follow_links(answers, is_explained, versions.holds, now, effects);
            }
            DelaysWritten(link) => self.observe_written(link, versions),
            DelaysNotWritten(reason) => self.observe_not_written(reason, versions, effects),
            MeasurementEnded { failed } => self.observe_end_of_measurement(failed, versions, now, effects),
            Followed if self.are_delays_as_in(versions) => self.follow(versions.holds),
            Followed => {}
            FiltersWritten(filters) => self.observe_filters(filters, versions),

            NotLocked { member, attempt, reason, is_hidden } => {
                self.observe_not_locked((member, attempt), reason, is_hidden, effects);
            }
            OffsetRead { key, written_ns, read } => self.observe_read_offset(key, (written_ns, read), now),
            LatchedFor { key, latched, host } => self.observe_latched_for(key, latched, host),
            OneSetUp(key) => self.observe_one_set_up(key, versions),
            Compensated => self.clocks.end_compensation(),
            OffsetsWritten { missed } => self.observe_written_offsets(missed, versions, effects),
            SteppedBack { missed } => self.observe_stepped_back(missed),
            ReferenceTime { key, low, sent_at } => self.observe_reference_time((key, low, sent_at), versions, effects),
        }
    }

    /// A member needs clocks that are not locked. It is refused if the member was lost since.
    fn observe_not_locked(
        &self,
        (member, attempt): (usize, u32),
        reason: String,
        is_hidden: bool,
        effects: &mut Effects,
    ) {
        let is_current = self.member(member).is_some_and(|it| it.attempt == attempt);
        if is_current && self.clocks.goes_on_unlocked(is_hidden) {
            effects.report(Event::WentOnUnlocked { subdevice: SubDeviceId(member), reason });
        }
    }

    fn observe_not_written(&self, reason: String, versions: &ClockVersions, effects: &mut Effects) {
        if self.are_delays_as_in(versions) {
            effects.report(Event::ClocksFailed { reason });
        }
    }

    /// Whether the offsets are those of this version.
    pub(super) fn are_offsets_as_in(&self, versions: &ClockVersions) -> bool {
        versions.changes.offsets == self.clocks.changes.offsets
    }

    /// Whether delays, links and references are those of this version.
    pub(super) fn are_delays_as_in(&self, versions: &ClockVersions) -> bool {
        versions.changes.delays == self.clocks.changes.delays
    }

    /// No set-up has succeeded. Without a reason nothing is reported: the segment is not the one that was set up, and
    /// another set-up follows.
    fn observe_failed_set_up(&mut self, reason: Option<String>, effects: &mut Effects) {
        let reported = match &self.clocks.life {
            Life::NotSetUp(reported) => reported.clone(),
            Life::Undeclared | Life::Starting | Life::StartingWithoutBranches | Life::Running(_) => None,
        };
        if let Some(reason) = reason.clone().filter(|reason| reported.as_ref() != Some(reason)) {
            effects.report(Event::ClocksFailed { reason });
        }
        self.clocks.life = Life::NotSetUp(reason.or(reported));
        self.words.before.begin(&self.board);
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
        self.stop_if_unwritten();
    }

    /// The delays of a link are written. Those that have changed meanwhile are still to be written.
    fn observe_written(&mut self, link: Link, versions: &ClockVersions) {
        let is_current = self.are_delays_as_in(versions);
        if let Some(running) = self.clocks.running_mut().filter(|_| is_current) {
            running.unwritten.links[link.index()] = false;
        }
    }

    /// A measurement has ended. If SubDevices were out of reach meanwhile, another one follows, and time is distributed
    /// after that. If a clock has lost its registers meanwhile, another one follows as well.
    fn observe_end_of_measurement(
        &mut self,
        failed: Option<String>,
        versions: &ClockVersions,
        now: Instant,
        effects: &mut Effects,
    ) {
        let is_doubtful = failed.is_none() && versions.changes.doubts != self.clocks.changes.doubts;
        let was_in_reach = self.was_all_in_reach(versions.isolations);
        let Some(running) = self.clocks.running_mut() else { return };
        if failed.is_none() && !was_in_reach {
            return;
        }
        running.delays = if is_doubtful { Delays::Doubtful(now) } else { Delays::Valid };
        let Unwritten { clocks, largest_ns, links } = running.unwritten;
        match failed {
            Some(reason) => effects.report(Event::ClocksFailed { reason }),
            None => {
                running.unwritten = Unwritten { links, ..Unwritten::default() };
                if clocks > 0 {
                    effects.report(Event::DelaysChanged { clocks, largest_ns });
                }
            }
        }
        self.elect(effects);
        self.report_hidden(effects);
        self.write_or_follow(versions.holds);
    }

    /// Filter depths are written. Another procedure may have written them while others are due.
    fn observe_filters(&mut self, filters: &[(ClockKey, [u8; 2])], versions: &ClockVersions) {
        for (key, depths) in filters {
            if let Some(node) = self.clocks.node_of_mut(*key) {
                node.filter_depths = Some(*depths);
            }
        }
        let is_current = self.are_delays_as_in(versions);
        if let Some(running) = self.clocks.running_mut().filter(|running| is_current && running.due == Due::Filters) {
            running.due = Due::Nothing;
        }
    }

    /// A clock has lost its registers if it shows neither the offset that it had when that was asked for nor the one of
    /// now: steps may have been written meanwhile. A clock without a measured delay counts as lost too: its registers
    /// were never written.
    fn observe_read_offset(&mut self, key: ClockKey, (written_ns, read): (i64, u32), now: Instant) {
        let Some(node) = self.clocks.node_of_mut(key) else { return };
        let is_written = [written_ns, node.offset_ns].iter().any(|offset_ns| *offset_ns as u32 == read);
        if is_written && node.unit.is_some() {
            return;
        }
        node.losses = node.losses.wrapping_add(1);
        // The clock was measured without its registers, or will be.
        let is_known = node.is_unset && node.unit.is_some();
        (node.is_unset, node.latches_backwards, node.filter_depths) = (true, false, None);
        node.has_signals = false;
        if is_known {
            return;
        }
        if self.clocks.reference == Some(key.station) {
            self.clocks.refer_to(None);
        }
        self.doubt(now);
    }

    fn observe_latched_for(&mut self, key: ClockKey, latched: &LatchedTimes, host: u64) {
        if self.clocks.node_of(key).is_some() {
            self.clocks.set_offset(key.station, latched, host);
        }
    }

    /// Offset and delay of a clock are written. If all offsets have changed meanwhile, it is set up again.
    fn observe_one_set_up(&mut self, key: ClockKey, versions: &ClockVersions) {
        let is_missed = !self.are_offsets_as_in(versions);
        if let Some(node) = self.clocks.node_of_mut(key) {
            (node.is_unset, node.missed_offset) = (false, is_missed);
        }
    }

    /// Distributes time again, after delays are written where they count from another reference than before.
    pub(super) fn write_or_follow(&mut self, holds: u32) {
        let changed: [bool; 2] = Link::ALL.map(|link| self.clocks.refer(link));
        let Some(running) = self.clocks.running_mut() else { return };
        for link in Link::ALL {
            running.unwritten.links[link.index()] |= changed[link.index()];
        }
        match self.stop_if_unwritten() {
            true => self.set_due(Due::Delays),
            false => self.follow(holds),
        }
    }

    /// No time is distributed while delays have different origins. Returns whether some are not yet written.
    fn stop_if_unwritten(&mut self) -> bool {
        let is_unwritten = |running: &Running| running.unwritten.links.contains(&true);
        let stops = self.clocks.running().is_some_and(is_unwritten);
        if stops {
            self.board.clocks.post_references(crate::board::clocks::References::default());
        }
        stops
    }
}
