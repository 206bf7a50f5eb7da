//! Crossed lines in operation (facts 9.5): whenever ports of SubDevices have changed, the segment is looked at anew,
//! and each SubDevice that is entered at another port than 0 is told, once.
//!
//! More rings behind junctions than are known are told too: an application that asked for junction redundancy must know
//! that one of them is not watched.

use alloc::collections::BTreeSet;
use alloc::vec::Vec;

use ringcat_wire::address::{Position, StationAddress};

use super::cabling::Cabling;
use super::disturbance::Disturbance;
use super::effect::{Effects, Task};
use super::look::Look;
use super::member::{Member, Phase};
use super::unassigned::UnassignedSubDevice;
use super::{Choices, Segment};
use crate::event::Event;
use crate::junction::JunctionMode;
use crate::topology::{Finding, Topology};

/// Bits of DL_STATUS that are about ports.
pub const PORT_BITS: u16 = 0xFFF0;

/// A SubDevice that frames enter at another port than 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Crossing {
    /// Its station address, and its position now; `None` where only the ring shows that there is one.
    pub subdevice: Option<(StationAddress, Position)>,
    /// The port of entry, where known.
    pub entry_port: Option<u8>,
}

impl Crossing {
    fn station(&self) -> Option<StationAddress> {
        self.subdevice.map(|(station, _)| station)
    }
}

/// What a look at the segment shows of crossed lines.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LineCheck {
    /// SubDevices that are crossed.
    pub crossings: Vec<Crossing>,
    /// All of a ring are: its interfaces are swapped.
    pub swapped: bool,
    /// Others that were looked at and are not crossed; empty where the ring was closed, which shows that of none.
    pub straight: Vec<StationAddress>,
    /// Rings behind junctions that are whole and not known.
    pub unknown_rings: usize,
}

impl LineCheck {
    /// Whether it adds nothing to what was told of a segment and takes nothing back.
    pub fn says_the_same_as(&self, told: &LineCheck) -> bool {
        let crossed = |check: &LineCheck| check.crossings.iter().map(Crossing::station).collect::<BTreeSet<_>>();
        crossed(self) == crossed(told) && self.swapped == told.swapped && self.unknown_rings <= told.unknown_rings
    }

    /// What was told and still stands, with what is new. A closed ring takes nothing back that an open one has shown,
    /// and an open one shows nothing of those that do not answer.
    fn and(mut self, found: LineCheck) -> LineCheck {
        if found.crossings.is_empty() {
            self.crossings.clear();
        }
        let straight = |it: &Crossing| it.station().is_some_and(|station| found.straight.contains(&station));
        self.crossings.retain(|it| !straight(it));
        let is_new = |it: &Crossing| !self.crossings.iter().any(|old| old.station() == it.station());
        let new: Vec<Crossing> = found.crossings.iter().copied().filter(is_new).collect();
        self.crossings.extend(new);
        LineCheck {
            swapped: found.swapped || (self.swapped && !found.crossings.is_empty()),
            unknown_rings: self.unknown_rings.max(found.unknown_rings),
            crossings: self.crossings,
            straight: Vec::new(),
        }
    }
}

/// Whether frames reach all of a ring the wrong way round: in a closed one those of the redundant link only, in an open
/// one as the findings say.
pub fn is_swapped(topology: &Topology) -> bool {
    let crossed = |finding: &&Finding| matches!(finding, Finding::CrossedLine { .. });
    let count = topology.nodes.len();
    count > 0
        && ((topology.is_assumed() && topology.main_count == 0)
            || topology.findings.iter().filter(crossed).count() == count)
}

/// How far the search for crossed lines is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Search {
    /// Nothing has changed since the last look at the segment.
    Idle,
    /// The segment is being looked at.
    UnderWay,
    /// The last look has come to nothing.
    Again,
}

/// Looks out for changes of ports, and has crossings told once each.
#[derive(Debug)]
pub(super) struct Crossings {
    /// Rings behind junctions are watched.
    junctions: bool,
    /// What members said about their ports when the segment was looked at last; empty before the first time.
    ports: Vec<Option<u16>>,
    search: Search,
    told: LineCheck,
}

