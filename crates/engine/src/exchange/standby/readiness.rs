//! Whether a failure of one of both MainDevices would cost no more than the time-out of a takeover, from cycle to cycle
//! (protocol 9.9, REQ010, REQ012).

use ringcat_wire::master_frame::NotReady;

/// Cycles with the same reasons before they are reported: a lost frame and a change of the role are over by then.
const SAME_FOR: u8 = 4;

/// Reports changes of the reasons that last.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::exchange) struct ReadinessWatch {
    reported: Option<NotReady>,
    last: NotReady,
    /// Cycles in a row with them.
    same: u8,
}

impl ReadinessWatch {
    /// A cycle has these reasons. Returns them if they are to be reported.
    pub fn note(&mut self, reasons: NotReady) -> Option<NotReady> {
        self.same = if reasons == self.last { self.same.saturating_add(1) } else { 1 };
        self.last = reasons;
        let is_new = self.same >= SAME_FOR && self.reported != Some(reasons);
        is_new.then(|| {
            self.reported = Some(reasons);
            reasons
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: FR-11, standby
    #[test]
    fn reasons_are_reported_when_they_have_lasted_and_changed() {
        let mut watch = ReadinessWatch::default();
        let mut note = |reasons: NotReady, cycles: usize| (0..cycles).filter_map(|_| watch.note(reasons)).count();
        assert_eq!(note(NotReady::NOTHING, 3), 0);
        assert_eq!(note(NotReady::NOTHING, 9), 1, "also that there is none");
        assert_eq!(note(NotReady::LINK, 3), 0, "for a moment");
        assert_eq!(note(NotReady::NOTHING, 9), 0, "nothing has changed");
        assert_eq!(note(NotReady::LINK, 9), 1);
        assert_eq!(note(NotReady::GUARD, 4), 1);
    }
}
