//! Crossed lines in operation (protocol 9.5): after each change of ports the segment is scanned again, and each
//! SubDevice that frames enter at another port than 0 is reported once.
//!
//! Unknown rings behind junctions are reported too: an application with junction redundancy needs the information that
//! one of them is not monitored.

use alloc::vec::Vec;

use ringcat_wire::address::Position;

use crate::event::Event;
use crate::segment::crossings::{Crossing, LineCheck, PORT_BITS, Search};
use crate::segment::disturbance::Disturbance;
use crate::segment::effect::{Effects, Task};
use crate::segment::member::Phase;
use crate::segment::model::Segment;
use crate::segment::reading::Reading;
use crate::segment::versions::Versions;

impl Segment {
    /// Processes port states of all members; after a change of ports the segment is scanned.
    pub(in crate::segment) fn observe_ports(&mut self, readings: &[Reading], effects: &mut Effects) {
        let ports = |reading: &Reading| match reading {
            Reading::Answer { dl_status, .. } => Some(dl_status.bits() & PORT_BITS),
            Reading::Unknown | Reading::Silent | Reading::Doubled => None,
        };
        let now: Vec<Option<u16>> = readings.iter().map(ports).collect();
        // A silent SubDevice that is not lost yet will answer or be lost soon.
        let phase = |index: usize| self.member(index).map_or(Phase::Absent, |member| member.phase);
        let is_open = |(index, ports): (usize, &Option<u16>)| ports.is_none() && phase(index) != Phase::Absent;
        // Clocks that are being measured need the receive times of their own frame.
        let waits = self.crossings.search == Search::UnderWay || self.slot.running() == Some(Disturbance::OpenByPort);
        // A SubDevice that may be a member, and the end of a ring, must be identified first.
        let waits = waits || !self.subdevices.unassigned().all(|it| it.is_settled());
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

    /// Result of a scan for crossed lines; `None` if the segment changed too often. If the redundant link was down for
    /// it, an early repetition is useless.
    pub(in crate::segment) fn check_line(
        &mut self,
        versions: Versions,
        found: Option<LineCheck>,
        in_control: bool,
        effects: &mut Effects,
    ) {
        let is_valid = self.are_places_valid(versions) && versions.cabling == self.cabling.version;
        // This scan has cleared the ECAT events of ports that changed before.
        self.attention.want();
        let is_useless = found.is_none() && in_control;
        let found = found.filter(|_| is_valid);
        self.crossings.search = if found.is_none() && !is_useless { Search::Again } else { Search::Idle };
        let Some(found) = found else { return };
        self.report_crossings(&found, effects);
        let reported = core::mem::take(&mut self.crossings.reported);
        if self.crossings.junctions && found.unknown_rings > reported.unknown_rings {
            effects.report(Event::JunctionUnknown { rings: found.unknown_rings });
        }
        self.crossings.reported = reported.and(found);
    }

    fn report_crossings(&self, found: &LineCheck, effects: &mut Effects) {
        let reported = &self.crossings.reported;
        if found.swapped {
            if !reported.swapped {
                effects.report(Event::InterfacesSwapped);
            }
            return;
        }
        let is_reported = |new: &Crossing| match new.station() {
            Some(station) => reported.crossings.iter().any(|old| old.station() == Some(station)),
            // The place may be known from when the ring was open.
            None => !reported.crossings.is_empty(),
        };
        for Crossing { subdevice, entry_port } in found.crossings.iter().filter(|new| !is_reported(new)).copied() {
            let position = subdevice.map(|(station, now)| {
                let member = self.members().find(|member| member.station == station);
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