impl Crossings {
    /// What the scan told is not told again.
    pub fn new(cabling: &Cabling, members: &[Member], choices: Choices) -> Crossings {
        let topology = &cabling.topology;
        let told = topology.findings.iter().filter_map(|finding| match *finding {
            Finding::CrossedLine { node, entry_port } => {
                let member = members.iter().find(|member| member.node == Some(node))?;
                let subdevice = Some((member.station, Position(node as u16)));
                Some(Crossing { subdevice, entry_port: Some(entry_port) })
            }
            _ => None,
        });
        let mut told = LineCheck { crossings: told.collect(), ..LineCheck::default() };
        if topology.is_assumed() {
            told.crossings.push(Crossing { subdevice: None, entry_port: None });
        }
        told.swapped = is_swapped(topology);
        let junctions = choices.junctions != JunctionMode::Disabled || !topology.local_rings.is_empty();
        Crossings { junctions, ports: Vec::new(), search: Search::Idle, told }
    }

    pub fn told(&self) -> &LineCheck {
        &self.told
    }
}

impl Segment {
    /// Takes in looks at all members; where ports have changed, the segment is looked at.
    pub(super) fn observe_ports(&mut self, looks: &[Look], effects: &mut Effects) {
        let ports = |look: &Look| match look {
            Look::Answer { dl_status, .. } => Some(dl_status.bits() & PORT_BITS),
            Look::Unknown | Look::Silent | Look::Doubled => None,
        };
        let now: Vec<Option<u16>> = looks.iter().map(ports).collect();
        // One that is silent and not lost yet will be one or the other.
        let phase = |index: usize| self.members.get(index).map_or(Phase::Absent, |member| member.phase);
        let is_open = |(index, ports): (usize, &Option<u16>)| ports.is_none() && phase(index) != Phase::Absent;
        // Clocks that are being measured need the receive times of their own frame.
        let waits = self.crossings.search == Search::UnderWay || self.slot.running() == Some(Disturbance::OpenByPort);
        // One that may be a member, and the end of a ring, is another one before it is known which it is.
        let waits = waits || !self.unassigned.iter().all(UnassignedSubDevice::is_settled);
        let is_new = now != self.crossings.ports || self.crossings.search == Search::Again;
        if waits || !is_new || now.iter().enumerate().any(is_open) {
            return;
        }
        let is_first = self.crossings.ports.is_empty();
        self.crossings.ports = now;
        self.crossings.search = if is_first { Search::Idle } else { Search::UnderWay };
        if !is_first {
            effects.start(Task::ExamineCabling { in_control: self.choices.enhanced_line_crossed });
        }
    }

    /// The segment was looked at; `None` where it changes too much to tell. Where the redundant link was down for it,
    /// looking again soon would not help.
    pub(super) fn observe_line_check(&mut self, found: Option<LineCheck>, in_control: bool, effects: &mut Effects) {
        // Ports that changed in between have told it to this look.
        self.attention.want();
        self.crossings.search = if found.is_none() && !in_control { Search::Again } else { Search::Idle };
        let Some(found) = found else { return };
        self.tell_crossings(&found, effects);
        let told = core::mem::take(&mut self.crossings.told);
        if self.crossings.junctions && found.unknown_rings > told.unknown_rings {
            effects.report(Event::JunctionUnknown { rings: found.unknown_rings });
        }
        self.crossings.told = told.and(found);
    }

    fn tell_crossings(&self, found: &LineCheck, effects: &mut Effects) {
        let told = &self.crossings.told;
        if found.swapped {
            if !told.swapped {
                effects.report(Event::InterfacesSwapped);
            }
            return;
        }
        let is_told = |new: &Crossing| match new.station() {
            Some(station) => told.crossings.iter().any(|old| old.station() == Some(station)),
            // Which one it is may be known from when the ring was open.
            None => !told.crossings.is_empty(),
        };
        for Crossing { subdevice, entry_port } in found.crossings.iter().filter(|new| !is_told(new)).copied() {
            let position = subdevice.map(|(station, now)| {
                let member = self.members.iter().find(|member| member.station == station);
                member.and_then(|member| member.node).map_or(now, |node| Position(node as u16))
            });
            let event = Event::LineCrossed { position, entry_port };
            match subdevice {
                Some((station, _)) => effects.report_of(event, self.occupant(station)),
                None => effects.report(event),
            }
        }
    }
}
