//! Identifies unassigned SubDevices as absent members by the cables to their neighbours.
//!
//! Several may be of the same type. If all of them are present, their order distinguishes them. If some are missing, or
//! a ring is open at another place than at the scan so that frames pass its SubDevices from the other side, only their
//! neighbours do. Inputs are the cables of the scan or rescan and the present cables according to the ports: the
//! SubDevice that is connected to the same port of a member, with the same port of its own, as before is the SubDevice
//! of before.

use alloc::vec;
use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;
use ringcat_wire::register::{DlStatus, PortKind};

use super::fit::fit;
use crate::order::InOrder;
use crate::segment::cabling::type_of;
use crate::segment::knowledge::Knowledge;
use crate::segment::matching::Fit;
use crate::segment::member::Phase;
use crate::segment::model::Segment;
use crate::segment::unassigned::{ByCables, UnassignedView};
use crate::segment::view::View;
use crate::topology::{Closing, Finding, NodeStatus, PortOf, Topology};

/// One end of a cable; `None` is the main link.
type End = Option<PortOf>;

impl Segment {
    /// An unassigned SubDevice matches several absent members, or one of them without proof by order, or there were
    /// others without a declaration: then ports have to be read ([`Segment::identified_by_cables`]).
    pub fn needs_cables(&self) -> bool {
        let places = self.members().filter(|member| member.node.is_some()).count();
        let had_others = self.cabling.topology.nodes.len() > places;
        self.subdevices.unassigned().any(|it| {
            let fits: Vec<usize> = self.absent().filter(|index| self.may_be(it, *index)).collect();
            match fits[..] {
                [] => false,
                [only] => had_others || !self.is_between(it, only),
                _ => true,
            }
        })
    }

    /// The members that unassigned SubDevices are, and those that are none, as far as the cables show. `ports` by
    /// position.
    pub fn identified_by_cables(&self, view: &View, ports: &[DlStatus]) -> ByCables {
        let owners = self.owners(&view.stations);
        let owners: Vec<Option<usize>> = (0..view.stations.len()).map(|at| owners.at(at)).collect();
        let kept = (0..owners.len()).map(|at| owners[at].map_or_else(|| self.kept_place(view, at), |_| None)).collect();
        Present { segment: self, view, nodes: self.nodes(view, ports), kept }.identified(owners)
    }

    /// The place of a SubDevice without a declaration that has kept its address, by its present position.
    fn kept_place(&self, view: &View, at: usize) -> Option<usize> {
        let station = view.stations[at];
        let place = self.cabling.stations.iter().position(|other| *other == station)?;
        let is_alone = view.position(station) == Some(at);
        let is_unassigned = || self.subdevices.unassigned().any(|it| it.key.station == station);
        (self.is_of_others(place) && is_alone && is_unassigned()).then_some(place)
    }

    /// A SubDevice without a declaration was at this place.
    fn is_of_others(&self, node: usize) -> bool {
        self.subdevices.member_at(node).is_none()
    }

    /// Port states of all SubDevices, with their port kinds if known. By position.
    pub fn nodes(&self, view: &View, ports: &[DlStatus]) -> Vec<NodeStatus> {
        let owners = self.owners(&view.stations);
        let node = |(at, (station, dl_status)): (usize, (&StationAddress, &DlStatus))| {
            let known = self.known_at(owners.at(at), *station).and_then(Knowledge::info);
            let ports: [PortKind; 4] = known.map(|info| info.controller.ports).unwrap_or_default();
            NodeStatus { dl_status: *dl_status, receive_times: None, ports }
        };
        view.stations.iter().zip(ports).enumerate().map(node).collect()
    }

    /// What is known of the SubDevice at a station address: of the member that it is, or of an unassigned SubDevice.
    pub fn known_at(&self, owner: Option<usize>, station: StationAddress) -> Option<&Knowledge> {
        let unassigned = || self.subdevices.unassigned().find(|it| it.key.station == station).map(|it| it.knowledge);
        owner.map_or_else(unassigned, |index| Some(&self.subdevices.all().get(index)?.knowledge))
    }

    /// Absent members, without those of groups.
    pub(in crate::segment) fn absent(&self) -> impl Iterator<Item = usize> + '_ {
        let members = self.members().enumerate();
        let absent = members.filter(|(_, member)| member.phase == Phase::Absent && member.config.group.is_none());
        absent.map(|(index, _)| index)
    }

    /// Its identity is known, and equals the last known identity of the member.
    pub(in crate::segment) fn may_be(&self, it: UnassignedView<'_>, index: usize) -> bool {
        it.knowledge.info().is_some() && matches!(fit(self, it, index), Fit::Seen | Fit::Serial)
    }
}

