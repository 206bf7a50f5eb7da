//! A frame of a domain and its flights: load, depart, receive the copies, judge, deliver or give up.
//!
//! A domain's frame is out at most once, so its bytes are built once: a flight changes the frame id, the Idx bytes and
//! the outputs. Reads leave as zeros and working counters as zero, because what comes back is never written here.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use ringcat_wire::address::Wkc;
use ringcat_wire::command::Command;
use ringcat_wire::datagram::{CIRCULATING, HEADER_LEN, Target};
use ringcat_wire::frame::{FrameBuilder, MAX_FRAME, MacAddress};
use ringcat_wire::register::map;

use super::layout::{PlannedDatagram, PlannedFrame, SUPERVISION_LEN};
use crate::board::Supervision;
use crate::link::Link;
use crate::ring::merge::or_into;
use crate::ring::{Arrivals, Class, FrameCopy, Identity, Sequence};
use crate::time::Instant;

/// What a received copy did to its flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Step {
    /// Another copy is still expected.
    Waiting,
    /// All copies are in.
    Finished,
    /// Not the flight that is out, or a copy that was there.
    Late,
    /// Not what was sent.
    Corrupt,
}

/// Input bytes of one SubDevice within a datagram.
#[derive(Debug)]
struct Segment {
    subdevice: usize,
    data_at: usize,
    image_at: usize,
    length: usize,
}

/// What a datagram is for.
#[derive(Debug)]
enum Purpose {
    ProcessData {
        /// Outputs: offset in the image, bytes.
        outputs: (usize, usize),
        /// Inputs: offset in the image, bytes.
        inputs: (usize, usize),
        contributions: Box<[(usize, Wkc)]>,
        segments: Box<[Segment]>,
        /// Cycle of the last delivery of all inputs, plus one.
        delivered_all: u64,
        /// Cycle of the last delivery of those that took part, plus one.
        delivered_part: u64,
    },
    Supervision,
}

/// A datagram of the frame.
#[derive(Debug)]
struct Place {
    header_at: usize,
    length: usize,
    purpose: Purpose,
    /// Working counter with all SubDevices.
    expected: Wkc,
    /// Working counter with those that take part now.
    expected_part: Wkc,
    /// Sum over the copies received so far.
    wkc: Wkc,
    takes_part: Box<[bool]>,
}

/// How far a flight is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// Nothing is out.
    Idle,
    /// Out, not delivered.
    Waiting,
    /// Complete and delivered, the second copy is not in.
    Delivered,
}

#[derive(Debug)]
pub(crate) struct CyclicFrame {
    domain: usize,
    tx: Box<[u8]>,
    /// First copy of a flight that was not complete by itself.
    merged: Box<[u8]>,
    places: Box<[Place]>,
    sequence: Sequence,
    stage: Stage,
    arrivals: Arrivals,
    deadline: Instant,
    seen: Supervision,
}

impl CyclicFrame {
    pub(crate) fn new(identity: &Identity, domain: usize, planned: &PlannedFrame) -> CyclicFrame {
        let mut buffer = vec![0; MAX_FRAME];
        let mut places = Vec::new();
        let mut length = 0;
        if let Some(mut builder) = FrameBuilder::ethernet(&mut buffer, MacAddress::ETHERCAT_GROUP, identity.source()) {
            for datagram in &planned.datagrams {
                let bytes = usize::from(datagram.outputs) + usize::from(datagram.inputs);
                let target = Target::Logical(datagram.logical);
                if let Some(data_at) = builder.datagram(datagram.command, 0, target, bytes) {
                    places.push(Place::process_data(datagram, data_at - HEADER_LEN));
                }
            }
            if planned.supervision {
                let target = Target::Broadcast(map::AL_STATUS);
                if let Some(data_at) = builder.datagram(Command::Brd, 0, target, SUPERVISION_LEN) {
                    places.push(Place::supervision(data_at - HEADER_LEN));
                }
            }
            length = builder.finish();
        }
        buffer.truncate(length);
        CyclicFrame {
            domain,
            merged: vec![0; length].into_boxed_slice(),
            tx: buffer.into_boxed_slice(),
            places: places.into_boxed_slice(),
            sequence: Sequence::default(),
            stage: Stage::Idle,
            arrivals: Arrivals::default(),
            deadline: Instant::NEVER,
            seen: Supervision::default(),
        }
    }

    pub(crate) fn domain(&self) -> usize {
        self.domain
    }

    pub(crate) fn is_waiting(&self) -> bool {
        self.stage == Stage::Waiting
    }

    pub(crate) fn is_open(&self) -> bool {
        self.stage != Stage::Idle
    }

    pub(crate) fn overdue(&self, now: Instant) -> bool {
        now >= self.deadline
    }

    pub(crate) fn arrivals(&self) -> Arrivals {
        self.arrivals
    }

    pub(crate) fn close(&mut self) {
        self.stage = Stage::Idle;
    }

