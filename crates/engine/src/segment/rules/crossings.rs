//! Crossed lines in operation (protocol 9.5): whenever ports of SubDevices have changed, the segment is looked at anew,
//! and each SubDevice that is entered at another port than 0 is reported, once.
//!
//! More rings behind junctions than are known are reported too: an application that asked for junction redundancy must
//! know that one of them is not watched.

use alloc::vec::Vec;

use ringcat_wire::address::Position;

use crate::event::Event;
use crate::segment::crossings::{Crossing, LineCheck, PORT_BITS, Search};
use crate::segment::disturbance::Disturbance;
use crate::segment::effect::{Effects, Task};
use crate::segment::look::Look;
use crate::segment::member::Phase;
use crate::segment::model::Segment;
use crate::segment::unassigned::UnassignedSubDevice;

impl Segment {
    /// Takes in looks at all members; where ports have changed, the segment is looked at.
    pub(in crate::segment) fn observe_ports(&mut self, looks: &[Look], effects: &mut Effects) {
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
    pub(in crate::segment) fn observe_line_check(
        &mut self,
        found: Option<LineCheck>,
        in_control: bool,
        effects: &mut Effects,
    ) {
        // This scan has cleared the requests of ports that changed in between.
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
