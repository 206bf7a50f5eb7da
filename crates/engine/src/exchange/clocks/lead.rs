//! Control loop with which a reference follows another time: in an open ring the second reference follows the first
//! (protocol 7.5), with bus shift the segment's reference follows the host (protocol 7.4).
//!
//! Input: the difference of both times when one frame, or frames that left together, pass them. Output: the time to
//! write to the follower. Every write contains the sending jitter of the host, and so does each difference. A clock
//! that is far away, because it has never followed the other, is brought near as fast as its own loop can. Once it is
//! near:
//!
//! * a second reference, which has followed the same clock as the first one and so differs by nanoseconds for seconds,
//!   is not steered until its mean has drifted away, and then by a mean, in every cycle;
//! * a reference that follows the host is steered in every cycle, by a small part of a long mean. The written value is
//!   that much less than its last reading: the jitter of one cycle is taken back in the next.

use super::gap::{Finding, Found};
use crate::time::Instant;

/// Required accuracy of means in spite of random sending delays of the host.
const EXACT_NS: i64 = 300;
/// Depth of the longest mean: the drift of free-running clocks within it must not exceed the jitter.
const MOST_DEPTH: u32 = 10;
/// Depth of the mean of the jitter.
const NOISE_DEPTH: u32 = 9;
/// Upper limit of the jitter that counts: a stall of the host is no jitter.
const MOST_NOISE_NS: i64 = 100_000;
/// With much jitter, the filter constants of difference and change per cycle, as shifts.
const CALM_DEPTH: u32 = 8;
const CALM_CHANGE_DEPTH: u32 = 2 * CALM_DEPTH + 1;
/// Part of the difference that is written to the clock, as a shift, and the number of cycles of its change: a loop in
/// the controller takes out a 64th of the written difference, and adds it to its speed.
const CALM_SHARE: u32 = 5;
const CALM_AHEAD: i64 = 32;
/// Factor on the usual limit beyond which such a clock counts as far away.
const CALM_FAR: i64 = 4;
/// Fractional bits of the change per cycle.
const CHANGE_FRACTION: u32 = 24;
/// Fractional bits of nanoseconds.
const FRACTION: u32 = 8;
/// Filter gains of the difference and of its change for the unexpected part, as shifts.
const DIFFERENCE_DEPTH: u32 = 3;
const CHANGE_DEPTH: u32 = 8;
/// Upper limit of the unexpected part.
const UNEXPECTED_NS: i64 = 20_000;
/// Upper limit of a difference: frames may contain any value.
const ABSURD_NS: i64 = 1 << 40;
/// Upper limit of the time between two differences.
const LONGEST_NS: u64 = 10_000_000;
/// From this difference on a clock that was left alone is steered.
const FREE_NS: i64 = 1_000;
/// It is left alone again after this number of cycles within this difference.
const CALM_NS: i64 = 500;
const CALM_CYCLES: u32 = 1_000;
/// A difference older than this is not used.
const FRESH_NS: u64 = 100_000_000;
/// Largest difference written at a time.
const MOST_NS: i64 = 50_000;
/// Far away, a change of the difference counts like the difference that it would lead to within this time: otherwise
/// the loop in the controller oscillates for seconds at the rate of the cycles.
const FORESIGHT_NS: i64 = 150_000_000;
/// Clocks never differ by more than their loops can take out.
const MOST_PPB: i64 = 800_000;

/// Which clock follows which.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Law {
    /// Filter depth of the difference that decides what to do.
    slow_depth: u32,
    /// With this, a difference is limited to this distance from the mean: a stall of the host carries no information
    /// about clocks.
    outlier_ns: i64,
    /// From this difference on the clock is far away.
    far_ns: i64,
    /// Until it has been nearer than this for [`CALM_CYCLES`].
    settled_ns: i64,
    /// Near, this part of the long mean is written, as a shift; `None`: all of a short mean, and the clock may be left
    /// alone.
    share: Option<u32>,
}

