//! A frame of a domain and its flights: load, depart, receive the copies, judge, deliver or give up.
//!
//! A domain's frame is out at most once, so its bytes are built once: a flight changes the frame id, the Idx bytes and
//! the outputs. Reads leave as zeros and working counters as zero, because what comes back is never written here.
//! While no SubDevice could answer its process data, a frame leaves without it: see [`CyclicFrame::vacant`].

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

use ringcat_wire::address::{LogicalAddress, RegisterAddress, StationAddress, Wkc};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::{CIRCULATING, HEADER_LEN, OVERHEAD, Target};
use ringcat_wire::frame::{FrameBuilder, MAX_FRAME, MacAddress};
use ringcat_wire::register::map;

use super::clocks::{CLOCK_DATA, Places, Seen};
use crate::board::Supervision;
use crate::layout::{PlacedArea, PlannedDatagram, PlannedFrame, SUPERVISION_LEN};
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

/// Bytes that are copied between frame and image.
#[derive(Clone, Copy, Debug)]
struct Span {
    frame_at: usize,
    image_at: usize,
    length: usize,
}

impl Span {
    fn holds(&self, image: &Range<usize>) -> bool {
        self.image_at <= image.start && image.end <= self.image_at + self.length
    }
}

/// Inputs of one SubDevice within a datagram.
#[derive(Debug)]
struct Segment {
    subdevice: usize,
    span: Span,
}

/// A process data datagram.
#[derive(Debug)]
struct Place {
    wkc_at: usize,
    /// Sum over the copies received so far.
    wkc: Wkc,
    /// Working counter with all SubDevices.
    expected: Wkc,
    /// Working counter with those that take part now.
    expected_part: Wkc,
    /// All others are optional: their part is enough.
    part_suffices: bool,
    outputs: Span,
    inputs: Span,
    contributions: Box<[(usize, Wkc)]>,
    segments: Box<[Segment]>,
    /// Segments of those that take part, neighbours joined. Room for all of them is there from the beginning.
    part: Vec<Span>,
    /// Cycle of the last delivery of all inputs, plus one.
    delivered_all: u64,
    /// Cycle of the last delivery of those that took part, plus one.
    delivered_part: u64,
}

/// A datagram's first eight bytes, as far as no controller changes them (facts 1.5): command, Idx, length, M bit.
#[derive(Debug)]
struct Header {
    at: usize,
    sent: u64,
}

/// Address and C bit are left out of [`Header`].
const HEADER_MASK: u64 = 0x0000_0000_0000_FFFF | !(CIRCULATING as u64) << 48;

/// Data of the datagram of a frame that has nothing else to carry.
const NOTHING_LEN: usize = 2;
/// Offsets of what is in no frame lie behind this.
const OUTSIDE: usize = 2 * MAX_FRAME;

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
    stage: Stage,
    sequence: Sequence,
    /// Idx of all datagrams.
    index: u8,
    arrivals: Arrivals,
    deadline: Instant,
    /// Sum of the working counters of process data over the copies received so far.
    wkc: u32,
    /// Every process data datagram has just what it should.
    complete: bool,
    seen: Supervision,
    /// Offset of the supervision datagram's header.
    supervision_at: Option<usize>,
    /// Datagrams of distributed clocks.
    clocks: Option<Places>,
    clocks_seen: Seen,
    headers: Box<[Header]>,
    places: Box<[Place]>,
    tx: Box<[u8]>,
    /// First copy of a flight that was not complete by itself.
    merged: Box<[u8]>,
}

