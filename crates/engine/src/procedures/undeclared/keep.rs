//! Reports to the model when attempts of SubDevices without a declaration are due.

use crate::procedures::shared_segment::SharedSegment;
use crate::segment::{Segment, UndeclaredObservation};
use crate::supervisor::Bus;

/// Has attempts begun as they fall due. Runs until the MainDevice stops.
pub(crate) async fn keep(bus: Bus, segment: SharedSegment) {
    loop {
        begin_due(&bus, &segment).await;
    }
}

/// Starts attempts when they are due, until all SubDevices are in their requested states or wait for a request. True if
/// all are in their requested states.
pub(crate) async fn settle(bus: &Bus, segment: &SharedSegment) -> bool {
    while !segment.view().are_attempts_ended() {
        begin_due(bus, segment).await;
    }
    segment.view().are_undeclared_settled()
}

/// Has the attempts begun that are due, and waits until others may be.
async fn begin_due(bus: &Bus, segment: &SharedSegment) {
    segment.observe_undeclared(UndeclaredObservation::AttemptsDue);
    let state = |model: &Segment| (model.next_attempt(), model.are_attempts_ended());
    let before = state(&segment.view());
    let changed = segment.until(|model| (state(model) != before).then_some(()));
    let _ = bus.within(before.0.since(bus.now()), changed).await;
}
