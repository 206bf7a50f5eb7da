//! Whether the clocks follow the time that the application gives, and what is necessary for it.

use alloc::vec::Vec;

use crate::board::clock_times::{Timeline, Wanted};
use crate::order::InOrder;

/// Differences up to this are made up by the control loop of the reference.
const FAR_NS: i64 = 100_000;
/// Readings of the reference until a far time counts.
const READINGS: usize = 16;
/// These readings differ by no more than this, or by no more than this part of the difference, as a shift.
const SAME_NS: i64 = 100_000;
const SAME_SHARE: u32 = 3;
/// Longest pattern of SYNC signals that is kept: the rest of a jump, less than one pattern, is made up gradually.
const LONGEST_PATTERN_NS: u64 = 20_000_000;
/// A rest up to this is made up forward, by the control loop of the reference: the accuracy of the readings.
const FORWARD_NS: i64 = 10_000;
/// Nanoseconds in which the system time goes back by one: 400 ppm.
const SLOWNESS: u64 = 2_500;
/// Largest step: a clock whose offset is written later than that of another differs from it by this.
const LARGEST_STEP_NS: u64 = 800;

/// Application time and system time.
#[derive(Debug, Default)]
pub struct Times {
    /// The posted system time.
    pub timeline: Timeline,
    /// System time to be reached minus system time, by each reading while they are far apart.
    far: Vec<i64>,
    /// Nanoseconds by which the system time is still to go back in steps.
    left_ns: u64,
    /// The number of the last wanted time before; `None` once the exchange has reported by how much it goes back.
    unsaid: Option<u32>,
    /// Nanoseconds by which it has gone back in steps.
    slid: u64,
    /// The number of the last wanted time that was compared.
    compared: u32,
    /// The first time that the application has set was followed, or is not to be followed any more.
    is_first_followed: bool,
}

/// What follows from a time that is far away.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// All clocks are set: their system time jumps by this, and the shift is 0.
    Jump(u64),
    /// The system time goes on, with this shift once it has gone back by some nanoseconds; negative: forward.
    Shift {
        /// Application time minus system time.
        shift: u64,
        /// Nanoseconds by which it goes back.
        left: i64,
    },
}

impl Times {
    /// The first application time is the system time of the set-up. Returns that time at host time zero.
    pub fn begin(&mut self, first_epoch: Option<u64>) -> Option<u64> {
        self.is_first_followed |= first_epoch.is_some();
        first_epoch
    }

    /// The system time goes on as it is: a first time of the application is not followed any more.
    #[cfg(feature = "standby")]
    pub fn follow_no_first(&mut self) {
        self.is_first_followed = true;
        self.far.clear();
    }

    /// Whether readings of the reference are necessary.
    pub fn is_pending(&self) -> bool {
        !self.far.is_empty()
    }

    /// Takes a reading of the reference: the system time at host time zero. Returns the next step. `first` is the first
    /// time that the application has set, at host time zero. `pattern_ns` is the common pattern of running SYNC
    /// signals; `None` if none is running.
    pub fn compare(
        &mut self,
        epoch: u64,
        wanted: Option<Wanted>,
        first: Option<u64>,
        pattern_ns: Option<u64>,
    ) -> Option<Step> {
        let first = first.filter(|_| !self.is_first_followed && pattern_ns.is_none());
        let (target, written) = match (wanted, first) {
            (Some(wanted), _) if wanted.number == self.compared => return None,
            (Some(wanted), _) => {
                self.compared = wanted.number;
                (wanted.epoch, wanted.epoch.wrapping_sub(wanted.shift))
            }
            (None, Some(first)) => (first, first),
            (None, None) => return None,
        };
        let difference = written.wrapping_sub(epoch) as i64;
        if difference.unsigned_abs() <= FAR_NS.unsigned_abs() {
            self.is_first_followed |= first.is_some();
            self.far.clear();
            return None;
        }
        let same = SAME_NS.max((difference >> SAME_SHARE).saturating_abs());
        if self.far.first().is_some_and(|first| first.wrapping_sub(difference).saturating_abs() > same) {
            self.far.clear();
        }
        self.far.push(difference);
        if self.far.len() < READINGS {
            return None;
        }
        self.far.put_in_order();
        let middle = self.far[READINGS / 2];
        self.far.clear();
        self.is_first_followed |= first.is_some();
        // The whole difference between both times: the present shift is not kept.
        let whole = target.wrapping_sub(written).wrapping_add_signed(middle);
        Some(match pattern_ns {
            None => Step::Jump(whole),
            Some(pattern) => {
                let shift = next_multiple(whole.wrapping_sub(FORWARD_NS as u64), pattern);
                Step::Shift { shift, left: shift.wrapping_sub(whole) as i64 }
            }
        })
    }