/// The segment as it is now.
struct Present<'a> {
    segment: &'a Segment,
    view: &'a View,
    nodes: Vec<NodeStatus>,
    /// Places of SubDevices without a declaration that have kept their addresses, by present positions.
    kept: Vec<Option<usize>>,
}

impl Present<'_> {
    fn unassigned_at(&self, at: usize) -> Option<UnassignedView<'_>> {
        self.segment.subdevices.unassigned().find(|it| self.view.position(it.key.station) == Some(at))
    }

    /// The absent member that was at a place, if the unassigned SubDevice at a position may be it.
    fn candidate(&self, node: usize, at: usize) -> Option<usize> {
        let index = self.segment.subdevices.member_at(node)?;
        let unassigned = self.unassigned_at(at)?;
        (self.segment.absent().any(|it| it == index) && self.segment.may_be(unassigned, index)).then_some(index)
    }

    fn identified(&self, mut members: Vec<Option<usize>>) -> ByCables {
        let mut result = ByCables::default();
        if self.is_as_before(&members) {
            for at in (0..members.len()).filter(|at| members[*at].is_none()) {
                match self.candidate(at, at) {
                    Some(index) => result.members.push((self.view.stations[at], index)),
                    None if self.is_other(at, at) => result.others.push(self.view.stations[at]),
                    None => {}
                }
            }
            return result;
        }
        let before = &self.segment.cabling.topology;
        let now = self.topology(&members);
        // In a closed ring with crossed SubDevices neighbours are an assumption.
        if before.is_assumed() || now.is_assumed() {
            return result;
        }
        let (before, now) = (ends(before), self.ends(&now));
        loop {
            let places = self.next_to(&members, &before, &now);
            let there = |(at, node): &(usize, usize)| Some((*at, self.candidate(*node, *at)?));
            let mut found: Vec<(usize, usize)> = places.iter().filter_map(there).collect();
            found.retain(|(_, index)| !members.contains(&Some(*index)));
            let is_sure = |(at, index): &(usize, usize)| {
                found.iter().filter(|(other, member)| other == at || member == index).count() == 1
            };
            let sure: Vec<(usize, usize)> = found.iter().copied().filter(is_sure).collect();
            if sure.is_empty() {
                let others = places.iter().filter(|(at, node)| self.is_other(*node, *at));
                result.others = others.map(|(at, _)| self.view.stations[*at]).collect();
                return result;
            }
            for (at, index) in sure {
                members[at] = Some(index);
                result.members.push((self.view.stations[at], index));
            }
        }
    }

    /// The SubDevice at a position may be the one without a declaration that was at this place: a type that is known is
    /// the same. One of another type was put there.
    fn is_other(&self, node: usize, at: usize) -> bool {
        let before = self.segment.cabling.types.get(node).copied().flatten();
        let is_same = |before| self.unassigned_at(at).and_then(|it| Some(type_of(it.knowledge.info()?) == before));
        self.segment.is_of_others(node) && before.is_none_or(|before| is_same(before).unwrap_or(true))
    }

    /// Unassigned SubDevices next to members, by position, with the place of before that they are at.
    fn next_to(&self, members: &[Option<usize>], before: &[[End; 2]], now: &[[End; 2]]) -> Vec<(usize, usize)> {
        let mut found = Vec::new();
        for (near, far) in now.iter().flat_map(|[one, other]| [(*one, *other), (*other, *one)]) {
            let Some(far) = far.filter(|far| members[far.node].is_none()) else { continue };
            let Some(then) = self.place_before(members, near) else { continue };
            let Some(other) = opposite(before, then).filter(|other| other.port == far.port) else { continue };
            found.push((far.node, other.node));
        }
        found.put_in_order();
        found.dedup();
        found
    }

    /// An end of a cable in the previous cabling, if the SubDevice there is known: a member, or one without a
    /// declaration that has kept its address.
    fn place_before(&self, members: &[Option<usize>], end: End) -> Option<End> {
        let Some(PortOf { node, port }) = end else { return Some(None) };
        let node = members[node].map_or(self.kept[node], |index| self.segment.member(index)?.node)?;
        Some(Some(PortOf { node, port }))
    }

    /// The counts on each link equal those of the previous cabling, and all known SubDevices are at their places.
    fn is_as_before(&self, members: &[Option<usize>]) -> bool {
        let before = &self.segment.cabling.topology;
        let counts = (usize::from(self.view.counts.0.0), members.len());
        let node = |index: usize| self.segment.member(index).and_then(|member| member.node);
        let at_home = |(at, index): (usize, &Option<usize>)| index.is_none_or(|it| node(it) == Some(at));
        counts == (before.main_count, before.nodes.len()) && members.iter().enumerate().all(at_home)
    }

    /// The cabling according to the ports. A ring with an unassigned last SubDevice is closed if the cables of all
    /// known SubDevices are unchanged.
    fn topology(&self, members: &[Option<usize>]) -> Topology {
        let main_count = usize::from(self.view.counts.0.0);
        let mut closings = Vec::new();
        let mut open = Vec::new();
        for ring in &self.segment.cabling.topology.local_rings {
            let place = |end: PortOf| {
                let index = self.segment.subdevices.member_at(end.node);
                let node = members.iter().position(|member| index.is_some() && *member == index)?;
                Some(PortOf { node, port: end.port })
            };
            match (place(ring.closing.head), place(ring.closing.tail)) {
                (Some(head), Some(tail)) => closings.push(Closing { head, tail }),
                (Some(head), None) => open.push((head, ring.closing.tail)),
                (None, _) => {}
            }
        }
        let before = ends(&self.segment.cabling.topology);
        for (head, tail) in open.into_iter().filter(|(head, _)| self.communicates(*head)) {
            let ends_there = |at: &usize| {
                let end = PortOf { node: *at, port: tail.port };
                self.communicates(end) && members[*at].is_none() && self.candidate(tail.node, *at).is_some()
            };
            let candidates: Vec<Closing> = (head.node + 1..members.len())
                .filter(ends_there)
                .map(|node| Closing { head, tail: PortOf { node, port: tail.port } })
                .filter(|closing| {
                    let all: Vec<Closing> = closings.iter().chain([closing]).copied().collect();
                    self.is_possible(&Topology::with_local_rings(&self.nodes, main_count, &all), members, &before)
                })
                .take(2)
                .collect();
            if let [only] = candidates[..] {
                closings.push(only);
            }
        }
        Topology::with_local_rings(&self.nodes, main_count, &closings)
    }

    /// No cable between two known SubDevices has changed, and all have a place.
    fn is_possible(&self, now: &Topology, members: &[Option<usize>], before: &[[End; 2]]) -> bool {
        let fits = |[one, other]: &[End; 2]| {
            let (one, other) = (self.place_before(members, *one), self.place_before(members, *other));
            let (Some(one), Some(other)) = (one, other) else { return true };
            opposite(before, one) == other
        };
        let is_odd = |finding: &Finding| matches!(finding, Finding::Inconsistent { .. });
        !now.findings.iter().any(is_odd) && self.ends(now).iter().all(fits)
    }

    fn communicates(&self, end: PortOf) -> bool {
        self.nodes[end.node].dl_status.ports[usize::from(end.port & 3)].communication
    }

    /// The ends of the cables that communicate.
    fn ends(&self, topology: &Topology) -> Vec<[End; 2]> {
        let mut ends = ends(topology);
        ends.retain(|cable| cable.iter().flatten().all(|end| self.communicates(*end)));
        ends
    }
}

/// The ends of all cables.
fn ends(topology: &Topology) -> Vec<[End; 2]> {
    let mut ends = vec![];
    if let Some(first) = topology.nodes.first().filter(|_| topology.main_count > 0) {
        ends.push([None, Some(PortOf { node: 0, port: first.entry_port })]);
    }
    let inner = (0..topology.nodes.len()).filter_map(|node| topology.cable_to(node));
    ends.extend(inner.map(|cable| [Some(cable.near), Some(cable.far)]));
    ends.extend(topology.local_rings.iter().map(|ring| [Some(ring.closing.tail), Some(ring.closing.head)]));
    ends
}

/// The other end of the cable that begins here.
fn opposite(cables: &[[End; 2]], here: End) -> End {
    cables.iter().find_map(|[one, other]| match here {
        here if *one == here => *other,
        here if *other == here => *one,
        _ => None,
    })
}