/// A second reference and the first one.
const SECOND: Law = Law { slow_depth: 6, outlier_ns: 3_000, far_ns: 5_000, settled_ns: FREE_NS, share: None };
/// A reference and the host, which sends with a jitter of tens of microseconds.
const HOST: Law = Law { slow_depth: 7, outlier_ns: 50_000, far_ns: 10_000, settled_ns: 5_000, share: Some(4) };

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    Free,
    Near,
    Far,
}

/// Difference between a steered reference and that of the segment, when frames that left together pass them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lead {
    law: Law,
    /// The difference while both show the same time, because their ways from the host have different lengths.
    gap: i64,
    /// While the gap is not known.
    finding: Option<Finding>,
    /// Mean deviation of the differences from their mean, with as many fractional bits as [`NOISE_DEPTH`].
    noise: i64,
    /// Filter depth of the difference that decides what to do.
    depth: u32,
    /// Nanoseconds by which it is ahead, with fraction, and the rate of change.
    ahead: i64,
    change_ppb: i64,
    /// With much jitter: nanoseconds by which it is ahead, and their change per cycle, with [`CHANGE_FRACTION`].
    calm_ahead: i64,
    calm_change: i64,
    /// A longer mean, with as many fractional bits as its depth.
    slow: i64,
    seen_at: Instant,
    mode: Mode,
    /// Consecutive cycles in which it was near.
    calm: u32,
}

impl Lead {
    /// A second reference and the first one, which show the same time: because they have followed one clock until now
    /// (`together`), or as an assumption.
    pub const fn begin(difference: i64, together: bool, seen_at: Instant) -> Lead {
        let (gap, finding, noise) = (difference, Some(Finding::begin(together)), 0);
        let (law, depth, mode) = (SECOND, SECOND.slow_depth, Mode::Free);
        Lead {
            law,
            gap,
            finding,
            noise,
            depth,
            ahead: 0,
            change_ppb: 0,
            calm_ahead: 0,
            calm_change: 0,
            slow: 0,
            seen_at,
            mode,
            calm: 0,
        }
    }

    /// A reference that is to show the host's time, which it has never followed.
    pub const fn behind_host(seen_at: Instant) -> Lead {
        let (law, depth, mode) = (HOST, HOST.slow_depth, Mode::Far);
        Lead { law, depth, finding: None, mode, ..Lead::begin(0, false, seen_at) }
    }

    /// A reference that has followed another host until now and goes on without a step: the difference to this host's
    /// time is found first.
    pub const fn adopted(seen_at: Instant) -> Lead {
        Lead { finding: Some(Finding::begin(true)), mode: Mode::Near, ..Lead::behind_host(seen_at) }
    }

    /// The difference while both show the same time; `None` while it is being found.
    pub const fn found_gap(&self) -> Option<i64> {
        if self.finding.is_none() { Some(self.gap) } else { None }
    }

    /// The same beginning with a known difference while both show the same time.
    #[must_use]
    pub const fn with_gap(self, gap: i64) -> Lead {
        Lead { gap, finding: None, ..self }
    }

    /// Whether the last difference is recent enough.
    pub const fn is_fresh(&self, now: Instant) -> bool {
        now.0.saturating_sub(self.seen_at.0) <= FRESH_NS
    }

