//! The control loop of DC_SYSTEM_TIME (protocol 7.2.1); `docs/dc.md` states which parts are documented and which are a
//! model.
//!
//! Input: the difference between the local copy of the system time and the received time, at each write of 0x0910.
//! Output: the correction of the local clock until the next sample, and the contents of 0x092C and 0x0932.

use super::oscillator::FRACTION;

/// Tick of the clock in nanoseconds: the clock is corrected by adding or omitting one nanosecond in a tick.
const TICK_NS: i128 = 10;
/// Fraction of the filtered difference that is corrected in phase until the next sample, as a shift.
const PHASE_SHIFT: u32 = 6;
/// Fraction of the filtered difference, in nanoseconds, by which the speed counter difference changes per sample, as a
/// left shift, in addition to the right shift by the depth of the speed filter: 8 / 2^12.
const SPEED_SHIFT: u32 = 3;
/// Maximum change of the speed counter difference per sample.
const MAX_SPEED_STEP: i128 = 8;
/// Limits of DC_SPEED_COUNTER_START.
const START: (i128, i128) = (0x0080, 0x3FFF);
/// Larger filter depths have no effect: the filters are sums of 31 bits.
const MAX_DEPTH: u8 = 15;

/// Registers of the loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::controller) struct LoopSettings {
    /// DC_SPEED_COUNTER_START.
    pub start: u16,
    /// DC_FILTER_DIFFERENCE.
    pub difference_depth: u8,
    /// DC_FILTER_SPEED.
    pub speed_depth: u8,
}

/// The state of the loop.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ControlLoop {
    /// Filtered difference in nanoseconds, with fraction. Positive: the local clock is ahead.
    mean: i128,
    /// Speed counter difference, with fraction. Positive: the local period is too long, the clock is accelerated.
    difference: i128,
}

/// Correction of the clock from one sample to the next.
#[derive(Clone, Copy, Debug)]
pub(super) struct Steering {
    /// Relative correction of the speed, as a fraction.
    numerator: i128,
    denominator: i128,
    /// Nanoseconds, with fraction, that are added gradually.
    phase: i128,
    /// Nanoseconds of the clock per nanosecond of phase correction.
    ns_per_phase_ns: i128,
}

impl Steering {
    /// No correction.
    pub const FREE: Steering = Steering { numerator: 0, denominator: 1, phase: 0, ns_per_phase_ns: 1 };

    /// Correction added while the free-running clock counts `counted`, with fraction.
    pub fn added(&self, counted: i128) -> i128 {
        let phase = (counted.max(0) / self.ns_per_phase_ns).min(self.phase.abs());
        counted * self.numerator / self.denominator + phase * self.phase.signum()
    }
}

impl ControlLoop {
    /// Processes a sample: local copy minus received time, in nanoseconds with fraction.
    pub fn sample(&mut self, dt: i128, settings: LoopSettings) {
        let limit = limit(settings) << FRACTION;
        self.mean += (dt - self.mean) >> settings.difference_depth.min(MAX_DEPTH);
        let step = (self.mean << SPEED_SHIFT) >> settings.speed_depth.min(MAX_DEPTH);
        let most = MAX_SPEED_STEP << FRACTION;
        self.difference = (self.difference - step.clamp(-most, most)).clamp(-limit, limit);
    }

    /// The correction from now on.
    pub fn steering(&self, settings: LoopSettings) -> Steering {
        let start = start(settings);
        // deviation = Diff / (5 (Start + Diff + 2) (Start - Diff + 2)), with the fraction of Diff kept.
        let base = (start + 2) << FRACTION;
        let product = ((base + self.difference) >> 8) * ((base - self.difference) >> 8);
        Steering {
            numerator: self.difference << (FRACTION - 16),
            denominator: 5 * product,
            phase: -(self.mean >> PHASE_SHIFT),
            ns_per_phase_ns: start * TICK_NS,
        }
    }

    /// DC_SYSTEM_TIME_DIFFERENCE: magnitude, and bit 31 if the local copy is not behind.
    pub fn difference_register(&self) -> u32 {
        let rounded = (self.mean + (1 << (FRACTION - 1))) >> FRACTION;
        let magnitude = rounded.unsigned_abs().min(0x7FFF_FFFF) as u32;
        magnitude | u32::from(self.mean >= 0) << 31
    }

    /// DC_SPEED_COUNTER_DIFFERENCE.
    pub fn speed_register(&self) -> i16 {
        (self.difference >> FRACTION) as i16
    }
}

fn start(settings: LoopSettings) -> i128 {
    i128::from(settings.start).clamp(START.0, START.1)
}

/// Largest speed counter difference.
fn limit(settings: LoopSettings) -> i128 {
    start(settings) - 0x7F
}

#[cfg(test)]
mod tests {
    use super::*;

    const NS: i128 = 1 << FRACTION;
    const RESET: LoopSettings = LoopSettings { start: 0x1000, difference_depth: 4, speed_depth: 12 };

    fn at_difference(difference: i128) -> Steering {
        ControlLoop { mean: 0, difference: difference * NS }.steering(RESET)
    }

    // covers: 7.2.1
    #[test]
    fn one_unit_of_the_speed_counter_is_0_012_ppm_and_the_range_ends_near_760_ppm() {
        let second = 1_000_000_000 * NS;
        let ppb = |difference| at_difference(difference).added(second) / NS;
        assert_eq!(ppb(1), 11);
        assert_eq!(ppb(-100), -1_191);
        // 3969 / (5 * 8067 * 129)
        assert_eq!(ppb(limit(RESET)), 762_797);
    }

    // covers: 7.2.1
    #[test]
    fn phase_is_corrected_by_one_nanosecond_per_start_ticks_up_to_its_amount() {
        let steering = ControlLoop { mean: 640 * NS, difference: 0 }.steering(RESET);
        let added = |us: i128| steering.added(us * 1_000 * NS) / NS;
        // 4096 ticks of 10 ns for each nanosecond, 640 / 64 nanoseconds in total.
        assert_eq!((added(205), added(410), added(10_000)), (-5, -10, -10));
    }

    // covers: 7.2.1
    #[test]
    fn the_mean_follows_with_the_depth_of_its_filter() {
        let mut shallow = ControlLoop::default();
        shallow.sample(1_600 * NS, RESET);
        assert_eq!(shallow.difference_register(), 0x8000_0000 | 100);
        let mut direct = ControlLoop::default();
        direct.sample(-7 * NS, LoopSettings { difference_depth: 0, ..RESET });
        assert_eq!(direct.difference_register(), 7);
        for _ in 0..200 {
            shallow.sample(-50 * NS, RESET);
        }
        assert_eq!(shallow.difference_register(), 50);
    }

    // covers: 7.2.1
    #[test]
    fn no_difference_moves_the_speed_beyond_its_limit() {
        for (dt, limit) in [(1i128 << 31, -3_969), (-(1i128 << 31), 3_969)] {
            let mut control = ControlLoop::default();
            for _ in 0..2_000 {
                control.sample(dt * NS, RESET);
            }
            assert_eq!(control.speed_register(), limit);
        }
        let extreme = LoopSettings { start: 0, difference_depth: 255, speed_depth: 255 };
        let mut control = ControlLoop::default();
        (0..100).for_each(|_| control.sample(-(NS << 31), extreme));
        assert!(control.speed_register() <= 1);
        assert!(control.steering(extreme).added(1_000 * NS).abs() < 100 * NS);
    }
}
