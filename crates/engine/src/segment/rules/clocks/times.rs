//! Effects of the time that the application gives.

use crate::board::clocks::References;
use crate::clocks::extend;
use crate::event::Event;
use crate::segment::clocks::{ClockKey, ClockVersions, Delays, Due, Life, Running, Step, Unwritten};
use crate::segment::effect::Effects;
use crate::segment::model::Segment;

impl Segment {
    /// The set-up of all clocks begins, with the application's time if it is known.
    pub(super) fn observe_begun_set_up(&mut self) {
        let first = self.board.clocks.times.first_epoch();
        self.clocks.epoch = self.clocks.times.begin(first).unwrap_or(self.clocks.epoch);
        self.clocks.changes.set_ups = self.clocks.changes.set_ups.wrapping_add(1);
        let reference = self.clocks.elect(|_| true);
        self.clocks.refer_to(reference);
    }

    /// The time of the reference was read. It is refused if another clock is the reference by now, or after a change of
    /// all offsets.
    pub(super) fn observe_reference_time(
        &mut self,
        (key, low, sent_at): (ClockKey, u32, u64),
        versions: &ClockVersions,
        effects: &mut Effects,
    ) {
        let is_reference = self.clocks.reference_node().is_some_and(|node| node.key() == key);
        if is_reference && self.are_offsets_as_in(versions) {
            let near = sent_at.wrapping_add(self.clocks.epoch);
            self.clocks.epoch = extend(low, near).wrapping_sub(sent_at);
            self.compare_times(effects);
        }
    }

    /// Compares a reading of the reference with the application's time.
    fn compare_times(&mut self, effects: &mut Effects) {
        let is_calm = match &self.clocks.life {
            Life::Running(Running { delays: Delays::Valid, unwritten, due: Due::Nothing, .. }) => {
                *unwritten == Unwritten::default() && !self.board.clocks.is_held()
            }
            _ => false,
        };
        if !is_calm || self.board.clocks.references().0 != self.clocks.references() {
            return;
        }
        let pattern_ns = self.clocks.running_pattern();
        let words = &self.board.clocks.times;
        let (epoch, wanted, first) = (self.clocks.epoch, words.wanted(), words.first_epoch());
        match self.clocks.times.compare(epoch, wanted, first, pattern_ns) {
            None => {}
            Some(Step::Jump(jump)) => self.begin_jump(jump),
            Some(Step::Shift { shift, left }) => {
                words.post_timeline(self.clocks.times.turn(0, (shift, left), epoch));
                self.board.clocks.post_references(self.clocks.references());
                effects.report(Event::ApplicationTime { jump_ns: 0, shift_ns: shift as i64 });
            }
        }
    }

    /// All offsets are changed by a jump. No time is distributed until they are written.
    fn begin_jump(&mut self, jump: u64) {
        self.board.clocks.post_references(References::default());
        self.clocks.epoch = self.clocks.epoch.wrapping_add(jump);
        self.clocks.changes.offsets = self.clocks.changes.offsets.wrapping_add(1);
        for node in &mut self.clocks.nodes {
            node.offset_ns = node.offset_ns.wrapping_add(jump as i64);
        }
        self.clocks.times.turn(jump, (0, 0), self.clocks.epoch);
        self.set_due(Due::Offsets);
    }

    /// The offsets of a jump are written, unless they have changed again meanwhile. A clock that did not answer is set
    /// up when it does.
    pub(super) fn observe_written_offsets(
        &mut self,
        missed: &[ClockKey],
        versions: &ClockVersions,
        effects: &mut Effects,
    ) {
        if !self.are_offsets_as_in(versions) {
            return;
        }
        for node in self.clocks.nodes.iter_mut().filter(|node| node.has_clock) {
            node.missed_offset |= node.link.is_none() || missed.contains(&node.key());
        }
        let timeline = self.clocks.times.timeline;
        let before = self.board.clocks.times.timeline().jumped;
        self.board.clocks.times.post_timeline(timeline);
        self.board.clocks.post_references(self.clocks.references());
        self.set_due(Due::Filters);
        effects.report(Event::ApplicationTime {
            jump_ns: timeline.jumped.wrapping_sub(before) as i64,
            shift_ns: timeline.shift as i64,
        });
    }

    /// The system time of all clocks goes back by a step: their offsets are about to be written.
    pub(super) fn observe_step_back(&mut self, step_ns: u64) {
        self.clocks.times.slide(step_ns);
        self.clocks.epoch = self.clocks.epoch.wrapping_sub(step_ns);
        self.clocks.changes.offsets = self.clocks.changes.offsets.wrapping_add(1);
        for node in &mut self.clocks.nodes {
            node.offset_ns = node.offset_ns.wrapping_sub(step_ns as i64);
        }
        // The frame leaves before the next cycle, which takes the step into account.
        self.board.clocks.times.post_slid(self.clocks.times.slid());
    }

    /// The offsets of a step are written. A clock that did not answer is set up when it does.
    pub(super) fn observe_stepped_back(&mut self, missed: &[ClockKey]) {
        for node in self.clocks.nodes.iter_mut().filter(|node| node.has_clock) {
            node.missed_offset |= node.link.is_none() || missed.contains(&node.key());
        }
    }
}
