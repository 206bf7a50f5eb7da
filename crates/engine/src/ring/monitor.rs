//! Whether the ring is closed, judged from where the copies of frames arrive (facts 9.2.1).
//!
//! A copy that comes back on the link it was sent on is proof of an open ring, copies that crossed prove a closed one;
//! what is missing proves nothing (a single loss, or a break that the controllers have not noticed yet).

use crate::link::Link;

/// State of the ring.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RingState {
    /// No frame has shown it yet.
    #[default]
    Unknown,
    /// MAIN copies arrive on RED and the other way round.
    Closed,
    /// Copies return on the link they were sent on.
    Open,
}

/// Where the copies of one frame arrived, by the link they were sent on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Arrivals {
    /// Bit `sent_on` set: the copy arrived.
    pub(crate) arrived: u8,
    /// Bit `sent_on` set: the copy arrived on its own link.
    pub(crate) returned: u8,
}

impl Arrivals {
    /// Notes a copy; false where it was noted before.
    pub(crate) fn note(&mut self, sent_on: Link, arrived_on: Link) -> bool {
        let new = self.arrived & sent_on.bit() == 0;
        self.arrived |= sent_on.bit();
        if sent_on == arrived_on {
            self.returned |= sent_on.bit();
        }
        new
    }

    /// What the frame proves about the ring.
    pub const fn verdict(self) -> Option<RingState> {
        match (self.arrived, self.returned) {
            (_, returned) if returned != 0 => Some(RingState::Open),
            (0b11, 0) => Some(RingState::Closed),
            _ => None,
        }
    }
}

/// Follows the state of the ring.
#[derive(Clone, Copy, Debug, Default)]
pub struct RingMonitor {
    state: RingState,
}

impl RingMonitor {
    /// The state now.
    pub const fn state(&self) -> RingState {
        self.state
    }

    /// Takes in one frame; returns the state where it changed (facts CR-12: once per change).
    pub fn observe(&mut self, arrivals: Arrivals) -> Option<RingState> {
        let verdict = arrivals.verdict()?;
        if verdict == self.state {
            return None;
        }
        self.state = verdict;
        Some(verdict)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arrivals(copies: &[(Link, Link)]) -> Arrivals {
        let mut arrivals = Arrivals::default();
        for &(sent_on, arrived_on) in copies {
            assert!(arrivals.note(sent_on, arrived_on));
        }
        arrivals
    }

    #[test]
    fn the_table_of_facts_9_2_1() {
        use Link::{Main, Redundant};
        type Copies = &'static [(Link, Link)];
        let table: [(Copies, Option<RingState>); 7] = [
            (&[(Redundant, Main), (Main, Redundant)], Some(RingState::Closed)),
            (&[(Main, Main), (Redundant, Redundant)], Some(RingState::Open)),
            (&[(Main, Main)], Some(RingState::Open)),
            (&[(Redundant, Redundant)], Some(RingState::Open)),
            (&[(Redundant, Main)], None),
            (&[(Main, Redundant)], None),
            (&[], None),
        ];
        for (copies, verdict) in table {
            assert_eq!(arrivals(copies).verdict(), verdict, "{copies:?}");
        }
    }

    #[test]
    fn a_thousand_broken_cycles_are_one_change() {
        let mut monitor = RingMonitor::default();
        let broken = arrivals(&[(Link::Main, Link::Main), (Link::Redundant, Link::Redundant)]);
        let changes = (0..1000).filter(|_| monitor.observe(broken).is_some()).count();
        assert_eq!(changes, 1);
        let lost = Arrivals::default();
        assert_eq!(monitor.observe(lost), None);
        assert_eq!(monitor.state(), RingState::Open);
    }

    #[test]
    fn a_copy_is_noted_once() {
        let mut arrivals = Arrivals::default();
        assert!(arrivals.note(Link::Main, Link::Redundant));
        assert!(!arrivals.note(Link::Main, Link::Redundant));
    }
}
