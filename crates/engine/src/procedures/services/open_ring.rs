//! Rings that are open for a moment, without an application: of two links, and behind junctions (protocol 2.2, 7.1).

use alloc::vec::Vec;
use core::future::Future;
use core::time::Duration;

use ringcat_wire::address::StationAddress;
use ringcat_wire::register::{DlStatus, map};

use crate::link::LinkSet;
use crate::procedures::idle::{are_ports_as_scanned, without_watch};
use crate::procedures::loops::{controls, until_ring_is_closed, while_closed};
use crate::procedures::shared_segment::SharedSegment;
use crate::ring::RingState;
use crate::segment::Segment;
use crate::supervisor::Bus;

/// Maximum wait until an opened ring of two links whose ports are open again is seen closed: broadcasts pause
/// meanwhile, and a break of the ring has to be detected soon.
const CLOSING: Duration = Duration::from_millis(50);

/// Rings that are opened.
#[derive(Debug)]
pub(super) struct Rings {
    /// The ports at their ends.
    pub ports: Vec<(StationAddress, u8)>,
    /// The ports of all SubDevices, by position, as the last scan has found them.
    pub status: Vec<(StationAddress, DlStatus)>,
}

/// Closes the ports at the ends of rings, carries out `open`, opens the ports again and carries out `whole`, also if
/// the caller no longer waits. `None` if that cannot be done now, or if the segment differs from the last scan before
/// or afterwards.
pub(super) async fn while_open<T: 'static, U: 'static>(
    bus: &Bus,
    segment: &SharedSegment,
    rings: Rings,
    open: impl Future<Output = T> + 'static,
    whole: impl Future<Output = U> + 'static,
) -> Option<(T, U)> {
    let (own_bus, own_segment) = (bus.clone(), segment.clone());
    let work = async move {
        let (bus, segment) = (own_bus, own_segment);
        // Idle operation may have found a changed segment before it paused.
        let stations = |segment: &Segment| segment.found().map(|found| found.stations());
        let are_same =
            stations(&segment.view()).is_some_and(|now| now.iter().eq(rings.status.iter().map(|(at, _)| at)));
        if !are_same || !are_ports_as_scanned(&bus, &segment, &rings.status).await {
            return None;
        }
        let opened = close_ports(&bus, &segment, &rings.ports, open).await;
        let closed = whole.await;
        // Otherwise the events of these ports would cause another scan and another examination of the rings.
        let is_cleared = bus.brd(map::DL_STATUS, DlStatus::LEN).await.is_ok();
        let is_as_before = are_ports_as_scanned(&bus, &segment, &rings.status).await;
        Some((opened?, closed)).filter(|_| is_cleared && is_as_before)
    };
    without_watch(bus, segment, work).await.flatten()
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
    let (result, _) = while_closed(bus, segment, &before, ports, work).await;
    if is_closed {
        until_ring_is_closed(bus, CLOSING).await;
    }
    result.ok()
}
