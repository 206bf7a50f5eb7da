//! An INACTIVE that waits for an ACTIVE raises an alarm when none is there: outputs then stand still, or their
//! watchdogs have expired.

use std::time::Duration;

use ringcat_engine::event::{CyclicStandbyEvent, StandbyEvent};
use ringcat_engine::time::Instant;

/// What is to be reported.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Notice {
    /// There is no ACTIVE, and this MainDevice does not take over: the time since the last one.
    NoActive(Duration),
    /// There is an ACTIVE again.
    ActiveIsBack,
}

impl From<Notice> for CyclicStandbyEvent {
    fn from(notice: Notice) -> CyclicStandbyEvent {
        match notice {
            Notice::NoActive(silence) => CyclicStandbyEvent::NoActive(silence),
            Notice::ActiveIsBack => CyclicStandbyEvent::ActiveIsBack,
        }
    }
}

impl From<Notice> for StandbyEvent {
    fn from(notice: Notice) -> StandbyEvent {
        match notice {
            Notice::NoActive(silence) => StandbyEvent::NoActive { silence },
            Notice::ActiveIsBack => StandbyEvent::ActiveIsBack,
        }
    }
}

/// Whether the alarm is raised.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Alarm {
    #[default]
    Quiet,
    Raised,
}

/// Watches for an ACTIVE.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lookout {
    /// When an ACTIVE was there last, or when this began.
    there_at: Instant,
    alarm: Alarm,
}

impl Lookout {
    pub fn new(now: Instant) -> Lookout {
        Lookout { there_at: now, alarm: Alarm::Quiet }
    }

    /// This MainDevice is ACTIVE itself.
    pub fn is_active(&mut self, now: Instant) {
        *self = Lookout::new(now);
    }

    /// This MainDevice is INACTIVE. `seen_at`: when the ACTIVE was there last, if it was.
    pub fn note(&mut self, seen_at: Option<Instant>, limit: Duration, now: Instant) -> Option<Notice> {
        self.there_at = self.there_at.max(seen_at.unwrap_or_default());
        let silence = now.since(self.there_at);
        let (alarm, notice) = match self.alarm {
            Alarm::Quiet if silence >= limit => (Alarm::Raised, Notice::NoActive(silence)),
            Alarm::Raised if silence < limit => (Alarm::Quiet, Notice::ActiveIsBack),
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
    fn each_silence_is_reported_once_and_its_end_too() {
        let mut lookout = Lookout::new(at(100));
        assert_eq!(lookout.note(None, LIMIT, at(114)), None);
        assert_eq!(lookout.note(None, LIMIT, at(115)), Some(Notice::NoActive(LIMIT)), "it never came");
        assert_eq!(lookout.note(None, LIMIT, at(500)), None);
        assert_eq!(lookout.note(Some(at(501)), LIMIT, at(502)), Some(Notice::ActiveIsBack));
        assert_eq!(lookout.note(Some(at(510)), LIMIT, at(524)), None);
        // When the links are lost the time of the last frame is unknown.
        assert_eq!(lookout.note(None, LIMIT, at(526)), Some(Notice::NoActive(Duration::from_millis(16))));
        lookout.is_active(at(600));
        assert_eq!(lookout.note(None, LIMIT, at(610)), None, "its own time as ACTIVE counts");
        assert_eq!(lookout.note(None, LIMIT, at(615)), Some(Notice::NoActive(LIMIT)));
    }
}
