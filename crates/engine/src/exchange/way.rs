//! How long a frame takes to come back, learned from its flights, and how long it is waited for.
//!
//! Input: times of departure and return as measured by the host. Output: the time after departure at which a frame that
//! is not back is lost. This time is never shorter than the way of an open ring, which is up to twice the closed one,
//! plus a margin. Nothing is known before the first flights.

use crate::time::Instant;

/// Nothing is known: beyond every deadline, and small enough for sums.
const FOREVER: u64 = u64::MAX / 4;
/// Margin: this part of the way, and a constant for the host.
const MARGIN_PART: u64 = 8;
const MARGIN_NS: u64 = 10_000;
/// The learned way shrinks by this part, so that one late return is forgotten. Less than the margin.
const SHRINK_PART: u64 = 16;

/// The way of a frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Way {
    /// Longest recent time from departure to return.
    ns: u64,
    /// The same while the ring was closed; 0 if it is not known.
    closed_ns: u64,
    /// A frame that is not back after this time is lost.
    wait_ns: u64,
    /// A return after this time makes the way longer.
    soon: Instant,
}

impl Default for Way {
    fn default() -> Way {
        Way { ns: 0, closed_ns: 0, wait_ns: FOREVER, soon: Instant::NEVER }
    }
}

impl Way {
    /// The frame leaves. Returns when it is lost if it is not back.
    #[inline(always)]
    pub fn depart(&mut self, now: Instant) -> Instant {
        self.soon = Instant(now.0.wrapping_add(self.ns));
        Instant(now.0.wrapping_add(self.wait_ns))
    }

    /// The frame is complete: a further copy does not make the way longer.
    #[inline(always)]
    pub fn arrive(&mut self) {
        self.soon = Instant::NEVER;
    }

    /// Whether a return now is later than the returns before.
    #[inline(always)]
    pub fn is_later(&self, now: Instant) -> bool {
        now > self.soon
    }

    /// A frame came back later than the ones before. One return at most doubles the way.
    #[cold]
    pub fn learn(&mut self, sent_at: Instant, now: Instant, is_closed: bool) {
        let taken = now.0.saturating_sub(sent_at.0).min(FOREVER / 8);
        self.ns = if self.ns == 0 { taken } else { taken.min(2 * self.ns) };
        if is_closed {
            self.closed_ns = self.ns;
        }
        if self.is_known() {
            self.set_wait();
        }
    }

    /// Applies what was learned, and forgets a part of it.
    #[cold]
    pub fn refresh(&mut self, is_closed: bool) {
        if self.ns == 0 {
            return;
        }
        self.set_wait();
        self.ns -= self.ns / SHRINK_PART;
        if is_closed {
            self.closed_ns = self.ns;
        }
    }

    /// The ring has opened or closed.
    #[cold]
    pub fn change(&mut self, is_closed: bool) {
        if is_closed {
            self.ns = if self.closed_ns == 0 { self.ns } else { self.closed_ns };
            self.closed_ns = self.ns;
        } else {
            self.ns = self.longest_ns();
        }
        if self.is_known() {
            self.set_wait();
        }
    }

    fn set_wait(&mut self) {
        let longest = self.longest_ns();
        self.wait_ns = longest + longest / MARGIN_PART + MARGIN_NS;
    }

    /// The longest way that the frame may take, in nanoseconds.
    pub fn longest_ns(&self) -> u64 {
        self.ns.max(2 * self.closed_ns)
    }

    /// Whether enough flights came back.
    pub fn is_known(&self) -> bool {
        self.wait_ns < FOREVER
    }

    /// How long the frame is waited for, in nanoseconds.
    pub fn wait_ns(&self) -> u64 {
        self.wait_ns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flight(way: &mut Way, taken: u64, is_closed: bool) {
        way.depart(Instant(1_000));
        let now = Instant(1_000 + taken);
        if way.is_later(now) {
            way.learn(Instant(1_000), now, is_closed);
        }
    }

    // covers: lost-frames
    #[test]
    fn nothing_is_known_before_the_first_refresh() {
        let mut way = Way::default();
        flight(&mut way, 20_000, true);
        assert!(!way.is_known());
        way.refresh(true);
        assert_eq!(way.wait_ns(), 40_000 + 5_000 + 10_000, "twice the closed way, and the margin");
    }

    // covers: lost-frames
    #[test]
    fn equal_flights_never_reach_the_time_at_which_they_are_lost() {
        let mut way = Way::default();
        for cycle in 0..10_000 {
            let lost_at = way.depart(Instant(0));
            assert!(lost_at > Instant(100_000), "cycle {cycle}");
            flight(&mut way, 100_000, false);
            if cycle % 64 == 0 {
                way.refresh(false);
            }
        }
    }

    // covers: lost-frames
    #[test]
    fn one_late_return_doubles_the_way_at_most_and_is_forgotten() {
        let mut way = Way::default();
        flight(&mut way, 100_000, false);
        way.refresh(false);
        flight(&mut way, 9_000_000, false);
        assert!(way.wait_ns() <= 235_000, "{}", way.wait_ns());
        for _ in 0..20 {
            way.refresh(false);
            flight(&mut way, 100_000, false);
        }
        assert!(way.wait_ns() <= 135_000, "{}", way.wait_ns());
    }

    // covers: lost-frames
    #[test]
    fn a_ring_that_opens_takes_up_to_twice_the_closed_way() {
        let mut way = Way::default();
        flight(&mut way, 30_000, true);
        way.refresh(true);
        let closed = way.wait_ns();
        way.change(false);
        assert!(way.wait_ns() >= 60_000 && way.wait_ns() <= closed, "{} {closed}", way.wait_ns());
        flight(&mut way, 45_000, false);
        way.change(true);
        assert!(way.longest_ns() >= 56_000 && way.longest_ns() <= 60_000, "{}", way.longest_ns());
    }
}
