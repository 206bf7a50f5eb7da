//! Detects that no frame returns while rings behind junctions are open (JR-02).

use core::time::Duration;

use crate::event::Event;
use crate::link::{Link, LinkSet};
use crate::segment::disturbance::Disturbance;
use crate::segment::effect::{Effects, Task};
use crate::segment::model::Segment;
use crate::segment::ring::Words;
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
        let last = self.silence.last.get_or_insert((answered(words), now, words.cycles));
        let seen = answered(words).or(last.0);
        if seen != last.0 {
            *last = (seen, now, words.cycles);
            if core::mem::take(&mut self.silence.is_blocked) {
                effects.report(Event::JunctionsBlocked { blocked: false, breaks: self.local_rings.broken() });
                // The positions of SubDevices have to be determined again.
                self.attention.want();
            }
            return Some(self.silence.next);
        }
        let sent = words.cycles.wrapping_sub(last.2);
        let is_long = now.since(last.1) >= BLOCKED && sent >= BLOCKED_CYCLES;
        // Without a carrier the cable of the interface is the cause.
        let several = self.cabling.topology.local_rings.len() > 1;
        let at_once = several && Link::ALL.iter().all(|link| !has_no_carrier(words, *link));
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
        let before = self.silence.last.and_then(|(number, ..)| number);
        self.silence.last = Some((answered(words).or(before), now, words.cycles));
        self.silence.next = now + PAUSE;
    }
}

/// The number of a result that a SubDevice has answered: a frame that was processed by none did not return from the
/// SubDevices, and in a closed ring of two links copies return unprocessed.
fn answered(words: &Words) -> Option<u32> {
    words.supervision.filter(|(_, seen)| seen.total().0 > 0).map(|(number, _)| number)
}

/// Whether a link in use has lost its carrier.
fn has_no_carrier(words: &Words, link: Link) -> bool {
    (link == Link::Main || words.links == LinkSet::Ring) && words.carriers[link.index()] == Some(false)
}
