//! What puts SubDevices out of reach, or a link out of use, on purpose: one at a time.
//!
//! None of these can be cancelled: each runs to its undo. Where several are wanted at once the one that is needed most
//! is next, and each ends by itself within its own time limit, so that a segment that changes all the time starves
//! none.

use alloc::vec::Vec;

/// A kind of disturbance; the one that is needed most first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Disturbance {
    /// No frame comes back: one ring behind a junction after the other is looked into, while the others are left out.
    IsolateRings,
    /// Rings are opened at a port, so that propagation delays of their cables can be measured.
    OpenByPort,
    /// The redundant link is down, so that crossed lines have places.
    OpenByLink,
}

/// What is under way, and what waits for its end.
#[derive(Debug, Default)]
pub(super) struct Slot {
    running: Option<Disturbance>,
    waiting: Vec<Disturbance>,
    /// How often SubDevices were put out of reach.
    isolations: u32,
}

impl Slot {
    /// What is under way.
    pub fn running(&self) -> Option<Disturbance> {
        self.running
    }

    /// How often SubDevices were put out of reach: what was seen across such a moment says nothing of who is there.
    pub fn isolations(&self) -> u32 {
        self.isolations
    }

    /// Something is wanted. It is under way at once where nothing else is.
    pub fn want(&mut self, wanted: Disturbance) {
        self.waiting.push(wanted);
        self.grant();
    }

    /// Something is not wanted any more, before it was under way.
    pub fn renounce(&mut self, wanted: Disturbance) {
        if let Some(at) = self.waiting.iter().position(|waiting| *waiting == wanted) {
            self.waiting.remove(at);
        }
    }

    /// What is under way has been undone.
    pub fn end(&mut self) {
        self.running = None;
        self.grant();
    }

    fn grant(&mut self) {
        if self.running.is_some() {
            return;
        }
        let Some(next) = self.waiting.iter().copied().min() else { return };
        self.renounce(next);
        self.running = Some(next);
        self.isolations = self.isolations.wrapping_add(u32::from(next == Disturbance::IsolateRings));
    }
}

#[cfg(test)]
mod tests {
    use super::Disturbance::{IsolateRings, OpenByLink, OpenByPort};
    use super::*;

    #[test]
    fn one_at_a_time_and_what_is_needed_most_is_next() {
        let mut slot = Slot::default();
        slot.want(OpenByLink);
        slot.want(OpenByPort);
        slot.want(IsolateRings);
        assert_eq!((slot.running(), slot.isolations()), (Some(OpenByLink), 0));
        slot.end();
        assert_eq!((slot.running(), slot.isolations()), (Some(IsolateRings), 1));
        slot.end();
        assert_eq!(slot.running(), Some(OpenByPort));
        slot.end();
        assert_eq!(slot.running(), None);
    }

    #[test]
    fn what_is_not_wanted_any_more_is_not_granted() {
        let mut slot = Slot::default();
        slot.want(IsolateRings);
        slot.want(OpenByPort);
        slot.renounce(OpenByPort);
        slot.end();
        assert_eq!(slot.running(), None);
    }
}