    /// Nanoseconds by which the system time is still to go back in steps.
    pub fn left_ns(&self) -> u64 {
        self.left_ns
    }

    /// Whether it goes back in steps now.
    pub fn is_sliding(&self) -> bool {
        self.left_ns > 0 && self.unsaid.is_none()
    }

    /// Takes the shift in effect of the first time that was written with a new shift.
    pub fn take_shift_in_effect(&mut self, wanted: Option<Wanted>) {
        let Some((before, wanted)) = self.unsaid.zip(wanted) else { return };
        if wanted.number != before {
            self.left_ns = (self.timeline.shift.wrapping_sub(wanted.shift) as i64).max(0).unsigned_abs();
            self.unsaid = None;
        }
    }

    /// The next step back, in nanoseconds, this long after the last one.
    pub fn step_ns(&self, passed_ns: u64) -> u64 {
        if self.is_sliding() { (passed_ns / SLOWNESS).min(LARGEST_STEP_NS).min(self.left_ns) } else { 0 }
    }

    /// The system time goes back by a step.
    pub fn slide(&mut self, step_ns: u64) {
        self.left_ns = self.left_ns.saturating_sub(step_ns);
        self.slid = self.slid.wrapping_add(step_ns);
    }

    /// Nanoseconds by which it has gone back in steps.
    pub fn slid(&self) -> u64 {
        self.slid
    }

    /// Another system time begins: it jumps, and differs from the application time by a shift, once it has gone back by
    /// `left` nanoseconds. `epoch` is the system time at host time zero.
    pub fn turn(&mut self, jump: u64, (shift, left): (u64, i64), epoch: u64) -> Timeline {
        let Timeline { number, jumped, .. } = self.timeline;
        let (number, jumped) = (number.wrapping_add(1), jumped.wrapping_add(jump));
        (self.left_ns, self.unsaid) = (left.max(0).unsigned_abs(), Some(self.compared));
        self.timeline = Timeline { number, jumped, shift, left, slid: self.slid, epoch, is_adopted: false };
        self.timeline
    }

    /// The system time goes on as another MainDevice has set it; the shift was read. `epoch` is the system time at host
    /// time zero.
    #[cfg(feature = "standby")]
    pub fn adopt(&mut self, shift: u64, epoch: u64) -> Timeline {
        self.turn(0, (shift, 0), epoch);
        self.unsaid = None;
        self.timeline.is_adopted = true;
        self.timeline
    }
}

/// The smallest multiple of a pattern that is not less than a signed time.
fn next_multiple(time: u64, pattern_ns: u64) -> u64 {
    let (time, pattern) = (time as i64, pattern_ns.max(1) as i64);
    let more = time.wrapping_neg().rem_euclid(pattern);
    time.wrapping_add(more) as u64
}

/// The time after which all these patterns of SYNC signals repeat together, in nanoseconds; that of the longest if this
/// takes too long.
pub fn common_pattern(patterns: impl Iterator<Item = u64> + Clone) -> u64 {
    let common = patterns.clone().try_fold(1, |common: u64, pattern| {
        let together = common.checked_mul(pattern / greatest_divisor(common, pattern))?;
        (together <= LONGEST_PATTERN_NS).then_some(together)
    });
    common.or_else(|| patterns.max()).unwrap_or(1)
}

