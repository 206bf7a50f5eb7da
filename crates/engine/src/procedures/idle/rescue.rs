//! The rescue scan: a scan on request without an application, which leaves those that did not change in place (Master
//! Redundancy 10.8).

use alloc::rc::Rc;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::{Position, StationAddress};

use super::requests::Differences;
use crate::info::SubDeviceInfo;
use crate::procedures::services::ServiceError;
use crate::procedures::shared_segment::SharedSegment;
use crate::procedures::unassigned::rescan::{Found, Identified, Rescan, longest_ascent};
use crate::ring_status::LinkCounts;
use crate::segment::Found as Scanned;
use crate::supervisor::Bus;

/// Scans the whole segment again and returns what is there, and what is different.
pub(crate) async fn rescue(bus: &Bus, segment: &SharedSegment, limit: Duration) -> Result<Rescan, ServiceError> {
    let differences = bus.within(limit, segment.idle_rescans.request()).await;
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

/// What is different from the scan before.
pub(super) fn differences(before: &Scanned, now: &Scanned) -> Differences {
    let (before, stations) = (before.stations(), now.stations());
    let not_in = |all: &[StationAddress], others: &[StationAddress]| {
        all.iter().copied().filter(|station| !others.contains(station)).collect()
    };
    let place = |station: &StationAddress| before.iter().position(|other| other == station);
    let stayed = || stations.iter().filter_map(|station| Some((*station, place(station)?)));
    let places: Vec<usize> = stayed().map(|(_, place)| place).collect();
    let moved = stayed().zip(longest_ascent(&places)).filter(|(_, stays)| !stays);
    let moved = moved.map(|((station, place), _)| (station, Position(place as u16))).collect();
    let counts = LinkCounts {
        main: now.main_count as u16,
        redundant: now.subdevices.len().saturating_sub(now.main_count) as u16,
    };
    Differences { counts, added: not_in(&stations, &before), removed: not_in(&before, &stations), moved }
}
