//! Frequency of a free-running clock: a constant error and a slow wander, as caused by temperature (protocol 11.4).
//!
//! Input: virtual time since power-on. Output: nanoseconds counted by the free-running clock, with 24 fractional bits.
//! It is a pure function, so that the order of queries does not matter.

use core::time::Duration;

/// Fractional bits of times in the clock.
pub(super) const FRACTION: u32 = 24;

const BILLION: i128 = 1_000_000_000;

/// A wander of the clock's frequency: a triangle that starts at zero, rises, falls and returns within a period.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wander {
    /// Largest deviation in parts per billion.
    pub amplitude_ppb: i64,
    /// Period; zero is no wander.
    pub period: Duration,
}

/// The free-running clock.
#[derive(Clone, Copy, Debug)]
pub(super) struct Oscillator {
    pub drift_ppb: i64,
    pub wander: Wander,
}

impl Oscillator {
    /// Count at `elapsed_ns` after power-on.
    pub fn counted(&self, elapsed_ns: i128) -> i128 {
        let drift = elapsed_ns * i128::from(self.drift_ppb);
        (elapsed_ns << FRACTION) + ((drift << FRACTION) + self.wandered(elapsed_ns)) / BILLION
    }

    /// Integral of the wander, in billionths of nanoseconds with fraction.
    fn wandered(&self, elapsed_ns: i128) -> i128 {
        let quarter = (self.wander.period.as_nanos() / 4) as i128;
        if quarter == 0 || self.wander.amplitude_ppb == 0 {
            return 0;
        }
        let x = elapsed_ns.rem_euclid(4 * quarter);
        // Area below the triangle of height `quarter`: it rises to a quarter squared and is zero after a period.
        let area = if x < quarter {
            x * x / 2
        } else if x < 3 * quarter {
            quarter * quarter - (2 * quarter - x).pow(2) / 2
        } else {
            (4 * quarter - x).pow(2) / 2
        };
        ((area / quarter) << FRACTION) * i128::from(self.wander.amplitude_ppb)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NS: i128 = 1 << FRACTION;

    #[test]
    fn a_wander_is_zero_after_a_period_and_largest_in_its_middle() {
        let wander = Wander { amplitude_ppb: 1_000, period: Duration::from_secs(4) };
        let clock = Oscillator { drift_ppb: 0, wander };
        let gained = |ms: i128| (clock.counted(ms * 1_000_000) - ms * 1_000_000 * NS) / NS;
        assert_eq!(gained(4_000), 0);
        // Half a period at a mean of 500 ppb: 1 us.
        assert_eq!(gained(2_000), 1_000);
        assert_eq!(gained(1_000), 500);
        assert_eq!(gained(3_000), 500);
        assert_eq!(gained(9_000), 500);
    }
}
