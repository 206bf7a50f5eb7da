//! One master frame: its bytes, and what the copies of its last flight have shown.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::frame::{FrameBuilder, MAX_FRAME, MacAddress};
use ringcat_wire::master_frame::{ADO, Area, FragmentHead, VERSION};

use crate::exchange::flight::Step;
use crate::exchange::words::{header_at, u16_at};
use crate::layout::PlannedFragment;
use crate::link::{Link, LinkSet};
use crate::ring::{Class, FrameCopy, Identity, Sequence, is_forwarded};

/// A fragment in the bytes of a frame.
#[derive(Clone, Copy, Debug)]
struct Placed {
    area: Area,
    /// First byte of the area.
    offset: usize,
    /// Offset of its bytes of the area in the frame.
    data_at: usize,
    length: usize,
}

impl Placed {
    /// Offset of the datagram's header.
    const fn header_at(&self) -> usize {
        self.data_at - FragmentHead::LEN - ringcat_wire::datagram::HEADER_LEN
    }

    /// Offset of the cycle in the head.
    const fn cycle_at(&self) -> usize {
        self.data_at - FragmentHead::LEN + 4
    }

    /// Offset of the working counter.
    const fn wkc_at(&self) -> usize {
        self.data_at + self.length
    }
}

/// A master frame.
#[derive(Debug)]
pub(super) struct MasterFrame {
    tx: Box<[u8]>,
    fragments: Box<[Placed]>,
    sequence: Sequence,
    index: u8,
    /// Bits of the links on which copies left and have not come back.
    expected: u8,
    /// Bits of the links whose copies came back.
    arrived: u8,
    is_forwarded: bool,
    is_taken: bool,
    is_filled: bool,
}

impl MasterFrame {
    /// `first`: number of the first fragment in the cycle.
    pub fn new(identity: &Identity, planned: &[PlannedFragment], first: u16) -> MasterFrame {
        let mut bytes = vec![0; MAX_FRAME];
        let (mut length, mut fragments) = (0, Vec::with_capacity(planned.len()));
        if let Some(mut builder) = FrameBuilder::ethernet(&mut bytes, MacAddress::ETHERCAT_GROUP, identity.source()) {
            for (number, fragment) in (first..).zip(planned) {
                let PlannedFragment { area, offset, length } = *fragment;
                let head = FragmentHead { area, version: VERSION, number, cycle: 0, offset: offset as u32 };
                let whole = FragmentHead::LEN + length;
                let Some(at) = builder.datagram(Command::Nop, 0, Target::Broadcast(ADO), whole) else { continue };
                if let Some(place) = builder.data_mut(at, FragmentHead::LEN) {
                    place.copy_from_slice(&head.encode());
                }
                fragments.push(Placed { area, offset, data_at: at + FragmentHead::LEN, length });
            }
            length = builder.finish();
        }
        bytes.truncate(length);
        MasterFrame {
            tx: bytes.into_boxed_slice(),
            fragments: fragments.into_boxed_slice(),
            sequence: Sequence::default(),
            index: 0,
            expected: 0,
            arrived: 0,
            is_forwarded: false,
            is_taken: false,
            is_filled: false,
        }
    }

    /// Whether the INACTIVE writes areas in it.
    pub fn is_filled_by_inactive(&self) -> bool {
        self.fragments.iter().any(|fragment| fragment.area.is_to_active())
    }

    /// Offset of a fragment's bytes of the area.
    pub fn data_at(&self, number: usize) -> usize {
        self.fragments[number].data_at
    }

    /// Whether both copies came back, or none left.
    pub const fn is_home(&self) -> bool {
        self.expected == 0
    }

    /// Whether copies left and none came back.
    pub const fn is_lost(&self) -> bool {
        self.expected != 0 && self.arrived == 0
    }

    /// Whether an INACTIVE MainDevice has forwarded a copy.
    pub const fn is_forwarded(&self) -> bool {
        self.is_forwarded
    }

    /// Whether the INACTIVE has taken the areas for it in one copy.
    pub const fn is_taken(&self) -> bool {
        self.is_taken
    }

    /// Whether the INACTIVE has filled its areas in one copy.
    pub const fn is_filled(&self) -> bool {
        self.is_filled
    }

    /// Nothing is expected any more.
    pub const fn close(&mut self) {
        self.expected = 0;
    }

    /// The next flight has this cycle.
    pub fn begin(&mut self, cycle: u32) {
        (self.arrived, self.is_forwarded, self.is_taken, self.is_filled) = (0, false, false, false);
        for fragment in &self.fragments {
            self.tx[fragment.cycle_at()..][..4].copy_from_slice(&cycle.to_le_bytes());
        }
    }

