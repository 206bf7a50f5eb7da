//! Application time and system time: the shift between them, and its gradual changes.
//!
//! When the application's time jumps while SYNC signals run, the system time goes on without a jump. The supervisor
//! posts a new shift, by which both times differ from then on, and the rest of the jump is made up gradually: clocks
//! that follow the reference stay together, and pulses keep their distance.

use crate::board::clock_times::Timeline;
use crate::time::Instant;

/// Nanoseconds in which the system time is moved by one: 200 ppm. Control loops take out 760 ppm, of which up to 200
/// compensate the drift of the clocks.
const SLOWNESS: u64 = 5_000;
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
    /// Application time minus the system time that is written.
    in_effect: u64,
    at: Instant,
    /// Remainder of the last step, in nanoseconds of host time.
    rest: u64,
    /// System time of the reference clock at host time zero when the system time was posted; `None` before.
    epoch: Option<u64>,
}

impl Slide {
    /// Takes over a posted system time; returns its jump. `wanted` is the application time at host time zero towards
    /// which the reference is steered. The system time that is written continues that of the reference.
    pub fn follow(&mut self, timeline: Timeline, wanted: Option<u64>, now: Instant) -> u64 {
        let jump = timeline.jumped.wrapping_sub(self.jumped);
        if timeline.number != self.number {
            let continued = wanted.map(|epoch| epoch.wrapping_sub(timeline.epoch));
            let Timeline { number, jumped, shift, epoch } = timeline;
            let in_effect = continued.unwrap_or(shift);
            *self = Slide { number, jumped, shift, in_effect, at: now, rest: 0, epoch: Some(epoch) };
        }
        jump
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
        self.in_effect
    }

    /// The shift in effect now.
    pub fn step(&mut self, now: Instant) -> u64 {
        let left = self.shift.wrapping_sub(self.in_effect) as i64;
        let passed = now.0.saturating_sub(self.at.0).min(LONGEST_NS) + self.rest;
        let most = (passed / SLOWNESS) as i64;
        (self.at, self.rest) = (now, passed % SLOWNESS);
        self.in_effect = self.in_effect.wrapping_add(left.clamp(-most, most) as u64);
        self.in_effect
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rest_of_a_jump_is_made_up_by_200_ns_per_millisecond_in_either_direction() {
        for direction in [1, -1_i64] {
            let mut slide = Slide::default();
            let epoch = 5_000_000_u64;
            let wanted = epoch.wrapping_add_signed(3_000_000 * 7 + direction * 250_000);
            let timeline = Timeline { number: 1, jumped: 0, shift: 21_000_000, epoch };
            assert_eq!(slide.follow(timeline, Some(wanted), Instant(0)), 0);
            let begin = slide.in_effect();
            assert_eq!(begin as i64, 21_000_000 + direction * 250_000);
            for cycle in 1..=1_250 {
                slide.step(Instant(cycle * 1_000_000));
                assert_eq!(slide.in_effect().abs_diff(begin), cycle * 200);
            }
            assert_eq!(slide.step(Instant(1_251_000_000)), slide.shift());
        }
    }

    #[test]
    fn a_jump_counts_once_and_continues_the_time_that_is_written() {
        let mut slide = Slide::default();
        let timeline = Timeline { number: 1, jumped: 77, shift: 0, epoch: 1_000 };
        assert_eq!(slide.follow(timeline, None, Instant(0)), 77);
        assert_eq!(slide.follow(timeline, Some(5_000), Instant(0)), 0);
        assert_eq!(slide.step(Instant(1 << 40)), 0);
    }
}
