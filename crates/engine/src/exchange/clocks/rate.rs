//! Rate of the reference clock against the host's clock: without it the predicted time of the reference is wrong by
//! what both differ in since the last reading, 50 ns in a cycle of 1 ms at 50 ppm. Clocks that frames pass before the
//! reference follow that prediction (protocol 7.2).
//!
//! Each reading contains the sending delay of the host. Means of blocks are compared, over a growing time: the delay
//! takes no part in the rate after some seconds.

use crate::time::Instant;

/// Rates beyond this are none: the control loop of a clock compensates 760 ppm at most.
const MAX_RATE_PPB: i64 = 2_000_000;
/// A reading that is older is not corrected for more than this.
const MAX_AGE_NS: u64 = 1_000_000_000;
/// Readings in a block.
const BLOCK: u32 = 64;
/// Blocks are compared with one that is this old at most; then with a newer one, as rates change with temperature.
const LONGEST_NS: u64 = 8_000_000_000;
/// Bits of the fraction of a rate.
const FRACTION: u32 = 32;

/// The rate, from readings of the reference.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Rate {
    /// Nanoseconds that the reference gains per nanosecond of the host, in units of 2^-32.
    gain: i64,
    block: Option<Block>,
    /// The block with which the newest is compared, and one half as old.
    first: Option<Mean>,
    middle: Option<Mean>,
}

/// Readings of a block that is not full.
#[derive(Clone, Copy, Debug)]
struct Block {
    /// Time of the reference minus that of the host in the first reading.
    offset: u64,
    begin: Instant,
    /// Differences of the others from it, and their times after its time.
    sum: i64,
    after_ns: u64,
    count: u32,
}

/// Mean of a block.
#[derive(Clone, Copy, Debug)]
struct Mean {
    offset: u64,
    at: Instant,
}

impl Rate {
    /// What the reference gains in this time of the host, in nanoseconds.
    #[inline(always)]
    pub(super) fn gained(&self, elapsed_ns: u64) -> u64 {
        ((self.gain * elapsed_ns.min(MAX_AGE_NS) as i64) >> FRACTION) as u64
    }

    /// The time of the reference has jumped, or the reference is another one. The rate is kept until it is known again.
    pub(super) const fn restart(&mut self) {
        (self.block, self.first, self.middle) = (None, None, None);
    }

    /// Takes a reading of the reference, by a frame that was sent at `sent_at`.
    #[inline(always)]
    pub(super) fn read(&mut self, time: u64, sent_at: Instant) {
        let offset = time.wrapping_sub(sent_at.0);
        let begin = Block { offset, begin: sent_at, sum: 0, after_ns: 0, count: 0 };
        let block = self.block.get_or_insert(begin);
        block.sum = block.sum.wrapping_add(offset.wrapping_sub(block.offset) as i64);
        block.after_ns = block.after_ns.wrapping_add(sent_at.0.wrapping_sub(block.begin.0));
        block.count += 1;
        if block.count == BLOCK {
            self.evaluate();
        }
    }

    /// Compares a full block with the first one.
    #[cold]
    fn evaluate(&mut self) {
        let Some(block) = self.block.take() else { return };
        let mean = block.sum / i64::from(BLOCK);
        // Readings may have been seldom, or left out for a while.
        let at = Instant(block.begin.0.saturating_add(block.after_ns / u64::from(BLOCK)));
        let newest = Mean { offset: block.offset.wrapping_add(mean as u64), at };
        let Some(first) = self.first else {
            self.first = Some(newest);
            return;
        };
        let elapsed = at.0.saturating_sub(first.at.0).max(1) as i64;
        let gained = newest.offset.wrapping_sub(first.offset) as i64;
        let most = (elapsed as i128 * MAX_RATE_PPB as i128 / 1_000_000_000) as i64;
        self.gain = ((gained.clamp(-most, most) as i128) << FRACTION).div_euclid(elapsed as i128) as i64;
        let age = |mean: Mean| at.0.saturating_sub(mean.at.0);
        if self.middle.is_none() && age(first) >= LONGEST_NS / 2 {
            self.middle = Some(newest);
        } else if age(first) >= LONGEST_NS {
            (self.first, self.middle) = (self.middle, Some(newest));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Readings of a reference with this rate, each `cycle_ns`, by a host that sends up to `late_ns` late.
    fn read(rate: &mut Rate, (begin, cycles): (u64, u64), cycle_ns: u64, ppb: i64, late_ns: u64) {
        let mut random = 0x9E37_79B9_7F4A_7C15_u64;
        for cycle in begin..begin + cycles {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            let late = if late_ns == 0 { 0 } else { (random >> 33) % late_ns };
            let sent_at = cycle * cycle_ns;
            let passed_at = sent_at + late;
            let time = (1_000_000_007_i64
                + passed_at as i64
                + (passed_at as i128 * i128::from(ppb) / 1_000_000_000) as i64) as u64;
            rate.read(time, Instant(sent_at));
        }
    }

    // covers: 7.2, dc-late-host
    #[test]
    fn the_rate_is_known_after_two_blocks_and_exact_with_a_late_host_after_seconds() {
        for cycle_ns in [62_500, 250_000, 1_000_000, 4_000_000] {
            for ppb in [-200_000, -50_000, 0, 30, 100_000] {
                let mut exact = Rate::default();
                read(&mut exact, (0, 2 * 64), cycle_ns, ppb, 0);
                let gained = |rate: &Rate| rate.gained(1_000_000) as i64;
                assert!((gained(&exact) - ppb / 1_000).abs() <= 1, "{cycle_ns}, {ppb}: {}", gained(&exact));
                let mut late = Rate::default();
                read(&mut late, (0, 10_000_000_000 / cycle_ns), cycle_ns, ppb, 50_000);
                assert!((gained(&late) - ppb / 1_000).abs() <= 3, "{cycle_ns}, {ppb}: {}", gained(&late));
            }
        }
    }

    // covers: 7.2
    #[test]
    fn readings_at_unequal_distances_give_the_same_rate() {
        let mut rate = Rate::default();
        read(&mut rate, (0, 64 + 10), 1_000_000, 50_000, 0);
        // Nothing is distributed for 5 s, in the middle of a block.
        read(&mut rate, (5_000, 54), 1_000_000, 50_000, 0);
        assert!((49..=50).contains(&rate.gained(1_000_000)), "{}", rate.gained(1_000_000));
    }

    // covers: 7.2
    #[test]
    fn a_rate_that_changes_is_followed_and_a_jump_of_the_time_is_none() {
        let mut rate = Rate::default();
        read(&mut rate, (0, 20_000), 1_000_000, 50_000, 0);
        rate.restart();
        assert!((49..=50).contains(&rate.gained(1_000_000)), "it is kept");
        read(&mut rate, (20_000, 20_000), 1_000_000, -20_000, 0);
        assert!((-21..=-20).contains(&(rate.gained(1_000_000) as i64)));
        // A reading that is wrong by a second does not move clocks away.
        let mut wrong = Rate::default();
        read(&mut wrong, (0, 64), 1_000_000, 0, 0);
        (0..64).for_each(|cycle| wrong.read(9_000_000_000_000 + cycle, Instant((64 + cycle) * 1_000_000)));
        assert!((MAX_RATE_PPB / 1_000 - 1..=MAX_RATE_PPB / 1_000).contains(&(wrong.gained(1_000_000) as i64)));
    }
}
