//! Application time and system time: the shift between them, and its gradual changes.
//!
//! When the application's time jumps while SYNC signals run, the system time goes on without a jump. The supervisor
//! posts a new shift, by which both times differ from then on, and makes the rest of the jump up: it sets the offsets
//! of all clocks back in small equal steps, so that they stay together. The exchange takes these steps into account; a
//! small rest in the other direction, which no step is made for, is made up by the control loop of the reference.

use crate::board::clock_times::Timeline;
use crate::time::Instant;

/// Nanoseconds in which the control loop moves the system time by one: 200 ppm. Loops take out 760 ppm, of which up to
/// 200 compensate the drift of the clocks.
const SLOWNESS: u64 = 5_000;
/// Readings of the two halves differ by up to this: other frames are on the wire before theirs.
const SAME_NS: u64 = 50_000;
/// Longest time between two steps that counts.
const LONGEST_NS: u64 = 100_000_000;

/// The shift in effect, and the one to reach.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Slide {
    /// Number of the posted system time.
    number: u32,
    /// Sum of all jumps of the system time.
    jumped: u64,
    shift: u64,
    /// Nanoseconds by which the system time goes back until the shift is reached; negative: forward.
    left: i64,
    /// Nanoseconds by which it has gone back in steps.
    slid: u64,
    at: Instant,
    /// Remainder of the last step of the loop, in nanoseconds of host time.
    rest: u64,
    /// System time of the reference clock at host time zero when the system time was posted; `None` before.
    epoch: Option<u64>,
    /// The system time was set by another MainDevice: the next application time determines the shift.
    is_adopted: bool,
}

impl Slide {
    /// Whether a posted system time is another one than that taken over last.
    pub const fn is_before(&self, timeline: Timeline) -> bool {
        timeline.number != self.number
    }

    /// Takes over a posted system time; returns its jump. `continued` is the application time minus the system time
    /// that was written last, if any: that goes on without a step.
    pub fn follow(&mut self, timeline: Timeline, continued: Option<u64>, now: Instant) -> u64 {
        let jump = timeline.jumped.wrapping_sub(self.jumped);
        if self.is_before(timeline) {
            let Timeline { number, jumped, shift, left, slid, epoch, is_adopted } = timeline;
            let exact = continued.map(|continued| shift.wrapping_sub(continued) as i64);
            let is_same = |exact: &i64| left > 0 && exact.wrapping_sub(left).unsigned_abs() <= SAME_NS;
            let left = exact.filter(is_same).unwrap_or(left);
            *self = Slide { number, jumped, shift, left, slid, at: now, rest: 0, epoch: Some(epoch), is_adopted };
        }
        jump
    }

    /// Takes an application time: the first one after an adoption is that of the system, with a shift.
    pub fn take_application_time(&mut self, time: u64, now: Instant) {
        if let Some(system) = self.posted_time(now).filter(|_| self.is_adopted) {
            (self.shift, self.is_adopted) = (time.wrapping_sub(system), false);
        }
    }

    /// Application time minus system time, once all is made up.
    pub const fn shift(&self) -> u64 {
        self.shift
    }

    /// The system time as it was posted; `None` before.
    pub fn posted_time(&self, now: Instant) -> Option<u64> {
        self.epoch.map(|epoch| epoch.wrapping_add(now.0))
    }

    /// The shift in effect.
    pub const fn in_effect(&self) -> u64 {
        self.shift.wrapping_sub(self.left as u64)
    }

    /// Takes over the steps so far: nanoseconds by which the system time has gone back since the beginning. Returns
    /// those since the last call.
    pub fn take_steps(&mut self, slid: u64) -> u64 {
        let step = slid.wrapping_sub(self.slid);
        self.left = self.left.wrapping_sub(step as i64);
        self.slid = slid;
        step
    }

    /// The shift in effect now.
    pub fn step(&mut self, now: Instant) -> u64 {
        let passed = now.0.saturating_sub(self.at.0).min(LONGEST_NS) + self.rest;
        (self.at, self.rest) = (now, passed % SLOWNESS);
        if self.left < 0 {
            self.left = self.left.saturating_add_unsigned(passed / SLOWNESS).min(0);
        }
        self.in_effect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shift_in_effect_follows_the_steps_of_the_offsets_and_nothing_else() {
        let mut slide = Slide::default();
        let timeline = Timeline {
            number: 1,
            jumped: 0,
            shift: 21_000_000,
            left: 250_000,
            slid: 1_000,
            epoch: 5,
            ..Timeline::default()
        };
        assert_eq!(slide.follow(timeline, None, Instant(0)), 0);
        assert_eq!(slide.in_effect(), 20_750_000);
        assert_eq!((slide.take_steps(1_000), slide.step(Instant(1_000_000))), (0, 20_750_000));
        assert_eq!((slide.take_steps(1_400), slide.step(Instant(2_000_000))), (400, 20_750_400));
        assert_eq!((slide.take_steps(251_000), slide.step(Instant(3_000_000))), (249_600, slide.shift()));
    }

    // covers: 7.4, standby
    #[test]
    fn after_an_adoption_the_first_application_time_determines_the_shift() {
        let timeline = Timeline { number: 1, shift: 21_000_000, epoch: 5_000, is_adopted: true, ..Timeline::default() };
        let mut slide = Slide::default();
        slide.follow(timeline, Some(20_757_000), Instant(0));
        assert_eq!(slide.in_effect(), 21_000_000, "it was read");
        slide.take_application_time(25_005_010, Instant(10));
        assert_eq!(slide.in_effect(), 25_000_000);
        slide.take_application_time(0, Instant(20));
        assert_eq!((slide.step(Instant(30)), slide.shift()), (25_000_000, 25_000_000), "later ones are followed");
    }

    #[test]
    fn the_time_that_is_written_goes_on_where_the_reference_is() {
        let timeline = Timeline {
            number: 1,
            jumped: 0,
            shift: 21_000_000,
            left: 250_000,
            slid: 0,
            epoch: 5,
            ..Timeline::default()
        };
        for (continued, in_effect) in [(20_757_000, 20_757_000), (20_690_000, 20_750_000)] {
            let mut slide = Slide::default();
            slide.follow(timeline, Some(continued), Instant(0));
            assert_eq!(slide.in_effect(), in_effect);
        }
        let mut slide = Slide::default();
        slide.follow(Timeline { left: 0, ..timeline }, Some(20_999_000), Instant(0));
        assert_eq!(slide.in_effect(), slide.shift(), "no steps follow");
    }

    #[test]
    fn a_small_rest_forward_is_made_up_by_200_ns_per_millisecond() {
        let mut slide = Slide::default();
        let timeline = Timeline {
            number: 1,
            jumped: 0,
            shift: 7_000_000,
            left: -10_000,
            slid: 0,
            epoch: 5,
            ..Timeline::default()
        };
        slide.follow(timeline, None, Instant(0));
        for cycle in 1..=50 {
            assert_eq!(slide.step(Instant(cycle * 1_000_000)), 7_010_000 - cycle * 200);
        }
        assert_eq!(slide.step(Instant(51_000_000)), slide.shift());
    }

    #[test]
    fn a_jump_counts_once() {
        let mut slide = Slide::default();
        let timeline =
            Timeline { number: 1, jumped: 77, shift: 0, left: 0, slid: 0, epoch: 1_000, ..Timeline::default() };
        assert_eq!(slide.follow(timeline, None, Instant(0)), 77);
        assert_eq!(slide.follow(timeline, None, Instant(0)), 0);
        assert_eq!(slide.step(Instant(1 << 40)), 0);
    }
}
