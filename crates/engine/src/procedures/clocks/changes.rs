//! Waiting until the segment has changed, while its clocks could not be set up.

use core::time::Duration;

use crate::procedures::shared_segment::SharedSegment;
use crate::supervisor::Bus;

/// From the last change of the segment until it is measured again: a plug that is pushed in bounces.
pub(super) const SETTLE: Duration = Duration::from_millis(5);

/// What became of a segment meanwhile.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Change {
    None,
    /// SubDevices answer and none did before: so it is when cycles begin, which is no change.
    FirstAnswer,
    Segment,
}

/// Waits until the segment has changed and is at rest again, at most for a time.
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
