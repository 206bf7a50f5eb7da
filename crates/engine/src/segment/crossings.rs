//! Crossed lines, and the events about them.

use alloc::collections::BTreeSet;
use alloc::vec::Vec;

use ringcat_wire::address::{Position, StationAddress};

use super::cabling::Cabling;
use super::choices::Choices;
use super::subdevices::SubDevices;
use crate::junction::JunctionMode;
use crate::topology::{Finding, Topology};

/// Bits of DL_STATUS that show ports.
pub const PORT_BITS: u16 = 0xFFF0;

/// A SubDevice that frames enter at another port than 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Crossing {
    /// Its station address, and its present position; `None` if the ring shows only that there is a crossing.
    pub subdevice: Option<(StationAddress, Position)>,
    /// The port of entry, if known.
    pub entry_port: Option<u8>,
}

impl Crossing {
    pub(super) fn station(&self) -> Option<StationAddress> {
        self.subdevice.map(|(station, _)| station)
    }
}

/// Result of a scan for crossed lines.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LineCheck {
    /// Crossed SubDevices.
    pub crossings: Vec<Crossing>,
    /// All SubDevices of a ring are crossed: its interfaces are swapped.
    pub swapped: bool,
    /// SubDevices known not to be crossed; empty if the ring was closed, which does not show this.
    pub straight: Vec<StationAddress>,
    /// Rings behind junctions that are whole and unknown.
    pub unknown_rings: usize,
}

impl LineCheck {
    /// Whether it neither adds to the reported result nor withdraws from it.
    pub fn adds_nothing_to(&self, reported: &LineCheck) -> bool {
        let crossed = |check: &LineCheck| check.crossings.iter().map(Crossing::station).collect::<BTreeSet<_>>();
        crossed(self) == crossed(reported)
            && self.swapped == reported.swapped
            && self.unknown_rings <= reported.unknown_rings
    }

    /// The reported result that is still valid, combined with the new one. A closed ring withdraws nothing that an open
    /// one has shown, and an open ring shows nothing of SubDevices that do not answer.
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

/// Whether frames pass all SubDevices of a ring in the wrong direction: in a closed ring only frames of the redundant
/// link reach them, in an open ring according to the findings.
pub fn is_swapped(topology: &Topology) -> bool {
    let crossed = |finding: &&Finding| matches!(finding, Finding::CrossedLine { .. });
    let count = topology.nodes.len();
    count > 0
        && ((topology.is_assumed() && topology.main_count == 0)
            || topology.findings.iter().filter(crossed).count() == count)
}

/// State of the search for crossed lines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Search {
    /// Nothing has changed since the last scan.
    Idle,
    /// A scan is under way.
    UnderWay,
    /// The last scan had no result.
    Again,
}

/// Detects changes of ports, and reports each crossing once.
#[derive(Debug)]
pub(super) struct Crossings {
    /// Rings behind junctions are monitored.
    pub junctions: bool,
    /// Port states of members at the last scan; empty before the first one.
    pub ports: Vec<Option<u16>>,
    /// State of the search.
    pub search: Search,
    /// Reported crossings.
    pub reported: LineCheck,
}

impl Crossings {
    /// Crossings that the scan reported are not reported again.
    pub fn new(cabling: &Cabling, subdevices: &SubDevices, choices: Choices) -> Crossings {
        let topology = &cabling.topology;
        let reported = topology.findings.iter().filter_map(|finding| match *finding {
            Finding::CrossedLine { node, entry_port } => {
                let member = subdevices.members().find(|member| member.node == Some(node))?;
                let subdevice = Some((member.station, Position(node as u16)));
                Some(Crossing { subdevice, entry_port: Some(entry_port) })
            }
            _ => None,
        });
        let mut reported = LineCheck { crossings: reported.collect(), ..LineCheck::default() };
        if topology.is_assumed() {
            reported.crossings.push(Crossing { subdevice: None, entry_port: None });
        }
        reported.swapped = is_swapped(topology);
        let junctions = choices.junctions != JunctionMode::Disabled || !topology.local_rings.is_empty();
        Crossings { junctions, ports: Vec::new(), search: Search::Idle, reported }
    }

    /// A search under way has ended without a result: it begins again.
    #[cfg(feature = "standby")]
    pub fn end_search(&mut self) {
        if self.search == Search::UnderWay {
            self.search = Search::Again;
        }
    }

    pub fn reported(&self) -> &LineCheck {
        &self.reported
    }
}
