//! An INACTIVE raises an alarm if no ACTIVE sends process data: outputs then no longer change, or their watchdogs have
//! expired.

use std::time::Duration;

use ringcat_engine::event::CyclicStandbyEvent;
use ringcat_engine::time::Instant;

/// Whether the alarm is raised.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Alarm {
    #[default]
    Quiet,
    Raised,
}

/// Watches for an ACTIVE.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ActiveMonitor {
    /// Time of the last process data of an ACTIVE, or of the beginning of this watch.
    there_at: Instant,
    alarm: Alarm,
}

impl ActiveMonitor {
    pub fn new(now: Instant) -> ActiveMonitor {
        ActiveMonitor { there_at: now, alarm: Alarm::Quiet }
    }

    /// This MainDevice is ACTIVE itself.
    pub fn is_active(&mut self, now: Instant) {
        *self = ActiveMonitor::new(now);
    }

    /// This MainDevice is INACTIVE. `seen_at`: time of the last process data of the ACTIVE, if there was any.
    pub fn note(&mut self, seen_at: Option<Instant>, limit: Duration, now: Instant) -> Option<CyclicStandbyEvent> {
        self.there_at = self.there_at.max(seen_at.unwrap_or_default());
        let silence = now.since(self.there_at);
        let (alarm, notice) = match self.alarm {
            Alarm::Quiet if silence >= limit => (Alarm::Raised, CyclicStandbyEvent::NoActive(silence)),
            Alarm::Raised if silence < limit => (Alarm::Quiet, CyclicStandbyEvent::ActiveIsBack),
            Alarm::Quiet | Alarm::Raised => return None,
        };
        self.alarm = alarm;
        Some(notice)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMIT: Duration = Duration::from_millis(15);

    fn at(ms: u64) -> Instant {
        Instant(ms * 1_000_000)
    }

    // covers: REQ032, 9.11, standby
    #[test]
    fn a_missing_active_and_its_return_are_each_reported_once() {
        let mut monitor = ActiveMonitor::new(at(100));
        assert_eq!(monitor.note(None, LIMIT, at(114)), None);
        assert_eq!(monitor.note(None, LIMIT, at(115)), Some(CyclicStandbyEvent::NoActive(LIMIT)), "it never came");
        assert_eq!(monitor.note(None, LIMIT, at(500)), None);
        assert_eq!(monitor.note(Some(at(501)), LIMIT, at(502)), Some(CyclicStandbyEvent::ActiveIsBack));
        assert_eq!(monitor.note(Some(at(510)), LIMIT, at(524)), None);
        // When the links are lost the time of the last frame is unknown.
        assert_eq!(monitor.note(None, LIMIT, at(526)), Some(CyclicStandbyEvent::NoActive(Duration::from_millis(16))));
        monitor.is_active(at(600));
        assert_eq!(monitor.note(None, LIMIT, at(610)), None, "its own time as ACTIVE counts");
        assert_eq!(monitor.note(None, LIMIT, at(615)), Some(CyclicStandbyEvent::NoActive(LIMIT)));
    }
}
