//! A ring of two links that is open for a moment, without an application (protocol 2.2, 7.1).

use alloc::rc::Rc;
use alloc::vec;
use core::cell::RefCell;
use core::future::Future;
use core::time::Duration;

use ringcat_wire::address::StationAddress;
use ringcat_wire::register::LoopControl;

use crate::procedures::loops::{closed_at, followed, restore, until_ring_is_closed, write};
use crate::procedures::shared_segment::SharedSegment;
use crate::segment::disturbance::Disturbance;
use crate::segment::{IdleObservation, Observation, Segment};
use crate::supervisor::Bus;

/// Maximum wait for other procedures that need the ports, and for one of idle operation that works on the segment.
const LIMIT: Duration = Duration::from_secs(5);

/// Closes a port at the end of the ring, carries out `work`, and opens the port again, also if the caller no longer
/// waits; `None` if that cannot be done now.
pub(super) async fn while_open<T: 'static>(
    bus: &Bus,
    segment: &SharedSegment,
    end: (StationAddress, u8),
    work: impl Future<Output = T> + 'static,
) -> Option<T> {
    let (ended, result) = (bus.signal(), Rc::new(RefCell::new(None)));
    let (own_bus, own_segment, own_ended, own_result) = (bus.clone(), segment.clone(), ended.clone(), result.clone());
    bus.spawn(async move {
        let opened = open(&own_bus, &own_segment, end, work).await;
        *own_result.borrow_mut() = Some(opened);
        own_ended.notify();
    });
    ended.until(|| result.borrow_mut().take()).await
}

async fn open<T>(
    bus: &Bus,
    segment: &SharedSegment,
    end: (StationAddress, u8),
    work: impl Future<Output = T>,
) -> Option<T> {
    let _turn = segment.disturb(Disturbance::OpenByPort, LIMIT).await?;
    let quiet = segment.until(|model| (!model.is_idle_busy() && !model.is_scanning()).then_some(()));
    bus.within(LIMIT, quiet).await.ok()?;
    if segment.view().is_active() {
        return None;
    }
    segment.observe_idle(IdleObservation::Measuring);
    let result = close_port(bus, segment, end, work).await;
    segment.observe_idle(IdleObservation::Measured);
    result
}

async fn close_port<T>(
    bus: &Bus,
    segment: &SharedSegment,
    (station, port): (StationAddress, u8),
    work: impl Future<Output = T>,
) -> Option<T> {
    let control = followed(bus, segment, station).await.ok()??;
    if control.loops[usize::from(port & 3)] == LoopControl::Closed {
        return None;
    }
    // An application or a scan may have begun meanwhile.
    let has_begun = |model: &Segment| model.is_active() || model.is_scanning();
    if has_begun(&segment.view()) {
        return None;
    }
    segment.observe(Observation::PortsAltered(&[(station, control)]));
    let closed = closed_at(control, station, &[(station, port)]);
    let result = match write(bus, vec![(station, closed)]).await {
        Ok(()) => Some(work.await),
        Err(_) => None,
    };
    restore(bus, segment).await;
    until_ring_is_closed(bus).await;
    result
}
