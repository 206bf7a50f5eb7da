//! Whether a failure of one of both MainDevices would cost no more than the time-out of a takeover, from cycle to cycle
//! (protocol 9.9, REQ010, REQ012).

use ringcat_wire::master_frame::NotReady;

use super::state::State;
use crate::board::Board;
use crate::event::CyclicStandbyEvent;
use crate::link::Link;
use crate::queue::Producer;
use crate::role::Partner;

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

impl State {
    /// Posts the reasons of this cycle, and reports them when they have changed.
    pub(super) fn post_readiness(&mut self, reasons: NotReady, events: &mut Producer) {
        self.control.post_readiness(reasons);
        if let Some(reasons) = self.readiness.note(reasons) {
            events.push(CyclicStandbyEvent::Readiness(reasons).pack());
        }
    }

    /// The reasons that the ACTIVE knows: its own, and those of the other MainDevice.
    pub(super) fn reasons_of_active(&self, board: &Board) -> NotReady {
        let is_down = |link: &Link| board.live.carrier(*link) == Some(false);
        // A MainDevice that is to stay INACTIVE may be ACTIVE on request: its own role is no reason.
        let own = NotReady(self.control.not_ready()).with(NotReady::HELD, false);
        let own = own.with(NotReady::LINK, Link::ALL.iter().any(is_down) || own.has(NotReady::LINK));
        let own = own.with(NotReady::VERSION, self.other_version.is_some());
        let of_other = match self.watch.partner() {
            Partner::Absent => NotReady::ABSENT,
            Partner::Forwards => NotReady::NO_ANSWER,
            Partner::Alive { not_ready, .. } => not_ready,
        };
        NotReady(own.0 | of_other.0)
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