    /// Writes bytes at an offset in the frame.
    pub fn write(&mut self, at: usize, bytes: &[u8]) {
        self.tx[at..at + bytes.len()].copy_from_slice(bytes);
    }

    /// Writes the parts of an area that are in this frame.
    pub fn write_area(&mut self, area: Area, bytes: &[u8]) {
        for fragment in self.fragments.iter().filter(|it| it.area == area) {
            if let Some(part) = bytes.get(fragment.offset..fragment.offset + fragment.length) {
                self.tx[fragment.data_at..][..fragment.length].copy_from_slice(part);
            }
        }
    }

    /// Writes the bytes of an area one by one.
    pub fn write_each(&mut self, area: Area, mut byte: impl FnMut(usize) -> u8) {
        for fragment in self.fragments.iter().filter(|it| it.area == area) {
            let place = &mut self.tx[fragment.data_at..][..fragment.length];
            place.iter_mut().zip(fragment.offset..).for_each(|(place, at)| *place = byte(at));
        }
    }

    /// Writes a piece of an area that has this offset now, or zeros at offset 0 if there is none.
    pub fn write_piece(&mut self, area: Area, offset: usize, piece: impl FnOnce(&mut [u8]) -> bool) {
        let Some(fragment) = self.fragments.iter().find(|it| it.area == area) else { return };
        let place = &mut self.tx[fragment.data_at..][..fragment.length];
        let is_there = piece(place);
        if !is_there {
            place.fill(0);
        }
        let offset = if is_there { offset as u32 } else { 0 };
        self.tx[fragment.data_at - 4..fragment.data_at].copy_from_slice(&offset.to_le_bytes());
    }

    /// Reads the parts of an area in a copy.
    pub fn read_area(&self, bytes: &[u8], area: Area, out: &mut [u8]) {
        for fragment in self.fragments.iter().filter(|it| it.area == area) {
            let part = bytes.get(fragment.data_at..fragment.data_at + fragment.length);
            let place = out.get_mut(fragment.offset..fragment.offset + fragment.length);
            if let (Some(part), Some(place)) = (part, place) {
                place.copy_from_slice(part);
            }
        }
    }

    /// Sends both copies; returns the length.
    pub fn send(
        &mut self,
        identity: &Identity,
        links: LinkSet,
        sequence: Sequence,
        transmit: &mut impl FnMut(Link, &[u8]),
    ) -> usize {
        let index = sequence.index(Class::Cyclic);
        if self.index != index {
            self.index = index;
            self.fragments.iter().for_each(|fragment| self.tx[fragment.header_at() + 1] = index);
        }
        identity.restamp(&mut self.tx, sequence);
        (self.sequence, self.expected) = (sequence, links.mask());
        transmit(Link::Main, &self.tx);
        if links == LinkSet::Ring {
            Identity::mark_redundant(&mut self.tx, true);
            transmit(Link::Redundant, &self.tx);
            Identity::mark_redundant(&mut self.tx, false);
        }
        self.tx.len()
    }

    /// Takes a copy.
    pub fn receive(&mut self, copy: FrameCopy, bytes: &[u8]) -> Step {
        if self.sequence != copy.sequence || self.expected & copy.sent_on.bit() == 0 {
            return Step::Late;
        }
        if bytes.len() < self.tx.len() || !self.fragments.iter().all(|it| self.is_what_was_sent(it, bytes)) {
            return Step::Corrupt;
        }
        self.expected &= !copy.sent_on.bit();
        self.arrived |= copy.sent_on.bit();
        self.is_forwarded |= is_forwarded(bytes);
        let (mut takes, mut fills) = (true, true);
        for fragment in &self.fragments {
            let counts = u16_at(bytes, fragment.wkc_at()) == fragment.area.weight();
            *(if fragment.area.is_to_active() { &mut fills } else { &mut takes }) &= counts;
        }
        self.is_taken |= takes;
        self.is_filled |= fills && self.is_filled_by_inactive();
        if self.expected == 0 { Step::Finished } else { Step::Waiting }
    }

    /// Whether header and head of a fragment are those that were sent.
    fn is_what_was_sent(&self, fragment: &Placed, bytes: &[u8]) -> bool {
        let (at, head) = (fragment.header_at(), fragment.data_at - FragmentHead::LEN..fragment.data_at);
        header_at(bytes, at) == header_at(&self.tx, at) && bytes.get(head.clone()) == self.tx.get(head)
    }
}
