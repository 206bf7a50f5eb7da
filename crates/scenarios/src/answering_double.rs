//! A test double of a segment that only responds to cyclic frames, for measurements of the MainDevice's cost.
//!
//! In: the frames that a MainDevice sent on its in-memory links. Out: the same frames, with the working counters that
//! SubDevices would have written, their AL status in presence datagrams, and the bit that controllers set in the source
//! address (protocol 2.6), on the link on which the cabling returns them (protocol 9.2.1). Inputs are returned as sent.

use ringcat::memory::FrameRing;
use ringcat_engine::layout::{Layout, PlannedFrame};
use ringcat_engine::link::Link;
use ringcat_wire::datagram::{HEADER_LEN, Target, WKC_LEN};
use ringcat_wire::frame::{ETHERCAT_HEADER_LEN, ETHERNET_HEADER_LEN};
use ringcat_wire::register::map;
use ringcat_wire::source_address::PROCESSED;

/// Offset of the first datagram in a frame.
const DATAGRAMS_AT: usize = ETHERNET_HEADER_LEN + ETHERCAT_HEADER_LEN;
/// Offset of the first datagram's address, which identifies a frame.
const KEY_AT: usize = DATAGRAMS_AT + 2;
/// Offset of the source address.
const SOURCE_AT: usize = 6;
/// AL status of a SubDevice in OP.
const IN_OP: u8 = 0x08;
/// Bytes of AL status, which the supervision datagram reads.
const AL_STATUS_LEN: usize = 2;

/// How the SubDevices are connected to the links.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cabling {
    /// On the main link alone.
    Line,
    /// A closed ring: all SubDevices process the main copy, which arrives on the redundant link; none processes the
    /// redundant copy, which arrives on the main link.
    ClosedRing,
    /// A broken ring: copies return on the link they were sent on. SubDevices before the break process the main copy,
    /// the others the redundant copy.
    CutRing {
        /// Number of SubDevices before the break.
        before: usize,
    },
}

impl Cabling {
    /// The copy that a SubDevice processes.
    fn met_on(self, subdevice: usize) -> Link {
        match self {
            Cabling::CutRing { before } if subdevice >= before => Link::Redundant,
            Cabling::Line | Cabling::ClosedRing | Cabling::CutRing { .. } => Link::Main,
        }
    }

    fn arrives_on(self, sent_on: Link) -> Link {
        match (self, sent_on) {
            (Cabling::ClosedRing, Link::Main) => Link::Redundant,
            (Cabling::ClosedRing, Link::Redundant) => Link::Main,
            (Cabling::Line | Cabling::CutRing { .. }, link) => link,
        }
    }
}

/// A working counter to be written.
#[derive(Clone, Copy, Debug)]
struct Patch {
    at: usize,
    /// By the link on which the copy was sent.
    wkc: [u16; 2],
}

/// Bytes of a presence datagram to be written, its working counter behind them.
#[derive(Clone, Debug)]
struct Shown {
    at: usize,
    /// By the link on which the copy was sent.
    bytes: [Vec<u8>; 2],
}

#[derive(Debug)]
struct Answer {
    key: [u8; 4],
    patches: Vec<Patch>,
    presence: Option<Shown>,
}

/// The double.
#[derive(Debug)]
pub struct AnsweringDouble {
    answers: Vec<Answer>,
    cabling: Cabling,
}

impl AnsweringDouble {
    /// A double that responds to the frames of a layout for this many SubDevices.
    pub fn new(layout: &Layout, subdevices: usize, cabling: Cabling) -> AnsweringDouble {
        let frames = layout.domains.iter().flat_map(|domain| &domain.frames);
        AnsweringDouble { answers: frames.map(|frame| Answer::new(frame, subdevices, cabling)).collect(), cabling }
    }

    /// Responds to all sent frames; frames that are not in the layout are dropped.
    // Not inlined: its cost is measured separately and subtracted.
    #[inline(never)]
    pub fn answer(&self, sent: &mut FrameRing, arriving: &mut FrameRing) {
        while let Some((link, frame)) = sent.pop() {
            if self.process(link, frame) {
                arriving.push(self.cabling.arrives_on(link), frame);
            }
        }
    }

    /// The SubDevices process a copy that was sent on a link; false if it is no frame of the layout.
    #[inline(always)]
    pub fn process(&self, link: Link, frame: &mut [u8]) -> bool {
        let Some(key) = frame.get(KEY_AT..KEY_AT + 4) else { return false };
        let Some(answer) = self.answers.iter().find(|answer| answer.key == *key) else { return false };
        frame[SOURCE_AT] |= PROCESSED;
        for patch in &answer.patches {
            // A frame that is sent again has no supervision datagram.
            if let Some(wkc) = frame.get_mut(patch.at..patch.at + WKC_LEN) {
                wkc.copy_from_slice(&patch.wkc[link.index()].to_le_bytes());
            }
        }
        if let Some(Shown { at, bytes }) = &answer.presence {
            let bytes = &bytes[link.index()];
            frame[*at..*at + bytes.len()].copy_from_slice(bytes);
        }
        true
    }

    /// The link on which a copy comes back.
    pub fn arrives_on(&self, sent_on: Link) -> Link {
        self.cabling.arrives_on(sent_on)
    }
}

impl Answer {
    fn new(frame: &PlannedFrame, subdevices: usize, cabling: Cabling) -> Answer {
        let supervision = Target::Broadcast(map::AL_STATUS);
        let first = frame.datagrams.first().map_or(supervision, |datagram| Target::Logical(datagram.logical));
        let mut patches = Vec::new();
        let mut at = DATAGRAMS_AT;
        for datagram in &frame.datagrams {
            at += HEADER_LEN + usize::from(datagram.outputs) + usize::from(datagram.inputs);
            let mut wkc = [0; 2];
            for (subdevice, contribution) in &datagram.contributions {
                wkc[cabling.met_on(*subdevice).index()] += contribution.0;
            }
            patches.push(Patch { at, wkc });
            at += WKC_LEN;
        }
        let presence = frame.presence.as_ref().map(|presence| {
            let data_at = at + HEADER_LEN;
            at = data_at + presence.members.len() + WKC_LEN;
            let bytes = Link::ALL.map(|link| {
                let is_met = |subdevice: usize| cabling.met_on(subdevice) == link;
                let status = |(subdevice, _): &(usize, _)| if is_met(*subdevice) { IN_OP } else { 0 };
                let mut bytes: Vec<u8> = presence.members.iter().map(status).collect();
                let met = bytes.iter().filter(|status| **status != 0).count() as u16;
                bytes.extend(met.to_le_bytes());
                bytes
            });
            Shown { at: data_at, bytes }
        });
        if frame.supervision {
            let mut wkc = [0; 2];
            for subdevice in 0..subdevices {
                wkc[cabling.met_on(subdevice).index()] += 1;
            }
            patches.push(Patch { at: at + HEADER_LEN + AL_STATUS_LEN, wkc });
        }
        Answer { key: first.raw().to_le_bytes(), patches, presence }
    }
}
