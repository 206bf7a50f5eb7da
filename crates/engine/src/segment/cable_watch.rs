//! Decides which errors of a cable are reported. A cut damages the frame that is on the wire: only many errors at once,
//! or errors at consecutive readings, are reported.

use core::time::Duration;

use crate::ring_status::CableErrors;
use crate::time::Instant;

/// Damaged frames between two readings that are reported at once; fewer if there were some at the previous reading too.
const MANY: u64 = 3;
/// Minimum time between two reports of the same cable.
const AGAIN: Duration = Duration::from_secs(10);

/// Recent errors of a cable.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct CableWatch {
    /// Errors since the last report of the cable.
    unreported: CableErrors,
    /// There were damaged frames at the previous reading too.
    continues: bool,
    reported_at: Option<Instant>,
}

impl CableWatch {
    /// Takes the errors since the last reading. Returns those that are to be reported: all since the last report.
    pub fn take(&mut self, fresh: CableErrors, now: Instant) -> Option<CableErrors> {
        self.unreported = self.unreported.plus(fresh);
        let came = fresh.invalid_frames;
        let is_worth_it = came >= MANY || (came > 0 && self.continues);
        self.continues = came > 0;
        if !is_worth_it || self.reported_at.is_some_and(|at| now.since(at) < AGAIN) {
            return None;
        }
        self.reported_at = Some(now);
        Some(core::mem::take(&mut self.unreported))
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;

    use super::*;

    fn errors(invalid_frames: u64) -> CableErrors {
        CableErrors { invalid_frames, lost_links: 0 }
    }

    // covers: cable-errors
    #[test]
    fn one_damaged_frame_is_not_reported_but_many_or_repeated_ones_are() {
        let mut watch = CableWatch::default();
        let at = |second: u64| Instant(0) + Duration::from_secs(second);
        // The counter shows 0, 1, 1, 2, 3, 3, 9, 250, and after it was cleared 2 and 2.
        let rises = [0, 1, 0, 1, 1, 0, 6, 241, 2, 0];
        let reported: Vec<_> = (0..).zip(rises).map(|(second, rise)| watch.take(errors(rise), at(second))).collect();
        let expected: Vec<_> = (0..rises.len()).map(|second| (second == 4).then_some(errors(3))).collect();
        assert_eq!(reported, expected);
        // 6 and 241 that were counted within ten seconds after the first report, 2 after the counters were cleared, and
        // these.
        assert_eq!(watch.take(errors(100), at(14)), Some(errors(349)));
    }
}
