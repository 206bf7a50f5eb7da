//! Disturbances: procedures that put SubDevices out of reach, take a link out of use or change station addresses on
//! purpose, and procedures that need all of this unchanged. Only one runs at a time.
//!
//! A running disturbance cannot be cancelled: it runs until it is undone. If several are requested, the most urgent one
//! is next. Each ends within its own time limit, and earlier if a more urgent one waits, so that none waits for ever in
//! a segment that changes repeatedly.

use alloc::vec::Vec;

/// A kind of disturbance; the most urgent one first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Disturbance {
    /// No frame returns: one ring behind a junction after the other is examined, while the others are excluded.
    IsolateRings,
    /// Rings are opened at a port, to measure propagation delays of their cables.
    OpenByPort,
    /// SubDevices without a known station address get one.
    Readdress,
    /// The redundant link is down, to locate crossed lines.
    OpenByLink,
    /// Ports and station addresses of the whole segment are read.
    Rescan,
}

/// A request for a disturbance with the procedure's number: several procedures may request the same kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wanted {
    /// The kind.
    pub disturbance: Disturbance,
    /// The number.
    pub number: u32,
}

/// The disturbance under way, and the waiting ones.
#[derive(Debug, Default)]
pub(super) struct Slot {
    running: Option<Wanted>,
    waiting: Vec<Wanted>,
    /// How often SubDevices were put out of reach.
    isolations: u32,
    /// Number of the next request.
    next_number: u32,
}

impl Slot {
    /// The disturbance under way.
    pub fn running(&self) -> Option<Disturbance> {
        self.running.map(|running| running.disturbance)
    }

    /// Whether the disturbance under way has this number.
    pub fn is_granted(&self, number: u32) -> bool {
        self.running.is_some_and(|running| running.number == number)
    }

    /// Whether a more urgent disturbance waits.
    pub fn is_outranked(&self) -> bool {
        self.running().is_some_and(|running| self.waiting.iter().any(|waiting| waiting.disturbance < running))
    }

    /// How often SubDevices were put out of reach: a scan during such a time does not show which SubDevices answer.
    pub fn isolations(&self) -> u32 {
        self.isolations
    }

    /// Number of the next request.
    pub fn next_number(&self) -> u32 {
        self.next_number
    }

    /// An empty slot, with other numbers than before.
    pub fn emptied(&self) -> Slot {
        let isolations = self.isolations.wrapping_add(1);
        Slot { running: None, waiting: Vec::new(), isolations, next_number: self.next_number }
    }

    /// Requests a disturbance. It is under way at once if no other is.
    pub fn want(&mut self, wanted: Wanted) {
        self.next_number = wanted.number.wrapping_add(1);
        self.waiting.push(wanted);
        self.grant();
    }

    /// A disturbance has been undone, or its request was withdrawn before it began.
    pub fn end(&mut self, number: u32) {
        self.waiting.retain(|waiting| waiting.number != number);
        if self.is_granted(number) {
            self.running = None;
            self.grant();
        }
    }

    fn grant(&mut self) {
        if self.running.is_some() {
            return;
        }
        let Some(next) = self.waiting.iter().copied().min_by_key(|waiting| waiting.disturbance) else { return };
        self.waiting.retain(|waiting| waiting.number != next.number);
        self.running = Some(next);
        let is_isolation = next.disturbance == Disturbance::IsolateRings;
        self.isolations = self.isolations.wrapping_add(u32::from(is_isolation));
    }
}

#[cfg(test)]
mod tests {
    use super::Disturbance::{IsolateRings, OpenByLink, OpenByPort, Rescan};
    use super::*;

    fn want(slot: &mut Slot, wanted: impl IntoIterator<Item = Disturbance>) {
        for (number, disturbance) in (0..).zip(wanted) {
            slot.want(Wanted { disturbance, number });
        }
    }

    #[test]
    fn one_disturbance_runs_at_a_time_and_the_most_urgent_is_next() {
        let mut slot = Slot::default();
        want(&mut slot, [OpenByLink, OpenByPort, IsolateRings]);
        assert_eq!((slot.running(), slot.isolations()), (Some(OpenByLink), 0));
        assert!(slot.is_outranked());
        slot.end(0);
        assert!(!slot.is_outranked());
        assert_eq!((slot.running(), slot.isolations()), (Some(IsolateRings), 1));
        slot.end(2);
        assert_eq!(slot.running(), Some(OpenByPort));
        slot.end(1);
        assert_eq!(slot.running(), None);
    }

    #[test]
    fn a_withdrawn_disturbance_is_not_granted() {
        let mut slot = Slot::default();
        want(&mut slot, [IsolateRings, OpenByPort]);
        slot.end(1);
        assert_eq!(slot.running(), Some(IsolateRings));
        slot.end(0);
        assert_eq!(slot.running(), None);
    }

    #[test]
    fn two_disturbances_of_a_kind_run_one_after_the_other() {
        let mut slot = Slot::default();
        want(&mut slot, [Rescan, Rescan]);
        assert!(slot.is_granted(0) && !slot.is_granted(1));
        slot.end(0);
        assert!(slot.is_granted(1));
        slot.end(0);
        assert!(slot.is_granted(1));
    }
}
