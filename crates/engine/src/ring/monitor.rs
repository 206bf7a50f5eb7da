//! Whether the ring is closed, from the links on which the copies of frames arrive (protocol 9.2.1).
//!
//! A copy that arrives on the link it was sent on proves an open ring; two copies that both arrive on the other link
//! prove a closed ring. A missing copy proves nothing: it may be a single loss, or a break that the controllers have
//! not detected yet.

use crate::link::Link;

/// State of the ring.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RingState {
    /// No frame has proved it yet.
    #[default]
    Unknown,
    /// MAIN copies arrive on RED, and RED copies on MAIN.
    Closed,
    /// Copies return on the link they were sent on.
    Open,
}

/// Links on which the copies of one frame arrived, by the link on which they were sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Arrivals {
    /// Bit `sent_on` set: the copy arrived.
    pub(crate) arrived: u8,
    /// Bit `sent_on` set: the copy arrived on its own link.
    pub(crate) returned: u8,
}

impl Arrivals {
    /// Records a copy; false for a duplicate.
    pub(crate) fn note(&mut self, sent_on: Link, arrived_on: Link) -> bool {
        let new = self.arrived & sent_on.bit() == 0;
        self.arrived |= sent_on.bit();
        if sent_on == arrived_on {
            self.returned |= sent_on.bit();
        }
        new
    }

    /// Evidence of the frame about the ring.
    pub const fn verdict(self) -> Option<RingState> {
        match (self.arrived, self.returned) {
            (_, returned) if returned != 0 => Some(RingState::Open),
            (0b11, 0) => Some(RingState::Closed),
            _ => None,
        }
    }
}

/// Number of consecutive frames of which only the copy of the same link arrived, on the other link, after which the
/// other direction counts as dead. Fewer may be single losses.
const ONE_WAY_AFTER: u16 = 50;

/// Follows the state of the ring.
#[derive(Clone, Copy, Debug, Default)]
pub struct RingMonitor {
    state: RingState,
    /// Consecutive frames of which exactly one copy arrived, by the link on which that copy was sent.
    alone: [u16; 2],
}

impl RingMonitor {
    /// A monitor of a ring whose state another process has known.
    pub(crate) fn of(state: RingState) -> RingMonitor {
        RingMonitor { state, ..RingMonitor::default() }
    }

    /// The current state.
    pub const fn state(&self) -> RingState {
        self.state
    }

    /// Whether the ring is open, or there is one link, and both directions work: copies that returned change nothing
    /// then.
    #[inline(always)]
    pub(crate) fn is_open(&self) -> bool {
        self.state == RingState::Open && self.alone == [0; 2]
    }

    /// The link whose copies are lost while the copies of the other link arrive on this one: the ring passes frames in
    /// one direction only.
    pub fn dead_way(&self) -> Option<Link> {
        match self.alone.map(|flights| flights >= ONE_WAY_AFTER) {
            [true, _] => Some(Link::Redundant),
            [_, true] => Some(Link::Main),
            [false, false] => None,
        }
    }

    /// Evaluates one frame; true if the state changed (protocol CR-12: once per change), or if a direction failed or
    /// recovered.
    #[inline]
    pub fn observe(&mut self, arrivals: Arrivals) -> bool {
        let Some(verdict) = arrivals.verdict() else { return self.observe_alone(arrivals) };
        if verdict == self.state && self.alone == [0; 2] {
            return false;
        }
        let revived = self.dead_way().is_some();
        self.alone = [0; 2];
        core::mem::replace(&mut self.state, verdict) != verdict || revived
    }

    /// One copy arrived on the other link, or none arrived: this proves neither state.
    #[cold]
    fn observe_alone(&mut self, arrivals: Arrivals) -> bool {
        let before = self.dead_way();
        for link in Link::ALL {
            let flights = &mut self.alone[link.index()];
            if arrivals.arrived == link.bit() {
                *flights = flights.saturating_add(1);
            } else if arrivals.arrived != 0 {
                *flights = 0;
            }
        }
        self.dead_way() != before
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

    // covers: CR-11, 9.2.1, ring-merge
    #[test]
    fn the_table_of_ring_states_holds() {
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

    // covers: ring-merge
    #[test]
    fn a_thousand_frames_of_an_open_ring_are_one_change() {
        let mut monitor = RingMonitor::default();
        let broken = arrivals(&[(Link::Main, Link::Main), (Link::Redundant, Link::Redundant)]);
        let changes = (0..1000).filter(|_| monitor.observe(broken)).count();
        assert_eq!(changes, 1);
        let lost = Arrivals::default();
        assert!(!monitor.observe(lost));
        assert_eq!(monitor.state(), RingState::Open);
    }

    // covers: CR-11, 9.2.1, ring-merge
    #[test]
    fn fifty_frames_with_the_same_single_copy_prove_a_dead_direction() {
        let mut monitor = RingMonitor::default();
        let closed = arrivals(&[(Link::Main, Link::Redundant), (Link::Redundant, Link::Main)]);
        let main_alone = arrivals(&[(Link::Main, Link::Redundant)]);
        assert!(monitor.observe(closed));
        for _ in 0..1000 {
            assert!(!monitor.observe(main_alone) && !monitor.observe(closed), "a single loss is no change");
        }
        let changes = (0..1000).filter(|_| monitor.observe(main_alone)).count();
        assert_eq!((changes, monitor.dead_way(), monitor.state()), (1, Some(Link::Redundant), RingState::Closed));
        assert!(!monitor.observe(Arrivals::default()), "a total loss proves nothing about the directions");
        assert!(monitor.observe(closed));
        assert_eq!(monitor.dead_way(), None);
    }

    #[test]
    fn a_copy_is_noted_once() {
        let mut arrivals = Arrivals::default();
        assert!(arrivals.note(Link::Main, Link::Redundant));
        assert!(!arrivals.note(Link::Main, Link::Redundant));
    }
}
