//! What a look at the whole segment has shown takes the place of the cabling of the scan: places of breaks, errors of
//! cables and positions in events are then those of the segment as it is.

use alloc::vec::Vec;

use ringcat_wire::address::{StationAddress, Wkc};

use super::rescan::{Rescan, Who};
use crate::link::LinkSet;
use crate::procedures::fleet::{Fleet, SharedFleet, stations_by_position};
use crate::ring::RingState;
use crate::ring_status::{Cable, CableErrors, cables};
use crate::supervisor::Bus;
use crate::topology::PortOf;

/// The ends of a cable, by who is there.
type Ends = [Option<(StationAddress, u8)>; 2];

/// Takes over the cabling, unless the segment is broken, or known to have rings behind junctions: what is broken would be
/// forgotten, and where such rings close is not seen by a look. Mandatory SubDevices that do not answer count as broken.
/// True where it was taken over.
pub(super) fn adopt(bus: &Bus, fleet: &SharedFleet, rescan: &Rescan) -> bool {
    let mut access = fleet.access();
    let closed = fleet.board.ring().state == RingState::Closed && access.ring.state == RingState::Closed;
    let is_whole = bus.links() == LinkSet::Single || (closed && rescan.counts.1 == Wkc(0));
    let is_missed = |index: &usize| access.members.get(*index).is_none_or(|member| !member.config.optional);
    if !is_whole || !access.topology.local_rings.is_empty() || rescan.missing.iter().any(is_missed) {
        return false;
    }
    let fleet = &mut *access;
    let before: Vec<(Ends, CableErrors)> =
        fleet.cables.iter().map(|(cable, errors)| (ends(cable, |node| station_at(fleet, node)), *errors)).collect();
    for (index, member) in fleet.members.iter_mut().enumerate() {
        member.node = rescan.subdevices.iter().position(|found| found.who == Who::Declared(index));
    }
    let station = |node: usize| rescan.subdevices.get(node).map(|found| found.station);
    let counted = |cable: Cable| {
        // Who is not known has counted nothing, and the ends of two cables without anybody are not the same.
        let now = ends(&cable, station);
        let same = before.iter().find(|(ends, _)| *ends == now && now != [None, None]);
        (cable, same.map_or(CableErrors::default(), |(_, errors)| *errors))
    };
    let cables: Vec<(Cable, CableErrors)> = cables(&rescan.topology, bus.links()).into_iter().map(counted).collect();
    if fleet.cables != cables {
        fleet.recablings = fleet.recablings.wrapping_add(1);
    }
    fleet.cables = cables;
    fleet.topology = rescan.topology.clone();
    fleet.stations = stations_by_position(&fleet.members, rescan.subdevices.iter().map(|found| found.station));
    true
}

fn ends(cable: &Cable, station: impl Fn(usize) -> Option<StationAddress>) -> Ends {
    [cable.near, cable.far].map(|end| end.and_then(|PortOf { node, port }| Some((station(node)?, port))))
}

fn station_at(fleet: &Fleet, node: usize) -> Option<StationAddress> {
    fleet.members.iter().find(|member| member.node == Some(node)).map(|member| member.station)
}