    /// Takes another difference.
    pub fn go_on(self, difference: i64, seen_at: Instant) -> Lead {
        if let Some(finding) = self.finding {
            return self.find_gap(finding.take(difference.clamp(-ABSURD_NS, ABSURD_NS)), seen_at);
        }
        let passed = seen_at.0.saturating_sub(self.seen_at.0).clamp(1, LONGEST_NS) as i64;
        let expected = self.ahead + ((self.change_ppb * passed) << FRACTION) / 1_000_000_000;
        let limit = UNEXPECTED_NS << FRACTION;
        let seen = difference.saturating_sub(self.gap).clamp(-ABSURD_NS, ABSURD_NS);
        let unexpected = ((seen << FRACTION) - expected).clamp(-limit, limit);
        let ahead = expected + (unexpected >> DIFFERENCE_DEPTH);
        let change = (unexpected * 1_000_000_000 / passed) >> (CHANGE_DEPTH + FRACTION);
        let change_ppb = (self.change_ppb + change).clamp(-MOST_PPB, MOST_PPB);
        let Law { outlier_ns, far_ns, settled_ns, share, .. } = self.law;
        let mean = self.slow >> self.depth;
        let limited = seen.clamp(mean - self.outlier(outlier_ns), mean + self.outlier(outlier_ns));
        let Lead { noise, depth, slow, .. } = self.widen(seen - mean);
        let slow = slow + limited - (slow >> depth);
        let is_noisy = depth > self.law.slow_depth;
        let expected = self.calm_ahead + self.calm_change;
        let calm_seen = ((seen.clamp(-MOST_NOISE_NS, MOST_NOISE_NS) << CHANGE_FRACTION) - expected) >> CALM_DEPTH;
        let calm_ahead = expected + calm_seen;
        let calm_change = self.calm_change + (calm_seen >> (CALM_CHANGE_DEPTH - CALM_DEPTH));
        let far_ns = if is_noisy { CALM_FAR * far_ns } else { far_ns };
        let far = (slow >> depth).abs();
        let enough = if self.mode == Mode::Far { settled_ns } else { CALM_NS };
        let calm = if far < enough { self.calm.saturating_add(1) } else { 0 };
        let (mode, calm) = match self.mode {
            _ if far > far_ns => (Mode::Far, 0),
            Mode::Far if calm >= CALM_CYCLES => (Mode::Near, 0),
            // Free-running clocks drift apart by more than can be detected in time.
            Mode::Free if is_noisy => (Mode::Near, 0),
            Mode::Near if share.is_none() && !is_noisy && calm >= CALM_CYCLES => (Mode::Free, 0),
            Mode::Free if far > FREE_NS => (Mode::Near, 0),
            mode => (mode, calm),
        };
        Lead { ahead, change_ppb, slow, seen_at, mode, calm, noise, depth, calm_ahead, calm_change, ..self }
    }

    /// Takes the gap once it is known.
    fn find_gap(self, finding: Finding, seen_at: Instant) -> Lead {
        let Some(Found { gap, noise_ns }) = finding.found() else {
            return Lead { finding: Some(finding), seen_at, ..self };
        };
        Lead { gap, finding: None, noise: noise_ns << NOISE_DEPTH, seen_at, ..self }.widen(noise_ns)
    }

    /// Takes the size of the jitter: the more there is, the longer means have to be. They never get shorter.
    fn widen(self, jitter: i64) -> Lead {
        if self.law.share.is_some() || self.mode == Mode::Far {
            return self;
        }
        let noise = self.noise - (self.noise >> NOISE_DEPTH) + jitter.saturating_abs().min(MOST_NOISE_NS);
        let ratio = ((noise >> NOISE_DEPTH) / EXACT_NS).unsigned_abs();
        // A mean of depth d has a 2^(d + 1)th of the variance of the jitter.
        let wanted = (2 * ratio.max(1).ilog2()).min(MOST_DEPTH);
        let depth = self.depth.max(wanted);
        Lead { noise, depth, slow: self.slow << (depth - self.depth), ..self }
    }

    /// Limits a difference to a distance from the mean; jitter itself is no outlier.
    fn outlier(&self, least: i64) -> i64 {
        least.max(4 * (self.noise >> NOISE_DEPTH))
    }

