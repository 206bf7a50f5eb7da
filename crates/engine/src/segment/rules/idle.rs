//! Without an application: changes of links, number and states of the SubDevices, and the scans and reads that follow.

use alloc::rc::Rc;
use alloc::string::String;

use crate::event::Event;
use crate::ring::RingState;
use crate::segment::effect::{Effects, Task, Watch};
use crate::segment::idle::{Change, Comparison, Differences, IdleObservation, PATIENCE, SILENT, Work};
use crate::segment::model::Segment;
use crate::segment::scan::Found;
use crate::segment::stage::Stage;
use crate::segment::undeclared::{ShownState, StateRead};
use crate::segment::versions::Versions;
use crate::segment::words::{Broadcast, Words};
use crate::time::Instant;

impl Segment {
    /// Whether a procedure of idle operation works on the segment.
    pub fn is_idle_busy(&self) -> bool {
        self.idle.work != Work::Nothing
    }

    /// Whether the ring is open on purpose, for a measurement.
    pub fn is_measuring(&self) -> bool {
        self.idle.work == Work::Measurement
    }

    /// Number of changes that broadcasts have shown; it changes with each.
    pub fn idle_changes(&self) -> u32 {
        self.idle.changes
    }

    /// Number of the last request for a rescan.
    pub fn last_rescan_asked(&self) -> u64 {
        self.idle.rescans.asked
    }

    /// What the rescan with this number has found, or a later one.
    pub fn rescanned(&self, number: u64) -> Option<&Differences> {
        let (ended, differences) = &self.idle.rescans.ended;
        (*ended >= number).then_some(differences)
    }

    /// Processes the answer to a broadcast. It is compared with what follows from the list of SubDevices; in operation,
    /// where states change by the application's own steps, words are compared with those of the last round.
    pub(in crate::segment) fn observe_idle_words(&mut self, words: &Words, now: Instant, effects: &mut Effects) {
        self.ring.observe_carriers(words.carriers(), now, effects);
        let Some(shown) = words.broadcast() else { return };
        self.idle.silent = 0;
        self.evaluate_broadcast(shown, words.ring_state(), now, effects);
    }

    /// Processes an observation without an application.
    pub(in crate::segment) fn observe_idle(&mut self, seen: IdleObservation<'_>, now: Instant, effects: &mut Effects) {
        match seen {
            IdleObservation::Begun => {
                for watch in [Watch::Undeclared, Watch::UndeclaredMail, Watch::Idle] {
                    effects.start(Task::Watch(watch));
                }
                if self.choices.dictionaries {
                    effects.start(Task::Watch(Watch::Dictionaries));
                }
            }
            IdleObservation::Watched(carriers, state) => {
                self.idle = self.idle.renewed();
                self.ring.begin_idle(carriers, state);
                self.words.begin_idle();
            }
            IdleObservation::Unanswered(words) => self.observe_silence_of_all(&words, now, effects),
            IdleObservation::Scanned => {
                self.idle.end(Work::FirstScan);
                self.keep_scanned(now);
            }
            IdleObservation::RescanAsked => self.idle.rescans.asked += 1,
            IdleObservation::Followed { versions, found, wanted } => {
                self.idle.read(false);
                self.idle.end(Work::Follow);
                self.end_follow((versions, found), wanted, now, effects);
            }
            IdleObservation::NotFollowed(reason) => {
                self.idle.read(false);
                self.idle.end(Work::Follow);
                self.fail_to_follow(reason, effects);
            }
            IdleObservation::StatesRead(read) => {
                self.idle.end(Work::ReadStates);
                self.observe_idle_states(read, now, effects);
            }
            IdleObservation::ReadingBegun(readdressed) => {
                self.idle.read(true);
                self.idle.readdressed = readdressed.to_vec();
            }
            IdleObservation::ReadingEnded => self.idle.read(false),
            IdleObservation::SomeRead(read) => self.observe_idle_states(read, now, effects),
            IdleObservation::Measuring => self.idle.work = Work::Measurement,
            IdleObservation::Measured => self.idle.end(Work::Measurement),
            IdleObservation::Deactivating => self.idle.work = Work::Deactivation,
            IdleObservation::Deactivated => self.idle.end(Work::Deactivation),
        }
    }

    /// A broadcast was lost, or no link has a carrier. A single lost frame is no evidence yet.
    fn observe_silence_of_all(&mut self, words: &Words, now: Instant, effects: &mut Effects) {
        self.ring.observe_carriers(words.carriers(), now, effects);
        let is_unplugged = words.is_unplugged();
        if !is_unplugged {
            self.idle.silent = self.idle.silent.saturating_add(1);
        }
        if is_unplugged || self.idle.silent >= SILENT {
            self.evaluate_broadcast(Broadcast::unanswered(is_unplugged), words.ring_state(), now, effects);
        }
    }

