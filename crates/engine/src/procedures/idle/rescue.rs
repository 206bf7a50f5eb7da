//! The rescue scan: a scan on request without an application, which leaves those that did not change in place (Master
//! Redundancy 10.8).

use alloc::rc::Rc;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::Position;

use crate::info::SubDeviceInfo;
use crate::procedures::services::ServiceError;
use crate::procedures::shared_segment::SharedSegment;
use crate::procedures::unassigned::rescan::{Found, Identified, Rescan};
use crate::segment::{Differences, IdleObservation};
use crate::supervisor::Bus;

/// Scans the whole segment again and returns what is there, and what is different.
pub(crate) async fn rescue(bus: &Bus, segment: &SharedSegment, limit: Duration) -> Result<Rescan, ServiceError> {
    segment.observe_idle(IdleObservation::RescanAsked);
    let number = segment.view().last_rescan_asked();
    // The watch carries it out, so that it does not scan at the same time by itself.
    let rescanned = segment.until(|model| model.rescanned(number).cloned());
    let differences = bus.within(limit, rescanned).await;
    let Differences { counts, added, removed, moved } = differences.map_err(|_| ServiceError::Unsteady)?;
    let view = segment.view();
    let found = view.found().ok_or(ServiceError::Unsteady)?;
    let at_place = |(position, info): (u16, &Rc<SubDeviceInfo>)| {
        let before = moved.iter().find(|(station, _)| *station == info.station);
        Found {
            position: Position(position),
            station: info.station,
            identified: Identified::Undeclared(info.identity),
            moved_from: before.map(|(_, position)| *position),
        }
    };
    let subdevices = (0..).zip(&found.subdevices).map(at_place).collect();
    let topology = found.topology.clone();
    Ok(Rescan { counts, subdevices, missing: Vec::new(), topology, added, removed })
}