    /// Difference to write, as nanoseconds ahead; `None`: nothing is written.
    pub fn steering_ns(&self) -> Option<i64> {
        let ahead = self.ahead >> FRACTION;
        let correction = match (self.mode, self.law.share) {
            (Mode::Free, _) => return None,
            (Mode::Near, Some(share)) => self.slow / (1 << (self.depth + share)),
            (Mode::Near, None) if self.depth > self.law.slow_depth => {
                (self.calm_ahead / (1 << CALM_SHARE) + self.calm_change * CALM_AHEAD) >> CHANGE_FRACTION
            }
            (Mode::Near, None) => ahead,
            (Mode::Far, _) => ahead + self.change_ppb * (FORESIGHT_NS / 1_000) / 1_000_000,
        };
        Some(correction.clamp(-MOST_NS, MOST_NS))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CYCLE_NS: u64 = 1_000_000;

    fn after(lead: Lead, differences: impl IntoIterator<Item = i64>) -> Lead {
        differences.into_iter().fold(lead, |lead, difference| {
            let seen_at = Instant(lead.seen_at.0 + CYCLE_NS);
            lead.go_on(difference, seen_at)
        })
    }

    /// Jitter up to 5 us, around a difference at which both show the same time.
    fn jitter(count: i64) -> impl Iterator<Item = i64> {
        (0..count).map(|number| 7_000 + (number * 7_919) % 5_001)
    }

    // covers: 7.5
    #[test]
    fn jitter_of_the_host_is_no_reason_to_steer() {
        let lead = after(Lead::begin(7_100, true, Instant(0)), jitter(5_000));
        assert_eq!((lead.mode, lead.steering_ns()), (Mode::Free, None));
        assert!((lead.gap - 9_500).abs() < 300, "{lead:?}");
    }

    #[test]
    fn a_stall_between_both_copies_is_no_reason_to_steer() {
        let stalls = jitter(5_000).enumerate();
        let stalled = stalls.map(|(number, late)| if number % 50 == 49 { late + 1_000_000 } else { late });
        let lead = after(Lead::begin(9_500, true, Instant(0)), stalled);
        assert_eq!((lead.mode, lead.steering_ns()), (Mode::Free, None));
    }

    #[test]
    fn a_clock_that_drifts_is_steered_by_a_mean_until_it_is_back() {
        let strayed = after(Lead::begin(0, true, Instant(0)), [0; 20].into_iter().chain([1_500; 200]));
        assert_eq!(strayed.mode, Mode::Near);
        let written = strayed.steering_ns().expect("it strayed");
        assert!((1_400..=1_500).contains(&written), "{written}");
        let back = after(strayed, [0; 1_500]);
        assert_eq!(back.steering_ns(), None);
    }

    // covers: 7.4
    #[test]
    fn a_clock_that_follows_the_host_is_steered_by_a_small_part_of_a_long_mean() {
        // Up to 50 us of jitter around a difference of 4 us.
        let late = |count: i64| (0..count).map(|number| 4_000 + (number * 7_919) % 50_001 - 25_000);
        let lead = after(Lead::behind_host(Instant(0)), late(5_000));
        assert_eq!(lead.mode, Mode::Near);
        let written = lead.steering_ns().expect("it is steered in every cycle");
        assert!((150..=350).contains(&written), "{written}");
        let stray = after(lead, [40_000; 200]);
        assert_eq!(stray.mode, Mode::Far);
        assert!(stray.steering_ns().is_some_and(|written| written > 30_000), "{stray:?}");
        assert!(stray.is_fresh(Instant(stray.seen_at.0 + FRESH_NS)));
        assert!(!stray.is_fresh(Instant(stray.seen_at.0 + FRESH_NS + 1)));
    }

    #[test]
    fn a_clock_that_is_far_away_is_steered_by_its_predicted_difference() {
        // 100 ppm fast, observed from the beginning.
        let lead = after(Lead::begin(0, true, Instant(0)), (1..400).map(|cycle| cycle * 100));
        assert_eq!(lead.mode, Mode::Far);
        let written = lead.steering_ns().expect("it is far away");
        assert!(written > 39_000, "{written}");
    }
}