    fn evaluate_broadcast(&mut self, shown: Broadcast, ring: RingState, now: Instant, effects: &mut Effects) {
        if self.is_scanning() || self.is_active() || self.is_measuring() {
            return;
        }
        self.ring.observe_broadcast(ring, shown.counts(), now, effects);
        if self.idle.is_visible() {
            self.note_change(&shown, effects);
        }
        if self.is_idle_busy() {
            return;
        }
        let Some(scanned) = self.found().map(|found| found.counts()) else {
            if shown.has_answer() {
                self.begin_scan(false);
                let number = self.scan_number();
                self.begin_work((Work::FirstScan, Task::ScanSegment { number }), effects);
            }
            return;
        };
        self.keep_scanned(now);
        if self.idle.compared == Comparison::Open {
            self.idle.compared = Comparison::Same(scanned);
        }
        let wanted = self.idle.wanted();
        let is_same = matches!(self.idle.compared, Comparison::Same(scanned) if shown.shows(scanned));
        if !is_same || wanted.is_some() {
            return self.follow_change(shown, wanted, effects);
        }
        self.compare_states(shown, effects);
    }

    /// An unexpected OR of the states: which SubDevice shows it is read at once. States that others hide in the OR, and
    /// addresses, are read in turn.
    fn compare_states(&mut self, shown: Broadcast, effects: &mut Effects) {
        let expected = self.expected_states();
        if self.words.scan.has_other_states(&shown, expected) && self.are_undeclared_settled() {
            self.words.scan.note_read_for(&shown);
            self.begin_work((Work::ReadStates, Task::ReadStates), effects);
        }
    }

    /// Another number of SubDevices is reported at once, also while a procedure works on the segment: what it finds is
    /// outdated then.
    fn note_change(&mut self, shown: &Broadcast, effects: &mut Effects) {
        // The first scan counts by itself.
        let Some(found) = self.found().map(|found| found.counts()) else { return };
        if self.words.scan.has_other_count(shown, found) {
            let counts = shown.counts();
            effects.report(Event::Counted { main: counts.main, redundant: counts.redundant });
            self.idle.changes = self.idle.changes.wrapping_add(1);
        }
    }

    /// SubDevices of the last scan are kept in their states from now on.
    fn keep_scanned(&mut self, now: Instant) {
        if !self.is_scanning() && self.has_untouched() {
            self.take_over(now);
        }
    }

    fn begin_work(&mut self, (work, task): (Work, Task), effects: &mut Effects) {
        self.idle.work = work;
        effects.start(task);
    }

    /// The segment has changed, or a rescan is requested.
    fn follow_change(&mut self, shown: Broadcast, wanted: Option<u64>, effects: &mut Effects) {
        let (counts, ports_changed, is_unplugged) = (shown.counts(), shown.ports_changed(), shown.is_unplugged());
        if matches!(self.idle.compared, Comparison::Same(_)) {
            self.idle.compared = Comparison::CHANGED;
        }
        let change = Change { counts, ports_changed, is_unplugged, wanted };
        self.begin_work((Work::Follow, Task::FollowChange(change)), effects);
    }

    /// The segment is known again. A result from before another scan is refused.
    fn end_follow(
        &mut self,
        (versions, found): (Versions, Rc<Found>),
        wanted: Option<u64>,
        now: Instant,
        effects: &mut Effects,
    ) {
        let Stage::Scanned(scanned) = &self.stage else { return };
        if !self.are_addresses_as_in(versions) {
            return;
        }
        let differences = Differences::between(&scanned.found, &found);
        let (added, removed) = (differences.added.len(), differences.removed.len());
        let (subdevices, counts) = (found.subdevices.len(), found.counts());
        self.find_again(versions, found);
        self.idle.compared = Comparison::Same(counts);
        self.words.scan.begin(Some(counts));
        self.idle.readdressed.clear();
        self.keep_scanned(now);
        if added + removed > 0 {
            effects.report(Event::SegmentChanged { subdevices, added, removed });
        }
        if let Some(number) = wanted {
            self.idle.rescans.ended = (number, differences);
        }
    }

    fn fail_to_follow(&mut self, reason: Option<String>, effects: &mut Effects) {
        let Comparison::Changed { failures, is_reported } = &mut self.idle.compared else { return };
        *failures = failures.saturating_add(1);
        if let Some(reason) = reason
            && *failures >= PATIENCE
            && !core::mem::replace(is_reported, true)
        {
            effects.report(Event::ScanFailed { reason });
        }
    }

    fn observe_idle_states(&mut self, read: &[StateRead], now: Instant, effects: &mut Effects) {
        // A SubDevice without its station address has lost its power, or another program has written the address.
        let has_lost = |read: &StateRead| {
            read.shown == ShownState::Elsewhere
                && self.unassigned(read.key).is_some()
                && !self.idle.readdressed.contains(&read.key.station)
        };
        if self.idle.is_visible() && read.iter().any(has_lost) {
            if matches!(self.idle.compared, Comparison::Same(_)) {
                self.idle.compared = Comparison::CHANGED;
            }
            self.idle.changes = self.idle.changes.wrapping_add(1);
        }
        self.observe_states(read, now, effects);
    }

    /// Whether single SubDevices can be read beside broadcasts.
    pub fn is_segment_visible(&self) -> bool {
        self.idle.is_visible() && !self.is_scanning()
    }
}
