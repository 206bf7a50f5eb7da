//! The measured round trip of a frame, and the wait after which the frame is lost.
//!
//! Input: times of departure and return as measured by the host. Output: the time after departure at which a frame that
//! is not back is lost. This time is never shorter than the round trip of an open ring plus a margin. An open ring
//! takes up to twice the time on the wire. The time on the wire is not longer than any round trip of the closed ring,
//! while the longest round trip includes delays of the host. Nothing is known before the first round trips.
//!
//! Round trips are grouped in windows, which [`RoundTrip::refresh`] ends; the longest one of the last two windows
//! counts. If a frame is received after its wait and was not sent again, it had arrived when that was decided: the host
//! was delayed, or receives only at the end of the wait, and the wait is long enough. Such a return does not count. A
//! return after a second try shows that the wait is too short, and doubles the round trip at most (decision 0206).

use crate::time::Instant;

/// Nothing is known: beyond every deadline, and small enough for sums.
const FOREVER: u64 = u64::MAX / 4;
/// Margin: this part of the round trip, and a constant for the host.
const MARGIN_PART: u64 = 8;
const MARGIN_NS: u64 = 10_000;
/// Minimum number of round trips in a window: a few of a slow domain are not representative.
const LEAST_RETURNS: u8 = 16;

/// The round trip of a frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RoundTrip {
    /// Frames that came back in this window, up to 255.
    returns: u8,
    /// Longest time from departure to return in this window and the last one.
    ns: u64,
    /// The same in this window.
    window_ns: u64,
    /// The same while the ring was closed; 0 if it is not known.
    closed_ns: u64,
    /// A short round trip of the closed ring in this window or the last one: at least the time on the wire.
    wire_ns: u64,
    /// The same in this window; [`FOREVER`] before the first round trip.
    window_wire_ns: u64,
    /// A frame that is not back after this time is lost.
    wait_ns: u64,
    /// A return after this time makes the round trip longer.
    soon: Instant,
}

impl Default for RoundTrip {
    fn default() -> RoundTrip {
        RoundTrip {
            returns: 0,
            ns: 0,
            window_ns: 0,
            closed_ns: 0,
            wire_ns: FOREVER,
            window_wire_ns: FOREVER,
            wait_ns: FOREVER,
            soon: Instant::NEVER,
        }
    }
}

impl RoundTrip {
    /// The frame leaves. Returns when it is lost if it is not back.
    #[inline(always)]
    pub fn depart(&mut self, now: Instant) -> Instant {
        self.soon = Instant(now.0.wrapping_add(self.window_ns));
        Instant(now.0.wrapping_add(self.wait_ns))
    }

    /// The frame is complete: a further copy does not make the round trip longer.
    #[inline(always)]
    pub fn arrive(&mut self) {
        self.soon = Instant::NEVER;
        self.returns = self.returns.saturating_add(1);
    }

    /// Whether a return now is later than the returns before in this window.
    #[inline(always)]
    pub fn is_later(&self, now: Instant) -> bool {
        now > self.soon
    }

    /// A frame came back later than the ones before in this window. `was_sent`: it was sent again. One return doubles
    /// the round trip at most.
    #[cold]
    pub fn learn(&mut self, sent_at: Instant, now: Instant, is_closed: bool, was_sent: bool) {
        let taken = now.0.saturating_sub(sent_at.0).min(FOREVER / 8);
        if taken >= self.wait_ns && !was_sent {
            return;
        }
        let taken = if self.ns == 0 { taken } else { taken.min(2 * self.ns) };
        self.window_ns = self.window_ns.max(taken);
        self.ns = self.ns.max(taken);
        if is_closed {
            self.closed_ns = self.ns;
            self.window_wire_ns = self.window_wire_ns.min(taken);
            self.wire_ns = self.wire_ns.min(taken);
        }
        if self.is_known() {
            self.set_wait();
        }
    }

    /// A window ends: applies what was learned in it, and forgets the windows before.
    #[cold]
    pub fn refresh(&mut self, is_closed: bool) {
        if self.window_ns == 0 || (self.returns < LEAST_RETURNS && self.is_known()) {
            return;
        }
        self.returns = 0;
        self.ns = core::mem::take(&mut self.window_ns);
        if is_closed {
            self.closed_ns = self.ns;
            self.wire_ns = core::mem::replace(&mut self.window_wire_ns, FOREVER).min(self.ns);
        }
        self.set_wait();
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
        self.window_ns = 0;
        if self.is_known() {
            self.set_wait();
        }
    }

    fn set_wait(&mut self) {
        let longest = self.longest_ns();
        self.wait_ns = longest + longest / MARGIN_PART + MARGIN_NS;
    }

    /// The longest round trip that the frame may take, in nanoseconds.
    pub fn longest_ns(&self) -> u64 {
        self.ns.max(self.closed_ns + self.wire_ns.min(self.closed_ns))
    }

    /// Whether enough frames came back.
    pub fn is_known(&self) -> bool {
        self.wait_ns < FOREVER
    }

