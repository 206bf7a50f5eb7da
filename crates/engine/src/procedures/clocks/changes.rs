//! Waits for a change of the segment, while its clocks could not be set up.

use core::time::Duration;

use crate::procedures::shared_segment::SharedSegment;
use crate::segment::Changes;
use crate::supervisor::Bus;

/// Time from the last change of the segment to its measurement: contacts of a plug bounce.
pub(super) const SETTLE: Duration = Duration::from_millis(5);

/// Kind of change.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Change {
    None,
    /// The first SubDevices answer: so it is when cycles begin, which is not a change.
    FirstAnswer,
    Segment,
}

impl Change {
    fn between(before: Changes, now: Changes) -> Change {
        match () {
            () if now.segment != before.segment => Change::Segment,
            () if now.beginnings != before.beginnings => Change::FirstAnswer,
            () => Change::None,
        }
    }
}

/// Waits until the segment has changed and is stable again, at most for a time.
pub(super) async fn wait_for_change(bus: &Bus, segment: &SharedSegment, limit: Duration) -> Change {
    let changes = || segment.view().changes();
    let (first, last) = (changes(), bus.now() + limit);
    let (mut until, mut seen) = (last, first);
    loop {
        let posted = bus.posted();
        segment.observe_words();
        if changes() != seen {
            (seen, until) = (changes(), last.min(bus.now() + SETTLE));
        }
        if bus.now() >= until {
            return Change::between(first, seen);
        }
        segment.until_posted(posted, until, || changes() != seen).await;
    }
}
