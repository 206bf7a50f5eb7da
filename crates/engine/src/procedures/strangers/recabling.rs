//! What a look at the whole segment has shown takes the place of the cabling of the scan: places of breaks, errors of
//! cables and positions in events are then those of the segment as it is.

use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;

use super::rescan::{Rescan, Who};
use crate::link::LinkSet;
use crate::procedures::fleet::{Fleet, Member, Phase, SharedFleet, stations_by_position};
use crate::ring::RingState;
use crate::ring_status::{Cable, CableErrors, cables};
use crate::supervisor::Bus;
use crate::topology::PortOf;

/// The ends of a cable, by who is there.
type Ends = [Option<(StationAddress, u8)>; 2];

/// Whether a look could be taken over: nothing is broken or missing that would be forgotten.
pub(super) fn is_whole(bus: &Bus, shared: &SharedFleet) -> bool {
    let access = shared.access();
    let closed = shared.board.ring().state == RingState::Closed && access.ring.state == RingState::Closed;
    let is_missed = |member: &Member| !member.config.optional && member.phase == Phase::Absent;
    (bus.links() == LinkSet::Single || closed) && !access.members.iter().any(is_missed)
}

/// Takes over the cabling, unless the ring of two links is open, or a mandatory SubDevice does not answer: what is broken
/// would be forgotten. A ring behind a junction may be broken, for it is known where it closes, and what was told of it goes
/// on to hold ([`crate::procedures::junction`]). True where it was taken over.
pub(super) fn adopt(bus: &Bus, shared: &SharedFleet, rescan: &Rescan) -> bool {
    let mut access = shared.access();
    let closed = shared.board.ring().state == RingState::Closed && access.ring.state == RingState::Closed;
    let is_whole = bus.links() == LinkSet::Single || (closed && rescan.topology.redundant_head.is_none());
    let is_missed = |index: &usize| access.members.get(*index).is_none_or(|member| !member.config.optional);
    if !is_whole || rescan.missing.iter().any(is_missed) {
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
    let stations = stations_by_position(&fleet.members, rescan.subdevices.iter().map(|found| found.station));
    let cables: Vec<(Cable, CableErrors)> = cables(&rescan.topology, bus.links()).into_iter().map(counted).collect();
    if fleet.cables != cables || fleet.stations != stations || fleet.topology.local_rings != rescan.topology.local_rings
    {
        fleet.recablings = fleet.recablings.wrapping_add(1);
    }
    fleet.cables = cables;
    fleet.topology = rescan.topology.clone();
    fleet.stations = stations;
    bus.set_occupants(fleet.occupants());
    let end = |at: PortOf| Some((*fleet.stations.get(at.node)?, at.port));
    let rings = fleet.topology.local_rings.iter().map(|ring| ring.closing);
    let closings = rings.filter_map(|closing| Some([end(closing.head)?, end(closing.tail)?])).collect();
    shared.clocks.access().closings = closings;
    // What is broken in it may not have been told yet.
    shared.note_news();
    true
}

/// A stranger that has a place in the cabling and becomes a member has that place as a member.
pub(super) fn take_place(bus: &Bus, fleet: &mut Fleet, stranger: StationAddress, index: usize) {
    let Some(at) = fleet.stations.iter().position(|station| *station == stranger) else { return };
    let member = &mut fleet.members[index];
    // Nobody answers at its temporary address any more, nor is anybody where the member was.
    if let Some(place) = member.node.and_then(|node| fleet.stations.get_mut(node)) {
        *place = stranger;
    }
    fleet.stations[at] = member.station;
    member.node = Some(at);
    bus.set_occupants(fleet.occupants());
    fleet.recablings = fleet.recablings.wrapping_add(1);
}

fn ends(cable: &Cable, station: impl Fn(usize) -> Option<StationAddress>) -> Ends {
    [cable.near, cable.far].map(|end| end.and_then(|PortOf { node, port }| Some((station(node)?, port))))
}

fn station_at(fleet: &Fleet, node: usize) -> Option<StationAddress> {
    fleet.members.iter().find(|member| member.node == Some(node)).map(|member| member.station)
}
