//! Limits the reports of a changing state: each change is reported at once, as long as changes are rare.
//!
//! A change closely after another one is reported when the state has been stable for a moment. If a cable changes too
//! often for a long time, it is reported only after a stable second: a loose plug bounces for hours.

use core::time::Duration;

use crate::time::Instant;

/// A change this long after the previous one is reported at once.
const QUIET: Duration = Duration::from_millis(20);
/// An earlier change is reported after it was stable for this time.
const HOLD: Duration = Duration::from_millis(3);
/// A state that changes too often is reported after it was stable for this time.
const STEADY: Duration = Duration::from_secs(1);
/// Changes that may be reported in a row.
const BUDGET: u32 = 32;
/// One more may be reported each time this has passed: four a second on average.
const REFILL: Duration = Duration::from_millis(250);

/// Decides when a change is reported.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Damper {
    changed_at: Option<Instant>,
    is_prompt: bool,
    budget: u32,
    refilled_at: Instant,
    is_unsteady: bool,
}

impl Default for Damper {
    fn default() -> Damper {
        Damper {
            changed_at: None,
            is_prompt: true,
            budget: BUDGET,
            refilled_at: Instant::default(),
            is_unsteady: false,
        }
    }
}

impl Damper {
    /// The state changed since the last evaluation. At the moment of a cut frames of one cycle may show both states:
    /// that is one change.
    pub(crate) fn changed(&mut self, now: Instant) {
        self.is_prompt = self.changed_at.is_none_or(|at| now.since(at) >= QUIET);
        self.changed_at = Some(now);
    }

    /// Whether the present state may be reported.
    pub(crate) fn may_report(&mut self, now: Instant) -> bool {
        let held = self.changed_at.map_or(Duration::MAX, |at| now.since(at));
        if self.is_unsteady {
            return held >= STEADY;
        }
        self.is_prompt || held >= HOLD
    }

    /// When a state that may not be reported yet may be, if it does not change again.
    pub(crate) fn due(&self) -> Instant {
        let pause = if self.is_unsteady { STEADY } else { HOLD };
        self.changed_at.map_or(Instant::default(), |at| at + pause)
    }

    /// Counts a report. True if from now on the state changes too often to be reported each time.
    pub(crate) fn count_report(&mut self, now: Instant) -> bool {
        let refills = now.since(self.refilled_at).as_nanos() / REFILL.as_nanos();
        if refills > 0 {
            self.budget = BUDGET.min(self.budget.saturating_add(u32::try_from(refills).unwrap_or(BUDGET)));
            self.refilled_at = now;
        }
        self.budget = self.budget.saturating_sub(1);
        let was = core::mem::replace(&mut self.is_unsteady, self.budget == 0);
        self.is_unsteady && !was
    }

    /// When it no longer changes too often, if it does not change again; `None` if it does not change too often now.
    pub(crate) fn steady_at(&self, now: Instant) -> Option<Instant> {
        self.changed_at.filter(|_| self.is_unsteady(now)).map(|at| at + STEADY)
    }

    /// Whether it changes too often to be reported each time.
    pub(crate) fn is_unsteady(&self, now: Instant) -> bool {
        self.is_unsteady && self.changed_at.is_some_and(|at| now.since(at) < STEADY)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Evaluates every 500 us a state that flips every `half_period`; returns how often it was reported, and how often
    /// as unsteady.
    fn flap(half_period: Duration, lasts: Duration) -> (u32, u32) {
        let (mut damper, mut reported_state, mut reported, mut unsteady, mut flips) = (Damper::default(), 0, 0, 0, 0);
        let mut now = Instant(0);
        while now < Instant(0) + lasts {
            now += Duration::from_micros(500);
            let due = u32::try_from(now.0 / half_period.as_nanos() as u64).unwrap();
            if due != flips {
                damper.changed(now);
                flips = due;
            }
            if reported_state != flips % 2 && damper.may_report(now) {
                reported_state = flips % 2;
                reported += 1;
                unsteady += u32::from(damper.count_report(now));
            }
        }
        (reported, unsteady)
    }

    #[test]
    fn rare_changes_are_each_reported_at_once() {
        assert_eq!(flap(Duration::from_millis(300), Duration::from_secs(60)), (200, 0));
        let mut damper = Damper::default();
        damper.changed(Instant(5));
        assert!(damper.may_report(Instant(5)));
    }

    // covers: ring-flap
    #[test]
    fn flapping_at_any_rate_is_reported_a_bounded_number_of_times() {
        let lasts = Duration::from_secs(60);
        for micros in [1, 10, 100, 700, 3_000, 15_000, 25_000, 60_000, 150_000, 240_000, 1_000_000] {
            let (reported, unsteady) = flap(Duration::from_micros(micros), lasts);
            let most = BUDGET + (lasts.as_nanos() / REFILL.as_nanos()) as u32;
            assert!(reported <= most, "{reported} of {most} with a half period of {micros} us");
            assert!(unsteady <= 1, "{unsteady}");
        }
        assert_eq!(flap(Duration::from_micros(10), lasts).0, 0, "the state was restored before an evaluation");
        assert_eq!(flap(Duration::from_millis(25), lasts), (BUDGET + 3, 1), "then no report until it is steady");
    }

    #[test]
    fn an_unsteady_state_is_reported_after_a_stable_second() {
        let mut damper = Damper::default();
        let mut now = Instant(0);
        let mut became = 0;
        for _ in 0..1000 {
            now += Duration::from_millis(30);
            damper.changed(now);
            if damper.may_report(now) {
                became += u32::from(damper.count_report(now));
            }
        }
        assert_eq!(became, 1);
        assert!(damper.is_unsteady(now) && !damper.may_report(now + Duration::from_millis(999)));
        now += STEADY;
        assert!(!damper.is_unsteady(now) && damper.may_report(now));
        assert!(!damper.count_report(now), "some are reported again");
        damper.changed(now + STEADY);
        assert!(damper.may_report(now + STEADY));
    }
}