impl CyclicFrame {
    pub(crate) fn new(identity: &Identity, domain: usize, planned: &PlannedFrame) -> CyclicFrame {
        let mut buffer = vec![0; MAX_FRAME];
        let (mut places, mut headers_at, mut supervision_at, mut clocks) = (Vec::new(), Vec::new(), None, None);
        let mut length = 0;
        if let Some(mut builder) = FrameBuilder::ethernet(&mut buffer, MacAddress::ETHERCAT_GROUP, identity.source()) {
            for datagram in &planned.datagrams {
                let bytes = usize::from(datagram.outputs) + usize::from(datagram.inputs);
                let target = Target::Logical(datagram.logical);
                if let Some(data_at) = builder.datagram(datagram.command, 0, target, bytes) {
                    headers_at.push(data_at - HEADER_LEN);
                    places.push(Place::new(datagram, data_at));
                }
            }
            if planned.clocks {
                let nobody = Target::Station(StationAddress(0), RegisterAddress(0));
                let spread = Target::Broadcast(map::DC_SYSTEM_TIME_DIFFERENCE);
                let datagrams = [(Command::Frmw, nobody), (Command::Fpwr, nobody), (Command::Brd, spread)];
                let at = datagrams.map(|(command, target)| builder.datagram(command, 0, target, CLOCK_DATA));
                if let [Some(sync), Some(steer), Some(spread)] = at {
                    let header = [sync, steer, spread].map(|data_at| data_at - HEADER_LEN);
                    headers_at.extend(header);
                    clocks = Some(Places { sync_at: header[0], steer_at: header[1], spread_at: header[2] });
                }
            }
            if planned.supervision {
                let target = Target::Broadcast(map::AL_STATUS);
                if let Some(data_at) = builder.datagram(Command::Brd, 0, target, SUPERVISION_LEN) {
                    headers_at.push(data_at - HEADER_LEN);
                    supervision_at = Some(data_at - HEADER_LEN);
                }
            }
            if headers_at.is_empty()
                && let Some(data_at) =
                    builder.datagram(Command::Nop, 0, Target::Logical(LogicalAddress(0)), NOTHING_LEN)
            {
                headers_at.push(data_at - HEADER_LEN);
            }
            length = builder.finish();
        }
        buffer.truncate(length);
        CyclicFrame {
            domain,
            stage: Stage::Idle,
            sequence: Sequence::default(),
            index: 0,
            arrivals: Arrivals::default(),
            deadline: Instant::NEVER,
            wkc: 0,
            complete: false,
            seen: Supervision::default(),
            supervision_at,
            clocks,
            clocks_seen: Seen::default(),
            headers: headers_at.into_iter().map(|at| Header { at, sent: header_at(&buffer, at) }).collect(),
            places: places.into_boxed_slice(),
            merged: vec![0; length].into_boxed_slice(),
            tx: buffer.into_boxed_slice(),
        }
    }

    /// A frame that takes the place of this one while no SubDevice of it has its FMMUs: without process data, which
    /// nobody could answer. Its working counters are zero, and it answers for the same inputs and outputs.
    pub(crate) fn vacant(&self, identity: &Identity, planned: &PlannedFrame) -> CyclicFrame {
        let bare = PlannedFrame { datagrams: Vec::new(), ..*planned };
        let places = self.places.iter().map(Place::outside).collect();
        CyclicFrame { places, ..CyclicFrame::new(identity, self.domain, &bare) }
    }

    /// Whether it leaves without its process data.
    pub(crate) fn is_vacant(&self) -> bool {
        self.places.iter().any(|place| place.wkc_at >= OUTSIDE)
    }

    /// Whether process data of a SubDevice that takes part belongs into the frame.
    pub(crate) fn concerns(&self, takes_part: impl Fn(usize) -> bool) -> bool {
        self.places.iter().flat_map(|place| &place.contributions).any(|(subdevice, _)| takes_part(*subdevice))
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
        self.wkc
    }

    /// Whether every process data datagram of the flight has just the working counter it should have: a sum over
    /// datagrams could hide one that is short behind one that is over.
    pub(crate) fn is_complete(&self) -> bool {
        self.complete
    }

    /// What the supervision datagram of this flight saw, if it has one and anything came back.
    pub(crate) fn supervision(&self) -> Option<Supervision> {
        let seen = Supervision { returned: self.arrivals.returned != 0, ..self.seen };
        (self.supervision_at.is_some() && self.arrivals.arrived != 0).then_some(seen)
    }

