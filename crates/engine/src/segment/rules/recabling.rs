//! Replaces the cabling of the scan by that of a rescan: places of breaks, errors of cables and positions in events
//! then follow the present segment.

use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;

use crate::declared::Move;
use crate::event::Event;
use crate::link::LinkSet;
use crate::ring::RingState;
use crate::ring_status::{Cable, CableErrors, cables};
use crate::segment::cabling::{Cabling, End, stations_by_position, type_of};
use crate::segment::effect::{Effect, Effects};
use crate::segment::knowledge::Knowledge;
use crate::segment::member::Phase;
use crate::segment::model::Segment;
use crate::segment::seen::Seen;
use crate::segment::versions::Versions;
use crate::segment::words::Words;
use crate::topology::PortOf;

/// The ends of a cable, with the SubDevices there.
type Ends = [Option<End>; 2];

impl Segment {
    /// Whether a rescan can be taken over: no break and no missing SubDevice would be lost from the model.
    pub fn is_whole(&self, words: &Words) -> bool {
        let is_missed = self.members().any(|member| !member.config.optional && member.phase == Phase::Absent);
        (words.links() == LinkSet::Single || self.is_closed(words)) && !is_missed
    }

    fn is_closed(&self, words: &Words) -> bool {
        words.ring_state() == RingState::Closed && self.ring.status.state == RingState::Closed
    }

    /// Declared SubDevices are at other positions than at the scan.
    pub(in crate::segment) fn observe_moved(&self, versions: Versions, moved: Vec<Move>, effects: &mut Effects) {
        if self.are_places_valid(versions) {
            let event = |Move { subdevice, from, to }| Event::Moved { subdevice, from, to };
            moved.into_iter().map(event).for_each(|event| effects.report(event));
        }
    }

    /// Takes over the cabling, unless the ring of two links is open, or a mandatory SubDevice does not answer: the
    /// break would be lost from the model. A ring behind a junction may be broken, because the place where it closes is
    /// known, and its reported breaks stay valid.
    pub(in crate::segment) fn adopt(
        &mut self,
        versions: Versions,
        seen: Seen<'_>,
        words: &Words,
        effects: &mut Effects,
    ) {
        if !self.are_places_valid(versions) || versions.cabling != self.cabling.version {
            return;
        }
        let is_single = words.links() == LinkSet::Single;
        let is_whole = is_single || (self.is_closed(words) && seen.topology.redundant_head.is_none());
        let is_there = |index: usize| seen.members.contains(&Some(index));
        let is_missed = self.members().enumerate().any(|(index, member)| !is_there(index) && !member.config.optional);
        if !is_whole || is_missed {
            return;
        }
        let before: Vec<(Ends, CableErrors)> = {
            let ends = |cable: &Cable| ends(cable, |node| self.station_of(node));
            self.cabling.cables.iter().map(|(cable, errors)| (ends(cable), *errors)).collect()
        };
        for (index, member) in self.subdevices.members_mut().enumerate() {
            member.node = seen.members.iter().position(|owner| *owner == Some(index));
        }
        let counted = |cable: Cable| {
            // Unknown SubDevices have no counts, and ends of two cables without a SubDevice are not equal.
            let now = ends(&cable, |node| seen.stations.get(node).copied());
            let same = before.iter().find(|(ends, _)| *ends == now && now != [None, None]);
            (cable, same.map_or(CableErrors::default(), |(_, errors)| *errors))
        };
        let type_at = |(at, station): (usize, &StationAddress)| {
            self.known_at(seen.members.get(at).copied().flatten(), *station)
                .and_then(Knowledge::info)
                .map(|info| type_of(info))
        };
        let now = Cabling {
            topology: seen.topology.clone(),
            types: seen.stations.iter().enumerate().map(type_at).collect(),
            stations: stations_by_position(&self.subdevices, seen.stations.iter().copied()),
            cables: cables(seen.topology, words.links()).into_iter().map(counted).collect(),
            closings: core::mem::take(&mut self.cabling.closings),
            version: self.cabling.version,
        };
        let is_other = self.cabling.cables != now.cables
            || self.cabling.stations != now.stations
            || self.cabling.topology.local_rings != now.topology.local_rings;
        self.cabling = Cabling { version: now.version.wrapping_add(u32::from(is_other)), ..now };
        self.adoptions = self.adoptions.wrapping_add(1);
        effects.0.push(Effect::Occupants(self.occupants()));
        // A break in it may not have been reported yet.
        self.attention.want();
    }

    /// Both ends of the closing cables of all local rings of the cabling.
    pub fn present_closings(&self) -> Vec<[End; 2]> {
        let end = |at: PortOf| Some((*self.cabling.stations.get(at.node)?, at.port));
        let rings = self.cabling.topology.local_rings.iter().map(|ring| ring.closing);
        rings.filter_map(|closing| Some([end(closing.head)?, end(closing.tail)?])).collect()
    }

    /// An unassigned SubDevice with a place in the cabling keeps the place when it becomes a member.
    pub(in crate::segment) fn take_place(&mut self, unassigned: StationAddress, index: usize, effects: &mut Effects) {
        let stations = &mut self.cabling.stations;
        let Some(at) = stations.iter().position(|station| *station == unassigned) else { return };
        let Some(own) = self.subdevices.member(index).map(|member| member.station) else { return };
        let Some(member) = self.subdevices.member_mut(index) else { return };
        // Its temporary address is free now, and so is the member's previous place.
        if let Some(place) = member.node.and_then(|node| stations.get_mut(node)) {
            *place = unassigned;
        }
        stations[at] = own;
        member.node = Some(at);
        self.cabling.version = self.cabling.version.wrapping_add(1);
        effects.0.push(Effect::Occupants(self.occupants()));
    }
}

fn ends(cable: &Cable, station: impl Fn(usize) -> Option<StationAddress>) -> Ends {
    [cable.near, cable.far].map(|end| end.and_then(|PortOf { node, port }| Some((station(node)?, port))))
}