    /// The wait after which the frame is lost, in nanoseconds.
    pub fn wait_ns(&self) -> u64 {
        self.wait_ns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trip(round_trip: &mut RoundTrip, taken: u64, is_closed: bool) {
        round_trip.depart(Instant(1_000));
        let now = Instant(1_000 + taken);
        if round_trip.is_later(now) {
            round_trip.learn(Instant(1_000), now, is_closed, false);
        }
        round_trip.arrive();
    }

    // covers: lost-frames
    #[test]
    fn nothing_is_known_before_the_first_refresh() {
        let mut round_trip = RoundTrip::default();
        trip(&mut round_trip, 20_000, true);
        assert!(!round_trip.is_known());
        round_trip.refresh(true);
        assert_eq!(round_trip.wait_ns(), 40_000 + 5_000 + 10_000, "twice the closed round trip, and the margin");
    }

    // covers: lost-frames
    #[test]
    fn equal_round_trips_never_reach_the_time_at_which_frames_are_lost() {
        let mut round_trip = RoundTrip::default();
        for cycle in 0..10_000 {
            let lost_at = round_trip.depart(Instant(0));
            assert!(lost_at > Instant(100_000), "cycle {cycle}");
            trip(&mut round_trip, 100_000, false);
            if cycle % 64 == 0 {
                round_trip.refresh(false);
            }
        }
    }

    /// A window of round trips of 100 us. Some, by their cycles, came back after 9 ms, and were sent again or not.
    fn window(round_trip: &mut RoundTrip, late: &[u64], was_sent: bool) {
        for cycle in 0..64 {
            if late.contains(&cycle) {
                round_trip.depart(Instant(1_000));
                round_trip.learn(Instant(1_000), Instant(9_001_000), false, was_sent);
            } else {
                trip(round_trip, 100_000, false);
            }
        }
        round_trip.refresh(false);
    }

    // covers: lost-frames
    #[test]
    fn a_frame_that_was_back_before_it_was_sent_again_does_not_change_the_wait() {
        let mut round_trip = RoundTrip::default();
        window(&mut round_trip, &[], false);
        let usual = round_trip.wait_ns();
        for late in [&[0][..], &[30], &[63], &[10, 11, 12, 40]] {
            window(&mut round_trip, late, false);
            assert_eq!(round_trip.wait_ns(), usual, "the host was late in cycles {late:?}");
        }
        // A loop that receives at the end of the wait only.
        for cycle in 0..1_000 {
            trip(&mut round_trip, usual, false);
            assert_eq!(round_trip.wait_ns(), usual, "cycle {cycle}");
            if cycle % 64 == 0 {
                round_trip.refresh(false);
            }
        }
    }

    // covers: lost-frames
    #[test]
    fn a_return_after_a_second_try_at_most_doubles_the_round_trip_for_one_window() {
        let mut round_trip = RoundTrip::default();
        window(&mut round_trip, &[], false);
        let usual = round_trip.wait_ns();
        for (late, most) in [(&[10][..], 235_000), (&[10, 11], 460_000)] {
            window(&mut round_trip, late, true);
            assert!(round_trip.wait_ns() > usual && round_trip.wait_ns() <= most, "{late:?}: {}", round_trip.wait_ns());
            window(&mut round_trip, &[], false);
            assert_eq!(round_trip.wait_ns(), usual, "{late:?}");
        }
    }

    // covers: lost-frames
    #[test]
    fn the_wait_of_a_slow_domain_does_not_follow_single_short_round_trips() {
        let mut round_trip = RoundTrip::default();
        window(&mut round_trip, &[], false);
        let usual = round_trip.wait_ns();
        for short in 0..15 {
            trip(&mut round_trip, 20_000, false);
            round_trip.refresh(false);
            assert_eq!(round_trip.wait_ns(), usual, "after {short}");
        }
        trip(&mut round_trip, 20_000, false);
        round_trip.refresh(false);
        assert!(round_trip.wait_ns() < usual);
    }

    // covers: lost-frames
    #[test]
    fn a_round_trip_that_has_become_longer_is_measured_in_a_few_frames() {
        let mut round_trip = RoundTrip::default();
        window(&mut round_trip, &[], false);
        for _ in 0..3 {
            round_trip.depart(Instant(0));
            round_trip.learn(Instant(0), Instant(700_000), false, round_trip.wait_ns() < 700_000);
        }
        assert!(round_trip.longest_ns() == 700_000 && round_trip.wait_ns() > 700_000, "{round_trip:?}");
    }

    // covers: lost-frames
    #[test]
    fn an_open_ring_adds_the_time_on_the_wire_once_and_not_the_delays_of_the_host() {
        let mut round_trip = RoundTrip::default();
        for cycle in 0..128 {
            // 30 us on the wire, and up to 270 us until the host receives.
            trip(&mut round_trip, 30_000 + cycle % 64 * 17 % 10 * 30_000, true);
            if cycle % 64 == 63 {
                round_trip.refresh(true);
            }
        }
        assert_eq!(round_trip.longest_ns(), 300_000 + 30_000);
        round_trip.change(false);
        assert_eq!(round_trip.longest_ns(), 330_000);
        // The wire has become longer.
        round_trip.change(true);
        (0..128).for_each(|cycle| {
            trip(&mut round_trip, 100_000, true);
            if cycle % 64 == 63 {
                round_trip.refresh(true);
            }
        });
        assert_eq!(round_trip.longest_ns(), 200_000);
    }

    // covers: lost-frames
    #[test]
    fn a_ring_that_opens_takes_up_to_twice_the_closed_way() {
        let mut round_trip = RoundTrip::default();
        trip(&mut round_trip, 30_000, true);
        round_trip.refresh(true);
        let closed = round_trip.wait_ns();
        round_trip.change(false);
        assert!(round_trip.wait_ns() >= 60_000 && round_trip.wait_ns() <= closed, "{} {closed}", round_trip.wait_ns());
        trip(&mut round_trip, 45_000, false);
        round_trip.change(true);
        assert!(round_trip.longest_ns() >= 56_000 && round_trip.longest_ns() <= 60_000, "{}", round_trip.longest_ns());
    }
}