    /// Sum of the working counters of process data.
    pub(crate) fn wkc(&self) -> u32 {
        let data = self.places.iter().filter(|place| matches!(place.purpose, Purpose::ProcessData { .. }));
        data.map(|place| u32::from(place.wkc.0)).sum()
    }

    /// What the supervision datagram of this flight saw, if it has one and anything came back.
    pub(crate) fn supervision(&self) -> Option<Supervision> {
        let last = self.places.last()?;
        (matches!(last.purpose, Purpose::Supervision) && self.arrivals.arrived != 0).then_some(self.seen)
    }

    /// Copies the outputs in.
    pub(crate) fn load(&mut self, image: &[u8]) {
        for place in &self.places {
            let Purpose::ProcessData { outputs: (image_at, length), .. } = place.purpose else { continue };
            let data_at = place.header_at + HEADER_LEN;
            if let (Some(to), Some(from)) =
                (self.tx.get_mut(data_at..data_at + length), image.get(image_at..image_at + length))
            {
                to.copy_from_slice(from);
            }
        }
    }

    /// Starts a flight; returns the bytes of the main copy.
    pub(crate) fn depart(&mut self, identity: &Identity, sequence: Sequence, deadline: Instant) -> &mut [u8] {
        let index = sequence.index(Class::Cyclic);
        for place in &mut self.places {
            self.tx[place.header_at + 1] = index;
            place.wkc = Wkc(0);
        }
        identity.restamp(&mut self.tx, sequence);
        self.sequence = sequence;
        self.stage = Stage::Waiting;
        self.arrivals = Arrivals::default();
        self.deadline = deadline;
        self.seen = Supervision::default();
        &mut self.tx
    }

    /// Takes in a copy. Delivers into the image as soon as the flight is complete.
    pub(crate) fn receive(
        &mut self,
        copy: FrameCopy,
        arrived_on: Link,
        bytes: &[u8],
        all_links: u8,
        image: &mut [u8],
        cycle: u64,
    ) -> Step {
        if self.stage == Stage::Idle || self.sequence != copy.sequence {
            return Step::Late;
        }
        if !self.is_what_was_sent(bytes) {
            return Step::Corrupt;
        }
        if !self.arrivals.note(copy.sent_on, arrived_on) {
            return Step::Late;
        }
        let first = self.arrivals.arrived.count_ones() == 1;
        let finished = self.arrivals.arrived & all_links == all_links;
        let complete = self.count(copy.sent_on, bytes);
        if self.stage == Stage::Waiting {
            if first && (complete || finished) {
                self.deliver(image, cycle, Source::Received(bytes));
            } else if first {
                self.merged.copy_from_slice(&bytes[..self.tx.len()]);
            } else {
                self.merge(bytes);
                self.deliver(image, cycle, Source::Merged);
            }
            if complete || finished {
                self.stage = Stage::Delivered;
            }
        }
        if finished { Step::Finished } else { Step::Waiting }
    }

    /// Everything controllers never change is as sent (facts 1.5): command, Idx, length, M bit of every datagram.
    fn is_what_was_sent(&self, bytes: &[u8]) -> bool {
        if bytes.len() < self.tx.len() {
            return false;
        }
        self.places.iter().all(|place| {
            let at = place.header_at;
            let (sent, got) = (&self.tx[at..at + 8], &bytes[at..at + 8]);
            let circulating = (CIRCULATING >> 8) as u8;
            sent[0] == got[0] && sent[1] == got[1] && sent[6] == got[6] && sent[7] == got[7] & !circulating
        })
    }

    /// Adds the working counters of a copy; true where every process data datagram has just what it should.
    fn count(&mut self, sent_on: Link, bytes: &[u8]) -> bool {
        let mut complete = true;
        for place in &mut self.places {
            let data_at = place.header_at + HEADER_LEN;
            let at = data_at + place.length;
            let wkc = Wkc(u16::from_le_bytes([bytes[at], bytes[at + 1]]));
            place.wkc = place.wkc.plus(wkc);
            match place.purpose {
                Purpose::ProcessData { .. } => complete &= place.wkc == place.expected,
                Purpose::Supervision => {
                    self.seen.al_status |= u16::from_le_bytes([bytes[data_at], bytes[data_at + 1]]);
                    self.seen.irq |= u16::from_le_bytes([bytes[data_at - 2], bytes[data_at - 1]]);
                    match sent_on {
                        Link::Main => self.seen.main = wkc,
                        Link::Redundant => self.seen.redundant = wkc,
                    }
                }
            }
        }
        complete
    }

    /// ORs the inputs of the second copy into the first (facts 9.3: sent as zeros, every bit belongs to one SubDevice).
    fn merge(&mut self, bytes: &[u8]) {
        for place in &self.places {
            let Purpose::ProcessData { outputs: (_, outputs), inputs: (_, inputs), .. } = place.purpose else {
                continue;
            };
            let at = place.header_at + HEADER_LEN + outputs;
            or_into(&mut self.merged[at..at + inputs], &bytes[at..at + inputs]);
        }
    }

