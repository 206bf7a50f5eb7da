//! The bytes of a cyclic frame as it leaves each time, built once from its plan.
//!
//! Input: the planned layout. Output: a frame with zeros as data, and the places of its datagrams.

use alloc::vec;
use alloc::vec::Vec;

use ringcat_wire::address::{LogicalAddress, RegisterAddress, StationAddress};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::{HEADER_LEN, Target};
use ringcat_wire::frame::{FrameBuilder, MAX_FRAME, MacAddress};
use ringcat_wire::register::map;

use super::clocks::{CLOCK_DATA, Places};
use super::image::InputNumber;
use super::place::Place;
use super::presence::Presence;
use crate::layout::{PlannedFrame, PlannedPresence, SUPERVISION_LEN};
use crate::ring::Identity;

/// Data of the datagram in a frame that carries nothing else.
const NOTHING_LEN: usize = 2;

/// A frame and its content.
#[derive(Debug, Default)]
pub(super) struct Template {
    /// The frame.
    pub bytes: Vec<u8>,
    /// Offsets of the headers of all datagrams.
    pub headers: Vec<usize>,
    /// Process data.
    pub places: Vec<Place>,
    /// The presence datagram.
    pub presence: Option<Presence>,
    /// Datagrams of distributed clocks.
    pub clocks: Option<Places>,
    /// Offset of the supervision datagram's header.
    pub supervision_at: Option<usize>,
}

impl Template {
    /// `first`: numbers of the first datagram and of the first inputs in the domain's image.
    pub(super) fn new(identity: &Identity, planned: &PlannedFrame, first: InputNumber) -> Template {
        let mut template = Template::default();
        let mut buffer = vec![0; MAX_FRAME];
        let mut length = 0;
        if let Some(mut builder) = FrameBuilder::ethernet(&mut buffer, MacAddress::ETHERCAT_GROUP, identity.source()) {
            template.add_process_data(&mut builder, planned, first);
            if let Some(planned) = &planned.presence {
                template.add_presence(&mut builder, planned);
            }
            if planned.clocks {
                template.add_clocks(&mut builder);
            }
            if planned.supervision {
                let target = Target::Broadcast(map::AL_STATUS);
                template.supervision_at = template.add(&mut builder, Command::Brd, target, SUPERVISION_LEN);
            }
            if template.headers.is_empty() {
                template.add(&mut builder, Command::Nop, Target::Logical(LogicalAddress(0)), NOTHING_LEN);
            }
            length = builder.finish();
        }
        buffer.truncate(length);
        template.bytes = buffer;
        template
    }

    /// Appends a datagram. Returns where its header is; `None` where it does not fit.
    fn add(
        &mut self,
        builder: &mut FrameBuilder<'_>,
        command: Command,
        target: Target,
        length: usize,
    ) -> Option<usize> {
        let header_at = builder.datagram(command, 0, target, length)? - HEADER_LEN;
        self.headers.push(header_at);
        Some(header_at)
    }

    fn add_process_data(&mut self, builder: &mut FrameBuilder<'_>, planned: &PlannedFrame, first: InputNumber) {
        let mut next = first;
        for datagram in &planned.datagrams {
            let bytes = usize::from(datagram.outputs) + usize::from(datagram.inputs);
            let target = Target::Logical(datagram.logical);
            if let Some(header_at) = self.add(builder, datagram.command, target, bytes) {
                let place = Place::new(datagram, header_at + HEADER_LEN, next);
                next = InputNumber { datagram: next.datagram + 1, part: next.part + place.parts() };
                self.places.push(place);
            }
        }
    }

    fn add_presence(&mut self, builder: &mut FrameBuilder<'_>, planned: &PlannedPresence) {
        let target = Target::Logical(planned.logical);
        if let Some(header_at) = self.add(builder, Command::Lrd, target, planned.members.len()) {
            let shown = Presence::new(planned, header_at + HEADER_LEN);
            self.places.iter_mut().for_each(|place| place.witness(&shown));
            self.presence = Some(shown);
        }
    }

    fn add_clocks(&mut self, builder: &mut FrameBuilder<'_>) {
        let unset = Target::Station(StationAddress(0), RegisterAddress(0));
        let spread = Target::Broadcast(map::DC_SYSTEM_TIME_DIFFERENCE);
        let datagrams = [(Command::Frmw, unset), (Command::Fpwr, unset), (Command::Brd, spread)];
        let at = datagrams.map(|(command, target)| builder.datagram(command, 0, target, CLOCK_DATA));
        if let [Some(sync), Some(steer), Some(spread)] = at {
            let header = [sync, steer, spread].map(|data_at| data_at - HEADER_LEN);
            self.headers.extend(header);
            self.clocks = Some(Places { sync_at: header[0], steer_at: header[1], spread_at: header[2] });
        }
    }
}
