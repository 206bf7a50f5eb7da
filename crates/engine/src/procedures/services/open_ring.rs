//! Rings that are open for a moment, without an application: of two links, and behind junctions (protocol 2.2, 7.1).

use alloc::vec::Vec;
use core::future::Future;

use ringcat_wire::address::StationAddress;
use ringcat_wire::register::{DlStatus, map};

use crate::link::LinkSet;
use crate::procedures::idle::{are_ports_as_before, without_watch};
use crate::procedures::loops::{controls, until_ring_is_closed, while_closed};
use crate::procedures::shared_segment::SharedSegment;
use crate::ring::RingState;
use crate::segment::{IdleObservation, Segment};
use crate::supervisor::Bus;

/// Rings that are opened.
#[derive(Debug)]
pub(super) struct Rings {
    /// The ports at their ends.
    pub ports: Vec<(StationAddress, u8)>,
    /// The ports of all SubDevices before.
    pub status: Vec<(StationAddress, DlStatus)>,
}

/// Closes the ports at the ends of rings, carries out `open`, opens the ports again and carries out `whole`, also if the
/// caller no longer waits; `None` if that cannot be done now.
pub(super) async fn while_open<T: 'static, U: 'static>(
    bus: &Bus,
    segment: &SharedSegment,
    rings: Rings,
    open: impl Future<Output = T> + 'static,
    whole: impl Future<Output = U> + 'static,
) -> Option<(T, U)> {
    let (own_bus, own_segment) = (bus.clone(), segment.clone());
    let work = async move {
        let opened = close_ports(&own_bus, &own_segment, &rings.ports, open).await?;
        let closed = whole.await;
        let is_as_before = clear_events(&own_bus, &own_segment, &rings.status).await;
        if !is_as_before {
            own_segment.observe_idle(IdleObservation::RescanAsked);
        }
        Some((opened, closed))
    };
    without_watch(bus, segment, work).await.flatten()
}

/// Clears the ECAT events of the ports: idle operation would scan again, and examine the rings. False if ports have
/// changed besides.
async fn clear_events(bus: &Bus, segment: &SharedSegment, before: &[(StationAddress, DlStatus)]) -> bool {
    // An application finds the events itself.
    if segment.view().is_active() {
        return true;
    }
    bus.brd(map::DL_STATUS, DlStatus::LEN).await.is_ok() && are_ports_as_before(bus, before).await.unwrap_or(false)
}

async fn close_ports<T>(
    bus: &Bus,
    segment: &SharedSegment,
    ports: &[(StationAddress, u8)],
    work: impl Future<Output = T>,
) -> Option<T> {
    let before = controls(bus, segment, ports).await.ok()?;
    // An application or a scan may have begun meanwhile.
    let has_begun = |model: &Segment| model.is_active() || model.is_scanning();
    if has_begun(&segment.view()) {
        return None;
    }
    let is_closed = bus.links() == LinkSet::Ring && bus.ring() == RingState::Closed;
    let result = while_closed(bus, segment, (&before, ports), work).await.ok();
    if is_closed {
        until_ring_is_closed(bus).await;
    }
    result
}