    /// Copies the outputs in and forgets the flight before.
    pub(crate) fn load(&mut self, image: &[u8]) {
        for place in &mut self.places {
            place.outputs.load(image, &mut self.tx);
            place.wkc = Wkc(0);
        }
        self.wkc = 0;
        self.complete = self.places.is_empty();
        self.arrivals = Arrivals::default();
        self.seen = Supervision::default();
        self.clocks_seen = Seen::default();
    }

    /// Where the datagrams of distributed clocks are, if there are any; the frame leaves now.
    pub(crate) fn clocks_leave(&mut self, now: Instant) -> Option<Places> {
        self.clocks_seen.sent_at = now;
        self.clocks
    }

    /// What they brought back, if there are any.
    pub(crate) fn clocks_seen(&self) -> Option<&Seen> {
        self.clocks.map(|_| &self.clocks_seen)
    }

    /// Starts a flight of what was loaded; returns the bytes of the main copy.
    pub(crate) fn depart(&mut self, identity: &Identity, sequence: Sequence, deadline: Instant) -> &mut [u8] {
        let index = sequence.index(Class::Cyclic);
        if self.index != index {
            self.write_index(index);
        }
        identity.restamp(&mut self.tx, sequence);
        self.sequence = sequence;
        self.stage = Stage::Waiting;
        self.deadline = deadline;
        &mut self.tx
    }

    /// Changes the Idx of all datagrams, which is due once in 256 frames.
    fn write_index(&mut self, index: u8) {
        for header in &mut self.headers {
            self.tx[header.at + 1] = index;
            header.sent = header_at(&self.tx, header.at);
        }
        self.index = index;
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
        let first = self.arrivals.arrived == copy.sent_on.bit();
        let finished = self.arrivals.arrived & all_links == all_links;
        let complete = self.count(copy.sent_on, bytes);
        if self.stage == Stage::Waiting {
            if first && !(complete || finished) {
                self.merged.copy_from_slice(&bytes[..self.tx.len()]);
                return Step::Waiting;
            }
            if first {
                deliver(&mut self.places, bytes, image, cycle);
            } else {
                self.merge(bytes);
                deliver(&mut self.places, &self.merged, image, cycle);
            }
            self.stage = Stage::Delivered;
        } else if !complete {
            self.withdraw(cycle);
        }
        if finished { Step::Finished } else { Step::Waiting }
    }

    /// The second copy met somebody whom the first one had met: the ring closed meanwhile. What was delivered is not new
    /// any more.
    #[cold]
    fn withdraw(&mut self, cycle: u64) {
        for place in self.places.iter_mut().filter(|place| place.wkc.0 > place.expected.0) {
            for delivered in [&mut place.delivered_all, &mut place.delivered_part] {
                *delivered = (*delivered).min(cycle);
            }
        }
    }

    fn is_what_was_sent(&self, bytes: &[u8]) -> bool {
        bytes.len() >= self.tx.len() && self.headers.iter().all(|header| header_at(bytes, header.at) == header.sent)
    }

    /// Adds the working counters of a copy; true where every process data datagram has just what it should.
    fn count(&mut self, sent_on: Link, bytes: &[u8]) -> bool {
        let mut complete = true;
        for place in &mut self.places {
            let wkc = u16_at(bytes, place.wkc_at);
            place.wkc = place.wkc.plus(Wkc(wkc));
            self.wkc += u32::from(wkc);
            complete &= place.wkc == place.expected || (place.part_suffices && place.wkc == place.expected_part);
        }
        self.complete = complete;
        if let Some(clocks) = self.clocks {
            clocks.read(&mut self.clocks_seen, sent_on, bytes);
        }
        if let Some(at) = self.supervision_at
            && let Some(datagram) = bytes[at..].first_chunk::<{ OVERHEAD + SUPERVISION_LEN }>()
        {
            let [.., irq_low, irq_high, al_low, _, wkc_low, wkc_high] = *datagram;
            self.seen.irq |= u16::from_le_bytes([irq_low, irq_high]);
            self.seen.al_status[sent_on.index()] = al_low;
            let wkc = Wkc(u16::from_le_bytes([wkc_low, wkc_high]));
            match sent_on {
                Link::Main => self.seen.main = wkc,
                Link::Redundant => self.seen.redundant = wkc,
            }
        }
        complete
    }

