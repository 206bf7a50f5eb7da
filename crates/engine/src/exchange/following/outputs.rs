//! Outputs that the INACTIVE takes from the frames of the ACTIVE: controllers do not alter written data (protocol
//! FR-05).
//!
//! Two states of them: the latest ones, datagram by datagram, which a takeover goes on with, so that no output goes
//! back to an older value; and those of a cycle that was received as a whole, which the application gets.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use ringcat_wire::command::Command;
use ringcat_wire::datagram::{self, HEADER_LEN, Header};

use crate::layout::Layout;
use crate::order::InOrder;
use crate::ring::{Sequence, identity::DATAGRAMS_AT};

/// Adjacent bytes of outputs.
#[derive(Clone, Copy, Debug)]
struct Run {
    data_at: usize,
    image_at: usize,
    length: usize,
}

/// A datagram with outputs.
#[derive(Debug)]
struct Place {
    logical: u32,
    domain: usize,
    runs: Box<[Run]>,
    /// The frame that brought the latest outputs.
    latest: Option<Sequence>,
}

/// Outputs that were seen.
#[derive(Debug)]
pub(crate) struct OutputsSeen {
    /// In the order of their logical addresses.
    places: Box<[Place]>,
    /// By domain, of the length of its image.
    latest: Box<[Box<[u8]>]>,
    whole: Box<[Box<[u8]>]>,
    /// The last frames that were received, by their ids.
    received: Box<[Option<Sequence>; 256]>,
    /// First frame of the cycle of `whole`.
    whole_of: Option<Sequence>,
    /// Anything has arrived since [`OutputsSeen::forget`].
    has_any: bool,
}

impl OutputsSeen {
    pub fn new(layout: &Layout) -> OutputsSeen {
        let mut places = Vec::new();
        for (number, domain) in layout.domains.iter().enumerate() {
            let datagrams = domain.frames.iter().flat_map(|frame| &frame.datagrams);
            for planned in datagrams.filter(|planned| planned.outputs > 0) {
                let mut runs: Vec<Run> = Vec::new();
                for area in &planned.output_areas {
                    let (image_at, length) = (area.image_offset as usize, usize::from(area.area.length));
                    let data_at = runs.last().map_or(0, |last| last.data_at + last.length);
                    match runs.last_mut() {
                        Some(last) if last.image_at + last.length == image_at => last.length += length,
                        _ => runs.push(Run { data_at, image_at, length }),
                    }
                }
                let logical = planned.logical.0;
                places.push(Place { logical, domain: number, runs: runs.into_boxed_slice(), latest: None });
            }
        }
        places.put_in_order_by_key(|place| place.logical);
        let images = || layout.domains.iter().map(|domain| vec![0; domain.image_len as usize].into_boxed_slice());
        OutputsSeen {
            places: places.into_boxed_slice(),
            latest: images().collect(),
            whole: images().collect(),
            received: Box::new([None; 256]),
            whole_of: None,
            has_any: false,
        }
    }

    /// Outputs from now on are of another ACTIVE. What was seen stays until it is seen again.
    pub fn forget(&mut self) {
        self.places.iter_mut().for_each(|place| place.latest = None);
        self.received.fill(None);
        (self.whole_of, self.has_any) = (None, false);
    }

    /// Whether anything was seen of this ACTIVE.
    pub fn has_any(&self) -> bool {
        self.has_any
    }

    /// Sets outputs of a domain: those that this MainDevice has sent itself.
    pub fn set(&mut self, domain: usize, image: &[u8]) {
        for images in [&mut self.latest, &mut self.whole] {
            if let Some(place) = images.get_mut(domain).filter(|place| place.len() == image.len()) {
                place.copy_from_slice(image);
            }
        }
    }

    /// Takes the outputs of a frame with process data. Any bytes are allowed.
    pub fn take(&mut self, frame: &[u8], sequence: Sequence) {
        self.received[usize::from(sequence.frame_id())] = Some(sequence);
        let mut rest = frame.get(DATAGRAMS_AT..).unwrap_or_default();
        while let Some(head) = rest.first_chunk() {
            let header = Header::decode(head);
            let Some((this, others)) = rest.split_at_checked(datagram::OVERHEAD + usize::from(header.length)) else {
                return;
            };
            if matches!(header.command, Command::Lwr | Command::Lrw) {
                self.take_datagram(header.address, &this[HEADER_LEN..], sequence);
            }
            if !header.more {
                return;
            }
            rest = others;
        }
    }

    fn take_datagram(&mut self, logical: u32, data: &[u8], sequence: Sequence) {
        let Ok(at) = self.places.binary_search_by_key(&logical, |place| place.logical) else { return };
        let place = &mut self.places[at];
        if place.latest.is_some_and(|latest| sequence.since(latest) < 0) {
            return;
        }
        place.latest = Some(sequence);
        self.has_any = true;
        let Some(image) = self.latest.get_mut(place.domain) else { return };
        for run in &place.runs {
            let (from, to) = (run.data_at..run.data_at + run.length, run.image_at..run.image_at + run.length);
            if let (Some(from), Some(to)) = (data.get(from), image.get_mut(to)) {
                to.copy_from_slice(from);
            }
        }
    }

    /// The header of a cycle has arrived, whose frames with process data have these numbers: if all of them have
    /// arrived, and none of a later cycle, their outputs are those of a whole cycle.
    pub fn end_cycle(&mut self, first: Sequence, frames: u16) {
        if self.whole_of.is_some_and(|whole| first.since(whole) <= 0) {
            return;
        }
        let end = Sequence::of_frame(u64::from(first.number()) + u64::from(frames));
        let has = |number: u16| {
            let sequence = Sequence::of_frame(u64::from(first.number()) + u64::from(number));
            self.received[usize::from(sequence.frame_id())] == Some(sequence)
        };
        let is_later = |place: &Place| place.latest.is_some_and(|latest| latest.since(end) >= 0);
        if !(0..frames.min(256)).all(has) || self.places.iter().any(is_later) {
            return;
        }
        self.whole_of = Some(first);
        self.whole.iter_mut().zip(&self.latest).for_each(|(whole, latest)| whole.copy_from_slice(latest));
    }

    /// Copies the outputs of the last whole cycle into the image of a domain.
    pub fn show(&self, domain: usize, image: &mut [u8]) {
        self.copy(&self.whole, domain, image);
    }

    /// Copies the latest outputs into the image of a domain.
    pub fn go_on(&self, domain: usize, image: &mut [u8]) {
        self.copy(&self.latest, domain, image);
    }

    fn copy(&self, images: &[Box<[u8]>], domain: usize, image: &mut [u8]) {
        let Some(seen) = images.get(domain) else { return };
        for run in self.places.iter().filter(|place| place.domain == domain).flat_map(|place| &place.runs) {
            let range = run.image_at..run.image_at + run.length;
            if let (Some(from), Some(to)) = (seen.get(range.clone()), image.get_mut(range)) {
                to.copy_from_slice(from);
            }
        }
    }
}
