//! Effects of the answers of clocks: their differences, and the links on which they answer.

use alloc::vec::Vec;

use crate::clocks::SyncWindow;
use crate::event::Event;
use crate::link::Link;
use crate::segment::clocks::{Answers, Difference, Lock, Node, Running};
use crate::segment::effect::Effects;
use crate::segment::model::Segment;
use crate::time::Instant;

impl Segment {
    /// Stores the differences. The lock is reported when all required clocks are within the window.
    pub(super) fn observe_differences(&mut self, answers: &Answers, effects: &mut Effects) {
        let differences = self.differences(answers);
        // While no time is distributed, differences belong to a frame with another path.
        if self.board.clocks.is_held() {
            return;
        }
        let is_compensating = self.clocks.is_compensating();
        let are_locked = self.clocks.are_locked();
        let references = Link::ALL.map(|link| self.clocks.reference_on(link).map(|node| node.station));
        let (lock_window_ns, samples) = (self.clocks.config.lock_window_ns, self.clocks.config.lock_samples);
        let (mut all, mut largest) = (self.clocks.reference.is_some(), 0);
        let required: Vec<bool> = self.clocks.nodes.iter().map(|node| self.clocks.is_required(node)).collect();
        for ((node, (difference, deviation_ppb)), is_required) in
            self.clocks.nodes.iter_mut().zip(differences).zip(required)
        {
            let Some(difference) = difference else {
                all &= !is_required || node.link.is_none();
                continue;
            };
            // Nothing is written to a reference, so its difference is zero.
            let is_reference = references.contains(&Some(node.station));
            let difference = if is_reference { 0 } else { difference };
            let magnitude = difference.unsigned_abs();
            node.difference_ns = Some(difference);
            let is_good = magnitude <= lock_window_ns && !is_compensating;
            node.good = if is_good { node.good.saturating_add(1) } else { 0 };
            let is_locked = node.good >= samples;
            if is_locked || (node.worst_ns > 0 && are_locked) {
                node.worst_ns = node.worst_ns.max(magnitude);
            }
            all &= is_locked || !is_required;
            if is_locked && !is_reference {
                // The deviation compensated by the loop, now that it has settled (protocol 7.2.1).
                node.drift_ppb = -deviation_ppb;
            }
            largest = largest.max(if is_required { magnitude } else { 0 });
        }
        // While a reference is steered, the exchange does not see the differences of the others from their reference.
        let is_steered = references.iter().all(Option::is_some) || self.board.clocks.shows_host_jitter();
        self.observe_window(largest, is_steered, effects);
        self.observe_lock(all, largest, is_steered, effects);
    }

    /// The difference and the deviation of each clock; differences that contain the jitter of the host as a mean.
    fn differences(&mut self, answers: &Answers) -> Vec<(Option<i32>, i64)> {
        let difference = |node: &mut Node| {
            let Some(answer) = answers.get(&node.key()) else { return (None, 0) };
            let difference = match answer.difference {
                Difference::Unknown => None,
                Difference::Own(ns) => Some(ns),
                Difference::InFront(ns) => Some(node.average(ns)),
            };
            (difference, answer.deviation_ppb)
        };
        self.clocks.nodes.iter_mut().map(difference).collect()
    }

    fn observe_window(&mut self, largest_ns: u32, is_steered: bool, effects: &mut Effects) {
        let inside = largest_ns <= self.clocks.config.sync_window_ns;
        let Some(Running { lock: Lock::Locked(window), .. }) = self.clocks.running_mut() else { return };
        if !is_steered && !window.is_outside() {
            window.skip();
        } else if window.take(inside) {
            effects.report(Event::SyncWindow { inside, spread_ns: largest_ns });
        }
    }

    fn observe_lock(&mut self, all: bool, largest_ns: u32, is_steered: bool, effects: &mut Effects) {
        let Some(Running { lock: lock @ Lock::Open, .. }) = self.clocks.running_mut().filter(|_| all) else { return };
        *lock = Lock::Locked(SyncWindow::inside());
        self.board.clocks.watch_window();
        effects.report(Event::ClocksLocked { largest_ns });
        if is_steered {
            effects.report(Event::SyncWindow { inside: true, spread_ns: largest_ns });
        }
    }

    /// Updates the link of each SubDevice, and replaces a lost reference. `is_explained`: changes of ports are due to a
    /// ring that opened or closed; in each part the path from clock to clock is unchanged.
    pub(super) fn follow_links(
        &mut self,
        answers: &Answers,
        is_explained: bool,
        holds: u32,
        now: Instant,
        effects: &mut Effects,
    ) {
        let Some(moved) = self.confirm_links(answers) else { return };
        let elected = self.elect(effects);
        let is_other = self.board.clocks.references().0 != self.clocks.references();
        if self.clocks.doubtful_since().is_some() && !is_explained {
            return;
        }
        if !(moved || is_other || elected || self.board.clocks.is_held()) {
            return;
        }
        if Link::ALL.iter().any(|link| self.clocks.is_mixed(*link)) {
            // Delays across the two parts are unknown until the segment has been measured.
            return self.doubt(now);
        }
        self.write_or_follow(holds);
    }

    /// Takes over the links of the answers; returns whether any has changed. `None` if the next answers must confirm
    /// them: answers during the opening or closing of a ring belong to both states.
    fn confirm_links(&mut self, answers: &Answers) -> Option<bool> {
        let before = self.clocks.running_mut()?.unconfirmed.take();
        let is_certain = |node: &Node| {
            let Some(answer) = answers.get(&node.key()).filter(|_| node.has_clock) else { return true };
            let is_confirmed = || before.as_ref()?.get(&node.station).map(|link| *link == answer.link);
            answer.link == node.link || is_confirmed() == Some(true)
        };
        if !self.clocks.nodes.iter().all(is_certain) {
            let links = answers.iter().map(|(key, answer)| (key.station, answer.link)).collect();
            self.clocks.running_mut()?.unconfirmed = Some(links);
            return None;
        }
        let mut moved = false;
        for node in self.clocks.nodes.iter_mut().filter(|node| node.has_clock) {
            let Some(answer) = answers.get(&node.key()) else { continue };
            moved |= answer.link != node.link;
            node.link = answer.link;
        }
        self.clocks.changes.delays = self.clocks.changes.delays.wrapping_add(u32::from(moved));
        Some(moved)
    }
}