    /// ORs the inputs of the second copy into the first (facts 9.3: sent as zeros, every bit belongs to one SubDevice).
    fn merge(&mut self, bytes: &[u8]) {
        for place in &self.places {
            let inputs = place.inputs.frame_at..place.inputs.frame_at + place.inputs.length;
            if let (Some(merged), Some(bytes)) = (self.merged.get_mut(inputs.clone()), bytes.get(inputs)) {
                or_into(merged, bytes);
            }
        }
    }

    /// The deadline is over: delivers what is there. True where nothing at all came back.
    pub(crate) fn give_up(&mut self, image: &mut [u8], cycle: u64) -> bool {
        if self.arrivals.arrived != 0 {
            deliver(&mut self.places, &self.merged, image, cycle);
        }
        self.stage = Stage::Delivered;
        self.arrivals.arrived == 0
    }

    /// Counts anew what those that take part add. Those that are optional may be missing.
    pub(crate) fn recount(&mut self, takes_part: impl Fn(usize) -> bool, optional: impl Fn(usize) -> bool) {
        for place in &mut self.places {
            let part = place.contributions.iter().filter(|(subdevice, _)| takes_part(*subdevice));
            place.expected_part = part.fold(Wkc(0), |sum, (_, wkc)| sum.plus(*wkc));
            place.part_suffices = place.contributions.iter().all(|(s, _)| takes_part(*s) || optional(*s));
            place.part.clear();
            for segment in place.segments.iter().filter(|segment| takes_part(segment.subdevice)) {
                match place.part.last_mut() {
                    Some(run) if run.reaches(&segment.span) => run.length += segment.span.length,
                    _ => place.part.push(segment.span),
                }
            }
        }
    }

    /// The datagrams with inputs of a SubDevice.
    pub(crate) fn places_of(&self, subdevice: usize) -> impl Iterator<Item = usize> {
        let has = move |place: &Place| place.segments.iter().any(|segment| segment.subdevice == subdevice);
        self.places.iter().enumerate().filter(move |(_, place)| has(place)).map(|(number, _)| number)
    }

    /// As [`CyclicFrame::delivered`], of a datagram.
    pub(crate) fn delivered_at(&self, place: usize) -> (u64, u64) {
        self.places.get(place).map_or((0, 0), |place| (place.delivered_all, place.delivered_part))
    }

    /// The SubDevice in whose inputs bytes of the image lie, all of them.
    pub(crate) fn whose_inputs(&self, bytes: Range<usize>) -> Option<usize> {
        let mut segments = self.places.iter().flat_map(|place| &place.segments);
        segments.find(|segment| segment.span.holds(&bytes)).map(|segment| segment.subdevice)
    }

    /// Whether bytes of the image lie in outputs, all of them.
    pub(crate) fn has_outputs(&self, bytes: Range<usize>) -> bool {
        self.places.iter().any(|place| place.outputs.holds(&bytes))
    }

    /// Cycles (plus one) in which all inputs that include this SubDevice's, and those of the ones taking part, were
    /// last delivered; `None` where the SubDevice has no inputs in this frame.
    pub(crate) fn delivered(&self, subdevice: usize) -> Option<(u64, u64)> {
        let here = |place: &&Place| place.segments.iter().any(|segment| segment.subdevice == subdevice);
        self.places.iter().find(here).map(|place| (place.delivered_all, place.delivered_part))
    }
}