fn greatest_divisor(a: u64, b: u64) -> u64 {
    let (mut a, mut b) = (a, b);
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a.max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    fn wanted(number: u32, epoch: u64, shift: u64) -> Option<Wanted> {
        Some(Wanted { epoch, shift, number })
    }

    #[test]
    fn a_far_time_counts_after_16_readings_that_agree() {
        let mut times = Times::default();
        for number in 1..=15 {
            assert_eq!(times.compare(5, wanted(number, 900 * MS, 0), None, None), None);
        }
        assert!(times.is_pending());
        // Once near: all over again. A time that was not given again does not count.
        assert_eq!(times.compare(900 * MS, wanted(16, 900 * MS, 0), None, None), None);
        assert!(!times.is_pending());
        let steps: Vec<Step> = (17..=32)
            .flat_map(|number| [number; 3])
            .filter_map(|number| times.compare(5, wanted(number, 900 * MS, 0), None, None))
            .collect();
        assert_eq!(steps, [Step::Jump(900 * MS - 5)]);
    }

    #[test]
    fn a_host_that_stalls_now_and_then_gives_no_far_time() {
        let mut times = Times::default();
        for number in 1..1_000 {
            let late = if number % 7 == 0 { 0 } else { u64::from(number) * 7_919 % 1_000_000 };
            let step = times.compare(40 * MS + late, wanted(number, 40 * MS, 0), None, None);
            assert_eq!(step, None, "{number}");
        }
    }

    #[test]
    fn with_sync_signals_the_shift_is_a_multiple_of_their_pattern_and_rests_go_back() {
        let step = |jump: i64| {
            let mut times = Times::default();
            let application = (40 * MS).wrapping_add_signed(jump);
            (1..=16).find_map(|number| times.compare(40 * MS, wanted(number, application, 0), None, Some(MS)))
        };
        let shift = |ms: i64, left| Some(Step::Shift { shift: (ms * MS as i64) as u64, left });
        assert_eq!(step(7_300_000), shift(8, 700_000));
        assert_eq!(step(-7_300_000), shift(-7, 300_000));
        assert_eq!(step(600_000), shift(1, 400_000));
        assert_eq!(step(-600_000), shift(0, 600_000));
        // The accuracy of readings is no reason to go back by a whole pattern.
        assert_eq!((step(5_009_000), step(4_991_000)), (shift(5, -9_000), shift(5, 9_000)));
        // While half a jump is made up, another one comes: the shift counts from the application's time.
        let mut times = Times::default();
        let (application, in_effect) = (40 * MS + 9_400_000, 9_200_000);
        let step =
            (1..=16).find_map(|number| times.compare(38 * MS, wanted(number, application, in_effect), None, Some(MS)));
        assert_eq!(step, shift(12, 600_000));
    }

    #[test]
    fn the_rest_goes_back_by_400_ns_per_millisecond_and_800_ns_at_most() {
        let mut times = Times::default();
        times.turn(0, (3 * MS, 1_700), 0);
        times.take_shift_in_effect(wanted(0, 0, 0));
        assert_eq!(times.step_ns(1_000_000), 0, "the exchange has not said anything yet");
        times.take_shift_in_effect(wanted(1, 0, 3 * MS - 1_500));
        assert_eq!((times.step_ns(1_000_000), times.step_ns(50_000_000), times.left_ns()), (400, 800, 1_500));
        times.slide(800);
        assert_eq!((times.step_ns(50_000_000), times.slid()), (700, 800));
        times.slide(700);
        assert_eq!((times.step_ns(50_000_000), times.left_ns()), (0, 0));
        // A rest forward has no steps.
        assert_eq!(times.turn(0, (MS, -9_000), 0).slid, 1_500);
        assert_eq!(times.left_ns(), 0);
    }

    #[test]
    fn a_first_time_is_followed_once_and_not_while_signals_run() {
        let mut times = Times::default();
        let first = |times: &mut Times, pattern| (0..16).find_map(|_| times.compare(0, None, Some(9 * MS), pattern));
        assert_eq!(first(&mut times, Some(MS)), None);
        assert_eq!(first(&mut times, None), Some(Step::Jump(9 * MS)));
        assert_eq!(first(&mut times, None), None);
        assert_eq!(Times::default().begin(Some(3)), Some(3));
    }

    // covers: dc-reference
    #[test]
    fn patterns_repeat_together_after_their_least_common_multiple_up_to_20_ms() {
        let common = |patterns: &[u64]| common_pattern(patterns.iter().copied());
        assert_eq!((common(&[]), common(&[MS]), common(&[2 * MS, 3 * MS])), (1, MS, 6 * MS));
        assert_eq!(common(&[MS, 333_333]), MS, "333 s are too long");
    }
}
