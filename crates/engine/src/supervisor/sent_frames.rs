//! Acyclic frames on the wire: packing and sending (`send`), receiving (`receive`).

mod receive;
mod send;

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use ringcat_wire::frame::MAX_FRAME;

use super::sent_frame::SentFrame;
use crate::link::LinkSet;
use crate::ring::{MAX_IN_FLIGHT, Sequence};
use crate::time::Instant;

/// Frames on the wire at once: enough to fill the wire over the round trip of a thousand SubDevices (2 ms at 123 us a
/// frame), few enough that no frame times out in a full transmit queue.
const WINDOW: usize = 32;
/// Frames are indexed by the lower bits of their sequence number.
const SLOTS: usize = 128;

const _: () = assert!(WINDOW <= MAX_IN_FLIGHT && MAX_IN_FLIGHT <= SLOTS);

pub(crate) struct SentFrames {
    slots: Vec<Option<SentFrame>>,
    in_flight: usize,
    /// No deadline is earlier.
    earliest: Instant,
    /// No frame that awaits repeatable replies was sent earlier.
    oldest: Instant,
    /// When the newest frame was sent of which a copy has come back, by the link on which this was sent.
    newest_back: [Instant; 2],
    /// Number of frames that no longer count against the window.
    released: usize,
    sequence: Sequence,
    /// Ended frames, kept for reuse of their memory.
    spare: Vec<SentFrame>,
    /// The frame being built, then its redundant copy.
    buffer: Box<[u8]>,
}

impl SentFrames {
    pub(crate) fn new() -> SentFrames {
        SentFrames {
            slots: (0..SLOTS).map(|_| None).collect(),
            in_flight: 0,
            earliest: Instant::NEVER,
            oldest: Instant::NEVER,
            newest_back: [Instant::default(); 2],
            released: 0,
            sequence: Sequence::default(),
            spare: Vec::new(),
            buffer: vec![0; MAX_FRAME].into_boxed_slice(),
        }
    }

    /// Number of the last frame.
    pub(super) fn sequence(&self) -> Sequence {
        self.sequence
    }

    /// Takes the number of a frame that is not one of these.
    #[cfg(feature = "standby")]
    pub(super) fn take_sequence(&mut self) -> Sequence {
        self.sequence = self.sequence.next();
        self.sequence
    }

    /// The numbers go on behind this one: no frame is on the wire.
    pub(super) fn go_on_from(&mut self, sequence: Sequence) {
        self.sequence = sequence;
    }

    /// No frame has an earlier deadline; never if there is none. It may be that of an ended frame.
    #[inline]
    pub(super) fn next_deadline(&self) -> Instant {
        if self.in_flight == 0 { Instant::NEVER } else { self.earliest }
    }

    /// A frame is sent.
    fn put(&mut self, sent_frame: SentFrame) {
        self.earliest = self.next_deadline().min(sent_frame.deadline);
        self.oldest = if self.in_flight == 0 { sent_frame.sent_at } else { self.oldest.min(sent_frame.sent_at) };
        let slot = SentFrames::slot(sent_frame.sequence);
        self.slots[slot] = Some(sent_frame);
        self.in_flight += 1;
    }

    /// Frames have ended or not: determines the earliest deadline, and when the oldest was sent.
    fn find_earliest(&mut self) {
        let sent_frames = self.slots.iter().flatten();
        self.earliest = sent_frames.clone().map(|sent_frame| sent_frame.deadline).min().unwrap_or(Instant::NEVER);
        let repeatable = sent_frames.filter(|sent_frame| sent_frame.awaits_repeatable());
        self.oldest = repeatable.map(|sent_frame| sent_frame.sent_at).min().unwrap_or(Instant::NEVER);
    }

    fn slot(sequence: Sequence) -> usize {
        usize::from(sequence.frame_id()) % SLOTS
    }

    fn has_room(&self) -> bool {
        let room = self.in_flight < MAX_IN_FLIGHT && self.in_flight - self.released < WINDOW;
        room && self.slots[Self::slot(self.sequence.next())].is_none()
    }

    /// Whether copies of frames on the wire may still return, those on silent links excepted.
    pub(super) fn are_under_way(&self, links: LinkSet, silent: u8) -> bool {
        let is_waited_for =
            |sent_frame: &SentFrame| !sent_frame.released && sent_frame.missing_links(links) & !silent != 0;
        self.in_flight > self.released && self.slots.iter().flatten().any(is_waited_for)
    }

    fn release(&mut self, slot: usize) {
        if let Some(sent_frame) = self.slots[slot].as_mut().filter(|sent_frame| !sent_frame.released) {
            sent_frame.released = true;
            self.released += 1;
        }
    }

    /// Takes an ending frame from its slot.
    fn take(&mut self, slot: usize) -> Option<SentFrame> {
        let sent_frame = self.slots[slot].take()?;
        self.in_flight -= 1;
        self.released -= usize::from(sent_frame.released);
        Some(sent_frame)
    }

    fn fresh(&mut self, sequence: Sequence) -> SentFrame {
        let mut sent_frame = self.spare.pop().unwrap_or_default();
        sent_frame.begin(sequence);
        sent_frame
    }
}
