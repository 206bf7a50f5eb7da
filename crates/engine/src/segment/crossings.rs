//! Crossed lines, and the events about them.

use alloc::collections::BTreeSet;
use alloc::vec::Vec;

use ringcat_wire::address::{Position, StationAddress};

use super::cabling::Cabling;
use super::choices::Choices;
use super::member::Member;
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
    pub(super) fn station(&self) -> Option<StationAddress> {
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
    /// Whether it adds nothing to what was reported of a segment and takes nothing back.
    pub fn says_the_same_as(&self, told: &LineCheck) -> bool {
        let crossed = |check: &LineCheck| check.crossings.iter().map(Crossing::station).collect::<BTreeSet<_>>();
        crossed(self) == crossed(told) && self.swapped == told.swapped && self.unknown_rings <= told.unknown_rings
    }

    /// What was reported and still holds, with what is new. A closed ring takes nothing back that an open one has
    /// shown, and an open one shows nothing of those that do not answer.
    pub(super) fn and(mut self, found: LineCheck) -> LineCheck {
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
pub(super) enum Search {
    /// Nothing has changed since the last look at the segment.
    Idle,
    /// The segment is being looked at.
    UnderWay,
    /// The last look has come to nothing.
    Again,
}

/// Notes changes of ports, and has each crossing reported once.
#[derive(Debug)]
pub(super) struct Crossings {
    /// Rings behind junctions are watched.
    pub junctions: bool,
    /// What members said about their ports when the segment was looked at last; empty before the first time.
    pub ports: Vec<Option<u16>>,
    /// How far the search is.
    pub search: Search,
    /// Reported crossings.
    pub told: LineCheck,
}

impl Crossings {
    /// Crossings that the scan reported are not reported again.
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
