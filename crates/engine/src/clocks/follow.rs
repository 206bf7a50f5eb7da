//! Adjusts the cycle of the host to the reference clock (master shift, protocol 7.4).
//!
//! Input: the system time at which the host's next cycle begins. Output: the correction of the cycle after it. Every
//! cyclic frame reads the reference clock, and its send time on the host is known, so neither late wake-ups nor the
//! propagation of the frame disturb the loop.

/// Part of a phase error that one cycle corrects, as a shift.
const PROPORTIONAL: u32 = 4;
/// Part of a phase error by which the cycle length changes, as a shift.
const INTEGRAL: u32 = 9;
/// Fractional bits of the cycle length.
const FRACTION: u32 = 16;

/// Phase error of `time` in nanoseconds: its distance behind (positive) or ahead of the nearest time that is `phase_ns`
/// modulo the period.
pub const fn phase_error(time: u64, period_ns: u64, phase_ns: i64) -> i64 {
    if period_ns == 0 {
        return 0;
    }
    let period = period_ns as i64;
    let behind = (time.wrapping_sub(phase_ns.rem_euclid(period) as u64) % period_ns) as i64;
    if behind > period / 2 { behind - period } else { behind }
}

/// The control loop of the phase.
#[derive(Clone, Copy, Debug)]
pub struct Follower {
    period_ns: u64,
    phase_ns: i64,
    /// Correction of each cycle's length relative to the host's period, with fraction.
    length: i64,
    error_ns: i64,
    /// Consecutive cycles within a hundredth of the period.
    near: u32,
}

impl Follower {
    /// Cycles of `period_ns` begin when the system time is `phase_ns` modulo the period.
    pub const fn new(period_ns: u64, phase_ns: i64) -> Follower {
        Follower { period_ns, phase_ns, length: 0, error_ns: 0, near: 0 }
    }

    /// Takes the system time at which the host's next cycle begins. Returns the correction of the cycle after it, in
    /// nanoseconds.
    pub fn correction(&mut self, time: u64) -> i64 {
        self.error_ns = phase_error(time, self.period_ns, self.phase_ns);
        self.near = if self.error_ns.unsigned_abs() <= self.period_ns / 100 { self.near.saturating_add(1) } else { 0 };
        let scaled = self.error_ns << FRACTION;
        // Clocks differ by at most 1,000 ppm.
        let limit = ((self.period_ns as i64) << FRACTION) / 1_000;
        self.length = (self.length - (scaled >> (INTEGRAL + PROPORTIONAL / 2))).clamp(-limit, limit);
        let step = (self.length - (scaled >> PROPORTIONAL) + (1 << (FRACTION - 1))) >> FRACTION;
        let most = (self.period_ns / 10) as i64;
        step.clamp(-most, most)
    }

    /// The last phase error in nanoseconds; positive: the host is late.
    pub const fn error_ns(&self) -> i64 {
        self.error_ns
    }

    /// Whether the phase has been kept to within a hundredth of the period for a hundred cycles.
    pub const fn is_locked(&self) -> bool {
        self.near >= 100
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_phase_error_is_the_distance_to_the_nearest_phase() {
        assert_eq!(phase_error(5_000_100, 1_000_000, 0), 100);
        assert_eq!(phase_error(4_999_900, 1_000_000, 0), -100);
        assert_eq!(phase_error(5_200_100, 1_000_000, 200_000), 100);
        assert_eq!(phase_error(4_800_100, 1_000_000, -200_000), 100);
        assert_eq!(phase_error(1, 0, 0), 0);
    }

    /// Follows a reference clock that is `ppm` fast, from a first phase error; returns the largest error in the last of
    /// 5 s.
    fn settle(ppm: i64, first_error: i64) -> (Follower, i64) {
        let mut follower = Follower::new(1_000_000, 300_000);
        let (mut host, mut worst) = (first_error + 300_000, 0);
        for cycle in 0..5_000 {
            let reference = (host + host * ppm / 1_000_000) as u64;
            let step = follower.correction(reference);
            if cycle > 4_000 {
                worst = worst.max(follower.error_ns().abs());
            }
            host += 1_000_000 + step;
        }
        (follower, worst)
    }

    // covers: dc-master-shift
    #[test]
    fn any_drift_and_any_first_phase_settle_within_seconds() {
        for ppm in [-100, -1, 0, 50, 100] {
            for first in [0, 499_000, -400_000] {
                let (follower, worst) = settle(ppm, first);
                assert!(worst <= 20 && follower.is_locked(), "{ppm} ppm, {first} ns: {worst} ns");
            }
        }
    }
}
