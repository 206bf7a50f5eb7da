//! Waiting until the segment has changed, while its clocks could not be set up.

use core::time::Duration;

use crate::procedures::shared_segment::SharedSegment;
use crate::supervisor::Bus;

/// Between two looks at the board, and at the differences before all are locked.
const PAUSE: Duration = Duration::from_millis(1);
/// From the last change of the segment until it is measured again: a plug that is pushed in bounces.
pub(super) const SETTLE: Duration = Duration::from_millis(5);

/// What became of a segment meanwhile.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Change {
    None,
    /// Somebody answers where nobody did: so it is when cycles begin, which is nothing new.
    FirstAnswer,
    Segment,
}

/// Waits, until the segment has changed and is at rest again at the longest.
pub(super) async fn wait_for_change(bus: &Bus, segment: &SharedSegment, limit: Duration) -> Change {
    segment.board.clocks.guard_ports();
    let state = || (segment.board.ring().changes, segment.board.clocks.holds(), answering(segment));
    let (until, mut seen) = (bus.now() + limit, state());
    let (mut change, mut changed_at) = (Change::None, bus.now());
    while bus.now() < until && (change == Change::None || bus.now() < changed_at + SETTLE) {
        bus.sleep(PAUSE).await;
        let now = state();
        if now != seen {
            let is_first = seen.2 == (0, 0) && change != Change::Segment;
            change = if is_first { Change::FirstAnswer } else { Change::Segment };
            (seen, changed_at) = (now, bus.now());
        }
    }
    change
}

/// How many SubDevices answered on each link.
pub(super) fn answering(segment: &SharedSegment) -> (u16, u16) {
    segment.board.supervision().map_or((0, 0), |(_, seen)| (seen.main.0, seen.redundant.0))
}
