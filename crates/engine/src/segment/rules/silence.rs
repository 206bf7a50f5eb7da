//! Detects that no frame returns while rings behind junctions are open (JR-02).

use core::time::Duration;

use crate::event::Event;
use crate::link::Link;
use crate::segment::disturbance::Disturbance;
use crate::segment::effect::{Effects, Task};
use crate::segment::model::Segment;
use crate::segment::words::Words;
use crate::time::Instant;

/// Interval of the check: lost frames post nothing.
const PAUSE: Duration = Duration::from_millis(5);
/// Frames have not returned for this time: longer than the effect of a break of a single cable.
const BLOCKED: Duration = Duration::from_millis(20);
/// Cycles that must have been sent in that time; a stopped application sends none.
const BLOCKED_CYCLES: u64 = 3;

impl Segment {
    /// Reports that no frame returns while a local ring is open, or if there are several local rings of which two may
    /// have broken at the same time, and starts their examination; reports when frames return again. Returns the time
    /// of the next check.
    pub(in crate::segment) fn observe_silence(
        &mut self,
        words: &Words,
        now: Instant,
        effects: &mut Effects,
    ) -> Option<Instant> {
        if self.cabling.closings.is_empty() || self.slot.running() == Some(Disturbance::IsolateRings) {
            return None;
        }
        if now < self.silence.next {
            return Some(self.silence.next);
        }
        self.silence.next = now + PAUSE;
        if self.words.answer.observe(words, now) {
            if core::mem::take(&mut self.silence.is_blocked) {
                effects.report(Event::JunctionsBlocked { blocked: false, breaks: self.local_rings.broken() });
                // The positions of SubDevices have to be determined again.
                self.attention.want();
            }
            return Some(self.silence.next);
        }
        let is_long = self.words.answer.is_older_than((BLOCKED, BLOCKED_CYCLES), words, now);
        // Without a carrier the cable of the interface is the cause.
        let several = self.cabling.topology.local_rings.len() > 1;
        let at_once = several && Link::ALL.iter().all(|link| !words.has_no_carrier(*link));
        let breaks = self.local_rings.broken();
        if is_long && (breaks > 0 || at_once) && !self.silence.is_blocked {
            self.silence.is_blocked = true;
            effects.report(Event::JunctionsBlocked { blocked: true, breaks });
            effects.start(Task::IsolateRings);
        }
        Some(self.silence.next)
    }

    /// Rings have been examined: no frame could return during that time.
    pub(in crate::segment) fn end_silence(&mut self, words: &Words, now: Instant) {
        self.words.answer.begin_again(words, now);
        self.silence.next = now + PAUSE;
    }
}
