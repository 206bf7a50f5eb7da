//! A process data datagram within a frame: where its bytes lie, who adds what to its working counter, whose inputs are
//! new when it comes back.

use alloc::boxed::Box;
use alloc::vec::Vec;
use core::ops::Range;

use ringcat_wire::address::Wkc;
use ringcat_wire::frame::MAX_FRAME;

use super::image::{Delivery, Moment};
use crate::board::Board;
use crate::layout::{PlacedArea, PlannedDatagram};

/// Offsets of what is in no frame lie behind this.
const OUTSIDE: usize = 2 * MAX_FRAME;

/// Bytes that are copied between frame and image.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Span {
    pub frame_at: usize,
    pub image_at: usize,
    pub length: usize,
}

/// Inputs of one SubDevice within a datagram.
#[derive(Debug)]
struct Segment {
    subdevice: usize,
    span: Span,
}

/// A process data datagram.
#[derive(Debug)]
pub(crate) struct Place {
    pub wkc_at: usize,
    /// Sum over the copies received so far.
    pub wkc: Wkc,
    /// Working counter with all SubDevices.
    pub expected: Wkc,
    /// Working counter with those that take part now.
    expected_part: Wkc,
    /// All others are optional: their part is enough.
    part_suffices: bool,
    pub outputs: Span,
    pub inputs: Span,
    contributions: Box<[(usize, Wkc)]>,
    segments: Box<[Segment]>,
    /// Segments of those that take part, neighbours joined. Room for all of them is there from the beginning.
    part: Vec<Span>,
}

impl Place {
    pub fn new(datagram: &PlannedDatagram, data_at: usize) -> Place {
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
        }
    }

    /// The same place in a frame that does not carry it: nothing is copied from or to there, the working counter is zero.
    pub fn outside(&self) -> Place {
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

    /// Whether the frame does not carry it.
    pub fn is_outside(&self) -> bool {
        self.wkc_at >= OUTSIDE
    }

    /// Whether process data of a SubDevice that takes part belongs into it.
    pub fn concerns(&self, takes_part: impl Fn(usize) -> bool) -> bool {
        self.contributions.iter().any(|(subdevice, _)| takes_part(*subdevice))
    }

    /// Whether the working counter is just what it should be.
    pub fn is_complete(&self) -> bool {
        self.wkc == self.expected || (self.part_suffices && self.wkc == self.expected_part)
    }

    /// Counts a wrong working counter for each SubDevice that takes part: which of them has not answered is not known.
    pub fn count_errors(&self, board: &Board) {
        if self.wkc == self.expected || self.wkc == self.expected_part {
            return;
        }
        for (subdevice, _) in self.contributions.iter().filter(|(subdevice, _)| board.takes_part(*subdevice)) {
            board.count_wkc_error(*subdevice);
        }
    }

    /// All inputs where everybody answered; those of the ones that take part where just they answered; else nothing,
    /// because it is not known whose bytes are zeros.
    pub fn deliver(&self, bytes: &[u8], image: &mut [u8], delivery: &mut Delivery, moment: Moment) {
        if self.wkc == self.expected {
            self.inputs.deliver(bytes, image);
            delivery.all = moment;
        } else if self.wkc == self.expected_part && self.wkc.0 > 0 {
            for run in &self.part {
                run.deliver(bytes, image);
            }
            delivery.part = moment;
        }
    }

    /// Counts anew what those that take part add. Those that are optional may be missing.
    pub fn recount(&mut self, takes_part: impl Fn(usize) -> bool, optional: impl Fn(usize) -> bool) {
        let part = self.contributions.iter().filter(|(subdevice, _)| takes_part(*subdevice));
        self.expected_part = part.fold(Wkc(0), |sum, (_, wkc)| sum.plus(*wkc));
        self.part_suffices = self.contributions.iter().all(|(s, _)| takes_part(*s) || optional(*s));
        self.part.clear();
        for segment in self.segments.iter().filter(|segment| takes_part(segment.subdevice)) {
            match self.part.last_mut() {
                Some(run) if run.reaches(&segment.span) => run.length += segment.span.length,
                _ => self.part.push(segment.span),
            }
        }
    }

    /// Whether inputs of a SubDevice are in it.
    pub fn has_inputs_of(&self, subdevice: usize) -> bool {
        self.segments.iter().any(|segment| segment.subdevice == subdevice)
    }

    /// The SubDevice in whose inputs bytes of the image lie, all of them.
    pub fn whose_inputs(&self, bytes: &Range<usize>) -> Option<usize> {
        self.segments.iter().find(|segment| segment.span.holds(bytes)).map(|segment| segment.subdevice)
    }
}

impl Span {
    /// Whether bytes of the image are in it, all of them.
    pub fn holds(&self, image: &Range<usize>) -> bool {
        self.image_at <= image.start && image.end <= self.image_at + self.length
    }

    /// Whether another one begins where this one ends.
    fn reaches(&self, next: &Span) -> bool {
        self.frame_at + self.length == next.frame_at && self.image_at + self.length == next.image_at
    }

    /// From the image into the frame.
    pub fn load(&self, image: &[u8], frame: &mut [u8]) {
        copy(image, self.image_at, frame, self.frame_at, self.length);
    }

    fn deliver(&self, frame: &[u8], image: &mut [u8]) {
        copy(frame, self.frame_at, image, self.image_at, self.length);
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
