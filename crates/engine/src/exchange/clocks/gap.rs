//! The difference between two references while both show the same time, because their paths from the host have
//! different lengths: a mean over as many cycles as the jitter of the host requires.
//!
//! Input: the differences that frames read, which contain the sending jitter of the host and now and then a stall of
//! it. A stall carries no information about clocks: of each block of differences the smallest and the largest do not
//! count.

/// Smallest number of cycles; for references that have not followed one clock until now, the only one. It is also the
/// size of a block.
const LEAST_CYCLES: u32 = 16;
/// Most cycles: free-running clocks drift apart meanwhile.
const MOST_CYCLES: u32 = 4_096;
/// Required accuracy.
const EXACT_NS: i64 = 300;
/// Required accuracy as far as this number of cycles suffices for it: the error of the gap remains, and counts as a
/// drift of the clock.
const MORE_EXACT_NS: i64 = 100;
const MORE_EXACT_CYCLES: i64 = 512;
/// Upper limit of a deviation: more is no jitter.
const MOST_NOISE_NS: i64 = 100_000;

/// Differences so far.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Finding {
    most_cycles: u32,
    cycles: u32,
    /// Sum and number of the differences of complete blocks.
    sum: i64,
    counted: i64,
    block: Block,
    /// Sum of the deviations from the mean so far.
    noise: i64,
}

/// The gap, and the mean deviation of the differences from it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Found {
    pub gap: i64,
    pub noise_ns: i64,
}

/// Differences of an incomplete block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Block {
    sum: i64,
    count: u32,
    smallest: i64,
    largest: i64,
}

impl Block {
    const EMPTY: Block = Block { sum: 0, count: 0, smallest: i64::MAX, largest: i64::MIN };

    fn with(self, difference: i64) -> Block {
        Block {
            sum: self.sum.saturating_add(difference),
            count: self.count + 1,
            smallest: self.smallest.min(difference),
            largest: self.largest.max(difference),
        }
    }
}

impl Finding {
    /// Begins. `together`: both have followed one clock until now, so there is time for an exact gap.
    pub const fn begin(together: bool) -> Finding {
        let most_cycles = if together { MOST_CYCLES } else { LEAST_CYCLES };
        Finding { most_cycles, cycles: 0, sum: 0, counted: 0, block: Block::EMPTY, noise: 0 }
    }

    /// Takes a difference.
    #[must_use]
    pub fn take(mut self, difference: i64) -> Finding {
        self.cycles += 1;
        self.block = self.block.with(difference);
        let deviation = difference.saturating_sub(self.mean()).saturating_abs();
        self.noise = self.noise.saturating_add(deviation.min(MOST_NOISE_NS));
        if self.block.count == LEAST_CYCLES {
            let Block { sum, count, smallest, largest } = self.block;
            self.sum = self.sum.saturating_add(sum.saturating_sub(smallest).saturating_sub(largest));
            self.counted += i64::from(count) - 2;
            self.block = Block::EMPTY;
        }
        self
    }

    /// The gap, once enough differences were taken.
    pub fn found(&self) -> Option<Found> {
        let noise_ns = self.noise / i64::from(self.cycles.max(1));
        let cycles_for = |exact_ns: i64| (noise_ns / exact_ns).saturating_mul(noise_ns / exact_ns);
        let enough = cycles_for(EXACT_NS).max(cycles_for(MORE_EXACT_NS).min(MORE_EXACT_CYCLES));
        let is_enough = i64::from(self.cycles) >= enough.min(self.most_cycles.into());
        let is_whole = self.block.count == 0 && self.counted > 0;
        (is_enough && is_whole).then(|| Found { gap: self.mean(), noise_ns })
    }

    /// The mean so far.
    fn mean(&self) -> i64 {
        match (self.counted, self.block.count) {
            (0, 0) => 0,
            (0, count) => self.block.sum / i64::from(count),
            (counted, _) => self.sum / counted,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn find(together: bool, differences: impl IntoIterator<Item = i64>) -> (u32, Option<Found>) {
        let mut finding = Finding::begin(together);
        for difference in differences {
            finding = finding.take(difference);
            if let Some(found) = finding.found() {
                return (finding.cycles, Some(found));
            }
        }
        (finding.cycles, None)
    }

    /// Jitter up to `most` ns around 9,500 ns.
    fn jitter(most: i64) -> impl Iterator<Item = i64> {
        (0..5_000).map(move |number| 9_500 - most / 2 + (number * 7_919) % (most + 1))
    }

    #[test]
    fn the_more_jitter_the_more_cycles_and_the_error_stays_below_a_tenth_of_it() {
        for (most, cycles) in [(0, 16), (1_000, 16), (5_000, 144), (20_000, 512), (60_000, 2_512)] {
            let (taken, found) = find(true, jitter(most));
            let found = found.expect("there are enough");
            assert!(taken.abs_diff(cycles) <= cycles / 4, "{most} ns: {taken} cycles");
            assert!((found.gap - 9_500).abs() <= most / 10, "{most} ns: {found:?}");
        }
    }

    #[test]
    fn a_stall_in_each_block_does_not_count() {
        let stalled = |number| if number % 16 == 5 { 1_000_000 } else { 0 };
        let differences = jitter(5_000).enumerate().map(|(number, late)| late + stalled(number));
        let (_, found) = find(true, differences);
        assert!(found.is_some_and(|found| (found.gap - 9_500).abs() < 300), "{found:?}");
    }

    #[test]
    fn references_that_have_not_followed_one_clock_have_a_block_only() {
        assert_eq!(find(false, jitter(60_000)).0, 16);
        assert_eq!(find(true, jitter(60_000).take(1_000)).1, None);
    }

    #[test]
    fn any_value_is_taken_without_overflow() {
        let (_, found) = find(true, [i64::MAX, i64::MIN].into_iter().cycle().take(5_000));
        assert!(found.is_some());
    }
}