impl Place {
    fn new(datagram: &PlannedDatagram, data_at: usize) -> Place {
        let (outputs, inputs) = (usize::from(datagram.outputs), usize::from(datagram.inputs));
        let start = datagram.image_offset as usize;
        let span = |image_at: usize, length| Span { frame_at: data_at + image_at - start, image_at, length };
        let segment = |placed: &PlacedArea| Segment {
            subdevice: placed.area.subdevice,
            span: span(placed.image_offset as usize, usize::from(placed.area.length)),
        };
        Place {
            wkc_at: data_at + outputs + inputs,
            wkc: Wkc(0),
            expected: datagram.contributions.iter().fold(Wkc(0), |sum, (_, wkc)| sum.plus(*wkc)),
            expected_part: Wkc(0),
            part_suffices: false,
            outputs: span(start, outputs),
            inputs: span(start + outputs, inputs),
            contributions: datagram.contributions.iter().copied().collect(),
            part: Vec::with_capacity(datagram.input_areas.len()),
            segments: datagram.input_areas.iter().map(segment).collect(),
            delivered_all: 0,
            delivered_part: 0,
        }
    }

    /// The same place in a frame that does not carry it: nothing is copied from or to there, the working counter is zero.
    fn outside(&self) -> Place {
        let span = |span: Span| Span { frame_at: span.frame_at + OUTSIDE, ..span };
        let segment = |segment: &Segment| Segment { span: span(segment.span), ..*segment };
        Place {
            wkc_at: self.wkc_at + OUTSIDE,
            outputs: span(self.outputs),
            inputs: span(self.inputs),
            contributions: self.contributions.clone(),
            part: Vec::with_capacity(self.part.capacity()),
            segments: self.segments.iter().map(segment).collect(),
            ..*self
        }
    }

    /// All inputs where everybody answered; those of the ones that take part where just they answered; else nothing,
    /// because it is not known whose bytes are zeros.
    fn deliver(&mut self, bytes: &[u8], image: &mut [u8], cycle: u64) {
        if self.inputs.length == 0 {
            return;
        }
        if self.wkc == self.expected {
            self.inputs.deliver(bytes, image);
            self.delivered_all = cycle + 1;
        } else if self.wkc == self.expected_part && self.wkc.0 > 0 {
            for run in &self.part {
                run.deliver(bytes, image);
            }
            self.delivered_part = cycle + 1;
        }
    }
}

impl Span {
    /// Whether another one begins where this one ends.
    fn reaches(&self, next: &Span) -> bool {
        self.frame_at + self.length == next.frame_at && self.image_at + self.length == next.image_at
    }

    fn load(&self, image: &[u8], frame: &mut [u8]) {
        copy(image, self.image_at, frame, self.frame_at, self.length);
    }

    fn deliver(&self, frame: &[u8], image: &mut [u8]) {
        copy(frame, self.frame_at, image, self.image_at, self.length);
    }
}

fn deliver(places: &mut [Place], bytes: &[u8], image: &mut [u8], cycle: u64) {
    for place in places {
        place.deliver(bytes, image, cycle);
    }
}

fn copy(from: &[u8], from_at: usize, to: &mut [u8], to_at: usize, length: usize) {
    if length > 0
        && let Some(to) = to.get_mut(to_at..to_at + length)
        && let Some(from) = from.get(from_at..from_at + length)
    {
        to.copy_from_slice(from);
    }
}

/// What [`Header`] keeps of the datagram there; of bytes beyond the end, zero.
fn header_at(bytes: &[u8], at: usize) -> u64 {
    bytes.get(at..).and_then(<[u8]>::first_chunk).map_or(0, |head| u64::from_le_bytes(*head)) & HEADER_MASK
}

/// Two bytes; beyond the end, zero.
fn u16_at(bytes: &[u8], at: usize) -> u16 {
    bytes.get(at..).and_then(<[u8]>::first_chunk).map_or(0, |bytes| u16::from_le_bytes(*bytes))
}