    /// The deadline is over: delivers what is there. True where nothing at all came back.
    pub(crate) fn give_up(&mut self, image: &mut [u8], cycle: u64) -> bool {
        if self.arrivals.arrived != 0 {
            self.deliver(image, cycle, Source::Merged);
        }
        self.stage = Stage::Delivered;
        self.arrivals.arrived == 0
    }

    fn deliver(&mut self, image: &mut [u8], cycle: u64, source: Source<'_>) {
        let bytes = match source {
            Source::Received(bytes) => bytes,
            Source::Merged => &self.merged,
        };
        for place in &mut self.places {
            place.deliver(bytes, image, cycle);
        }
    }

    /// Counts anew what those that take part add.
    pub(crate) fn recount(&mut self, takes_part: impl Fn(usize) -> bool) {
        for place in &mut self.places {
            let Purpose::ProcessData { contributions, segments, .. } = &place.purpose else { continue };
            let part = contributions.iter().filter(|(subdevice, _)| takes_part(*subdevice));
            place.expected_part = part.fold(Wkc(0), |sum, (_, wkc)| sum.plus(*wkc));
            for (flag, segment) in place.takes_part.iter_mut().zip(segments) {
                *flag = takes_part(segment.subdevice);
            }
        }
    }

    /// Cycles (plus one) in which all inputs that include this SubDevice's, and those of the ones taking part, were
    /// last delivered; `None` where the SubDevice has no inputs in this frame.
    pub(crate) fn delivered(&self, subdevice: usize) -> Option<(u64, u64)> {
        self.places.iter().find_map(|place| {
            let Purpose::ProcessData { segments, delivered_all, delivered_part, .. } = &place.purpose else {
                return None;
            };
            let here = segments.iter().any(|segment| segment.subdevice == subdevice);
            here.then_some((*delivered_all, *delivered_part))
        })
    }
}

enum Source<'a> {
    Received(&'a [u8]),
    Merged,
}

impl Place {
    fn process_data(datagram: &PlannedDatagram, header_at: usize) -> Place {
        let outputs = usize::from(datagram.outputs);
        let inputs = usize::from(datagram.inputs);
        let image_at = datagram.image_offset as usize;
        let data_at = header_at + HEADER_LEN;
        let segments: Box<[Segment]> = datagram
            .input_areas
            .iter()
            .map(|placed| Segment {
                subdevice: placed.area.subdevice,
                data_at: data_at + placed.image_offset as usize - image_at,
                image_at: placed.image_offset as usize,
                length: usize::from(placed.area.length),
            })
            .collect();
        let contributions: Box<[(usize, Wkc)]> = datagram.contributions.iter().copied().collect();
        Place {
            header_at,
            length: outputs + inputs,
            expected: contributions.iter().fold(Wkc(0), |sum, (_, wkc)| sum.plus(*wkc)),
            expected_part: Wkc(0),
            wkc: Wkc(0),
            takes_part: vec![false; segments.len()].into_boxed_slice(),
            purpose: Purpose::ProcessData {
                outputs: (image_at, outputs),
                inputs: (image_at + outputs, inputs),
                contributions,
                segments,
                delivered_all: 0,
                delivered_part: 0,
            },
        }
    }

    fn supervision(header_at: usize) -> Place {
        Place {
            header_at,
            length: SUPERVISION_LEN,
            purpose: Purpose::Supervision,
            expected: Wkc(0),
            expected_part: Wkc(0),
            wkc: Wkc(0),
            takes_part: Box::default(),
        }
    }

    /// All inputs where everybody answered; those of the ones that take part where just they answered; else nothing,
    /// because it is not known whose bytes are zeros.
    fn deliver(&mut self, bytes: &[u8], image: &mut [u8], cycle: u64) {
        let Purpose::ProcessData { outputs, inputs, segments, delivered_all, delivered_part, .. } = &mut self.purpose
        else {
            return;
        };
        let (image_at, length) = *inputs;
        if length == 0 {
            return;
        }
        if self.wkc == self.expected {
            let at = self.header_at + HEADER_LEN + outputs.1;
            copy(image, image_at, bytes, at, length);
            *delivered_all = cycle + 1;
        } else if self.wkc == self.expected_part && self.wkc.0 > 0 {
            for (segment, takes_part) in segments.iter().zip(&self.takes_part) {
                if *takes_part {
                    copy(image, segment.image_at, bytes, segment.data_at, segment.length);
                }
            }
            *delivered_part = cycle + 1;
        }
    }
}

fn copy(image: &mut [u8], image_at: usize, bytes: &[u8], at: usize, length: usize) {
    if let (Some(to), Some(from)) = (image.get_mut(image_at..image_at + length), bytes.get(at..at + length)) {
        to.copy_from_slice(from);
    }
}
