//! Waits for a change of the segment, while its clocks could not be set up.

use core::time::Duration;

use crate::procedures::shared_segment::SharedSegment;
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

/// Waits until the segment has changed and is stable again, at most for a time.
pub(super) async fn wait_for_change(bus: &Bus, segment: &SharedSegment, limit: Duration) -> Change {
    let state = || (segment.board.ring().changes, segment.board.clocks.holds(), answering(segment));
    let (mut until, mut seen) = (bus.now() + limit, state());
    let last = until;
    let mut change = Change::None;
    loop {
        let posted = bus.posted();
        let now = state();
        if now != seen {
            let is_first = seen.2 == (0, 0) && change != Change::Segment;
            change = if is_first { Change::FirstAnswer } else { Change::Segment };
            (seen, until) = (now, last.min(bus.now() + SETTLE));
        }
        if bus.now() >= until {
            return change;
        }
        segment.until_posted(posted, until, || false).await;
    }
}

/// How many SubDevices answered on each link.
pub(super) fn answering(segment: &SharedSegment) -> (u16, u16) {
    segment.board.supervision().map_or((0, 0), |(_, seen)| (seen.main.0, seen.redundant.0))
}
