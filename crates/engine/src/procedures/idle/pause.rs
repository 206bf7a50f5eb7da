//! Work on ports without an application: broadcasts pause, and no scan of idle operation begins.

use alloc::rc::Rc;
use core::cell::RefCell;
use core::future::Future;
use core::time::Duration;

use super::ports::follow_ports;
use crate::procedures::shared_segment::SharedSegment;
use crate::segment::IdleObservation;
use crate::segment::disturbance::Disturbance;
use crate::supervisor::Bus;

/// Maximum wait for other procedures that need the ports, and for one of idle operation that works on the segment.
const LIMIT: Duration = Duration::from_secs(5);

/// Carries out work that closes ports for a moment; it is completed also if the caller no longer waits. Broadcasts
/// pause meanwhile: fewer SubDevices would answer them. `None` if it cannot be done now, or if an application or a
/// requested scan begins meanwhile: then the work ends, and the application or the scan restores the ports.
pub(crate) async fn without_watch<T: 'static>(
    bus: &Bus,
    segment: &SharedSegment,
    work: impl Future<Output = T> + 'static,
) -> Option<T> {
    let (ended, result) = (bus.signal(), Rc::new(RefCell::new(None)));
    let (own_bus, own_segment, own_ended, own_result) = (bus.clone(), segment.clone(), ended.clone(), result.clone());
    bus.spawn(async move {
        // Work that has begun must be completed; work that has not begun is not started for a caller that no longer
        // waits.
        let is_wanted = || Rc::strong_count(&own_result) > 1;
        let done = paused(&own_bus, &own_segment, is_wanted, work).await;
        *own_result.borrow_mut() = Some(done);
        own_ended.notify();
    });
    ended.until(|| result.borrow_mut().take()).await
}

async fn paused<T>(
    bus: &Bus,
    segment: &SharedSegment,
    is_wanted: impl Fn() -> bool,
    work: impl Future<Output = T>,
) -> Option<T> {
    let _turn = segment.disturb(Disturbance::OpenByPort, LIMIT).await?;
    let quiet = segment.until(|model| (!model.is_idle_busy() && !model.is_scanning()).then_some(()));
    bus.within(LIMIT, quiet).await.ok()?;
    if segment.view().is_active() || !is_wanted() {
        return None;
    }
    let scan = segment.view().scan_number();
    segment.observe_idle(IdleObservation::Measuring);
    let result = segment.unless(|model| model.is_active() || model.has_another_scan(scan), work).await;
    segment.observe_idle(IdleObservation::Measured);
    if segment.view().is_active() {
        // The work may have read ports, which clears the events that show a change.
        follow_ports(segment, false);
    }
    // A scan that has begun and ended meanwhile has changed the ports as well.
    result.filter(|_| segment.view().scan_number() == scan)
}
