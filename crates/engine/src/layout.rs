//! Process data areas to logical addresses, images and frames.
//!
//! A domain is cut into chunks of whole areas that fit one frame, so that no SyncManager is split over datagrams
//! (protocol 3.11: an access must cover start and end). A chunk is one LRW, or an LWR and an LRD, over `[outputs of the
//! chunk][inputs of the chunk]`; image and logical addresses follow the same order. Areas are aligned to bytes
//! (protocol 3.10: few controllers support bitwise FMMUs).
//!
//! A working counter is a sum: where several SubDevices add to it, it does not show which of them did. So each of them
//! shows its AL status in a presence datagram of the same frame, through a spare FMMU; a SubDevice without a spare FMMU
//! has its inputs in a datagram of its own ([`Witness`]).

mod chunk;
mod error;
mod fixed;
#[cfg(feature = "standby")]
mod master_frames;
mod plan;
mod repeat;
mod service;
mod spec;

use alloc::vec::Vec;

use ringcat_wire::address::{LogicalAddress, Wkc};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::{MAX_DATA, OVERHEAD};

use crate::domain::DomainId;
use crate::link::LinkSet;
use crate::order::InOrder;
use crate::ring::MIN_DATAGRAMS_PER_FRAME;
use fixed::Starts;
use spec::Cut;

pub use error::LayoutError;
#[cfg(feature = "standby")]
pub use master_frames::{InputRun, KNOWLEDGE_GRAIN, MOST_FRAGMENTS, MasterSizes, PlannedFragment, PlannedMasterFrames};
pub use plan::{PlacedArea, PlannedDatagram, PlannedDomain, PlannedFrame, PlannedPresence};
pub use repeat::{OutputsAgain, Piece, PlannedRepeat, RepeatRule};
pub use spec::{AreaSpec, Delivers, DomainSpec, FixedImage, ImageOrder, LrwPolicy, Rules, Witness};

/// The frames that the exchange sends.
#[derive(Clone, Debug, Default)]
pub struct Layout {
    /// Domains by [`DomainId`].
    pub domains: Vec<PlannedDomain>,
    /// Largest number of datagrams in a frame.
    pub(crate) most: Option<usize>,
}

/// Data of the supervision datagram: AL status.
pub(crate) const SUPERVISION_LEN: usize = 2;
/// Distributed clocks take three datagrams of four bytes.
const CLOCKS_LEN: usize = CLOCKS * (OVERHEAD + 4);
const CLOCKS: usize = 3;
const _: () = assert!(CLOCKS <= MIN_DATAGRAMS_PER_FRAME as usize);
/// Logical address of presence bytes: beyond all process data, which ends at 2 GiB, and below the mail bits.
const PRESENCE_AT: LogicalAddress = LogicalAddress(0xE000_0000);
/// Number of sessions with logical addresses of their own: process data of the last one begins below 1 GiB.
pub const SESSIONS: u32 = 1024;
/// Distance of the process data of two sessions: 1 MiB; of their presence bytes: 64 KiB, the largest number of
/// SubDevices.
const DATA_BITS: u32 = 20;
const PRESENCE_BITS: u32 = 16;

impl Layout {
    /// As [`Layout::with`], with LRW where it helps, and a spare FMMU in every SubDevice.
    pub fn new(specs: &[DomainSpec], links: LinkSet, supervision: bool) -> Result<Layout, LayoutError> {
        let lrw = LrwPolicy::Automatic;
        Layout::with(specs, Rules { links, supervision, lrw, witnesses: &[], session: 0, max_datagrams: None })
    }

    /// Lays out domains.
    pub fn with(specs: &[DomainSpec], rules: Rules<'_>) -> Result<Layout, LayoutError> {
        let most = rules.max_datagrams;
        let mut layout = Layout { most, ..Layout::default() };
        let session = rules.session % SESSIONS;
        let mut logical = session << DATA_BITS;
        let presence = LogicalAddress(PRESENCE_AT.0 + (session << PRESENCE_BITS));
        let mut witnesses = chunk::Witnesses::new(rules.witnesses, presence);
        for spec in specs {
            let each = rules.lrw == LrwPolicy::PerSubDevice;
            let lrw = spec.lrw && (rules.links == LinkSet::Single || each);
            let cut = Cut { lrw, each, most };
            let domain = lay_out(spec, cut, LogicalAddress(logical), &mut witnesses)?;
            // Domains start at multiples of four bytes, which makes captures easier to read.
            let end = logical.checked_add(domain.logical_len).filter(|end| *end < 1 << 31);
            logical = end.ok_or(LayoutError::TooLarge)?.next_multiple_of(4);
            layout.domains.push(domain);
        }
        if rules.supervision {
            layout.add_supervision();
        }
        layout.check_in_flight()?;
        Ok(layout)
    }

    /// Number of process data datagrams of each domain.
    pub fn datagrams(&self) -> impl Iterator<Item = usize> {
        let of_domain = |domain: &PlannedDomain| domain.frames.iter().map(|frame| frame.datagrams.len()).sum();
        self.domains.iter().map(of_domain)
    }

    /// Logical address of the byte in which a SubDevice shows its AL status; `None` where it has none.
    pub fn presence(&self, subdevice: usize) -> Option<LogicalAddress> {
        let presences =
            self.domains.iter().flat_map(|domain| &domain.frames).filter_map(|frame| frame.presence.as_ref());
        presences.into_iter().find_map(|presence| {
            let at = presence.members.iter().position(|(member, _)| *member == subdevice)?;
            Some(LogicalAddress(presence.logical.0 + at as u32))
        })
    }

    fn check_in_flight(&self) -> Result<(), LayoutError> {
        self.check_beside(0)
    }

    /// Whether the frames may be on the wire beside this number of others.
    fn check_beside(&self, others: usize) -> Result<(), LayoutError> {
        let of_domain = |domain: &PlannedDomain| domain.frames.len() * usize::from(domain.under_way.max(1));
        let frames = self.domains.iter().map(of_domain).sum::<usize>() + usize::from(self.service().is_some());
        let frames = frames + others;
        if frames > crate::ring::MAX_IN_FLIGHT { Err(LayoutError::TooManyFrames { frames }) } else { Ok(()) }
    }

    fn add_supervision(&mut self) {
        let Some(home) = self.home() else { return };
        let domain = &mut self.domains[home];
        let room = |frame: &PlannedFrame| {
            frame.used() + OVERHEAD + SUPERVISION_LEN <= MAX_DATA + OVERHEAD && frame.takes(1, self.most)
        };
        match domain.frames.iter_mut().find(|frame| room(frame)) {
            Some(frame) => frame.supervision = true,
            None => domain.frames.push(PlannedFrame { supervision: true, ..PlannedFrame::default() }),
        }
    }

    /// Adds the datagrams of distributed clocks.
    pub fn add_clocks(&mut self) -> Result<(), LayoutError> {
        let Some(home) = self.home() else { return Ok(()) };
        let domain = &mut self.domains[home];
        let others = |frame: &PlannedFrame| if frame.supervision { OVERHEAD + SUPERVISION_LEN } else { 0 };
        let room = |frame: &PlannedFrame| {
            frame.used() + others(frame) + CLOCKS_LEN <= MAX_DATA + OVERHEAD && frame.takes(CLOCKS, self.most)
        };
        match domain.frames.iter_mut().find(|frame| room(frame)) {
            Some(frame) => frame.clocks = true,
            None => domain.frames.push(PlannedFrame { clocks: true, ..PlannedFrame::default() }),
        }
        self.check_in_flight()
    }

    /// The first place of a SubDevice's area, with its domain.
    pub fn area(&self, subdevice: usize, sync_manager: u8) -> Option<(DomainId, PlacedArea)> {
        self.areas_of(subdevice).find(|(_, placed)| placed.area.sync_manager == sync_manager)
    }

    /// All places of a SubDevice's areas, with their domains: an area has one in each domain that exchanges it.
    pub fn areas_of(&self, subdevice: usize) -> impl Iterator<Item = (DomainId, PlacedArea)> {
        let in_domain = move |(id, domain): (usize, &PlannedDomain)| {
            let places: Vec<PlacedArea> =
                domain.areas.iter().filter(|placed| placed.area.subdevice == subdevice).copied().collect();
            places.into_iter().map(move |placed| (DomainId(id), placed))
        };
        self.domains.iter().enumerate().flat_map(in_domain)
    }
}

impl PlannedPresence {
    /// Bytes of the datagram including overhead.
    pub fn bytes(&self) -> usize {
        OVERHEAD + self.members.len()
    }
}

impl PlannedFrame {
    /// Bytes of all datagrams including overhead.
    pub fn bytes(&self) -> usize {
        let supervision = if self.supervision { OVERHEAD + SUPERVISION_LEN } else { 0 };
        self.used() + supervision + if self.clocks { CLOCKS_LEN } else { 0 }
    }

    /// Bytes of all datagrams of process data and presence including overhead.
    fn used(&self) -> usize {
        let data = |d: &PlannedDatagram| OVERHEAD + usize::from(d.outputs) + usize::from(d.inputs);
        let presence = self.presence.as_ref().map_or(0, PlannedPresence::bytes);
        self.datagrams.iter().map(data).sum::<usize>() + presence
    }

    /// Whether this number of further datagrams is allowed.
    fn takes(&self, more: usize, most: Option<usize>) -> bool {
        let clocks = if self.clocks { CLOCKS } else { 0 };
        let others = usize::from(self.presence.is_some()) + usize::from(self.supervision) + clocks;
        most.is_none_or(|most| self.datagrams.len() + others + more <= most)
    }
}

fn lay_out(
    spec: &DomainSpec,
    cut: Cut,
    base: LogicalAddress,
    witnesses: &mut chunk::Witnesses<'_>,
) -> Result<PlannedDomain, LayoutError> {
    let mut domain = PlannedDomain {
        period: spec.period,
        under_way: spec.under_way,
        image_len: 0,
        logical_len: 0,
        areas: Vec::new(),
        frames: Vec::new(),
    };
    let starts = Starts::new(spec);
    for chunk in chunk::chunks(&starts.wire_order(spec), cut, witnesses)? {
        let frame = domain.place(&chunk, base, &starts, witnesses)?;
        match domain.frames.last_mut() {
            Some(last)
                if cut.each
                    && last.used() + frame.used() <= MAX_DATA + OVERHEAD
                    && last.takes(frame.datagrams.len(), cut.most) =>
            {
                last.datagrams.extend(frame.datagrams);
            }
            _ => domain.frames.push(frame),
        }
    }
    domain.image_len = starts.image_len(&domain);
    Ok(domain)
}

impl PlannedDomain {
    /// Gives a chunk its place in the image; returns its frame.
    fn place(
        &mut self,
        chunk: &chunk::Chunk,
        base: LogicalAddress,
        starts: &Starts,
        witnesses: &mut chunk::Witnesses<'_>,
    ) -> Result<PlannedFrame, LayoutError> {
        let mut frame = PlannedFrame::default();
        for group in chunk.groups() {
            self.place_group(&mut frame, group, base, starts)?;
        }
        let is_shared = frame.datagrams.iter().any(|datagram| datagram.inputs > 0 && datagram.contributions.len() > 1);
        frame.presence = is_shared.then(|| witnesses.presence(chunk.witnessed())).flatten();
        Ok(frame)
    }

    /// Gives areas with common datagrams their place.
    fn place_group(
        &mut self,
        frame: &mut PlannedFrame,
        group: &chunk::Group,
        base: LogicalAddress,
        starts: &Starts,
    ) -> Result<(), LayoutError> {
        let start = self.logical_len;
        let mut placed = Vec::new();
        for area in group.outputs.iter().chain(&group.inputs) {
            let logical = LogicalAddress(base.0.checked_add(self.logical_len).ok_or(LayoutError::TooLarge)?);
            let image_offset = starts.of(area).unwrap_or(self.logical_len);
            placed.push(PlacedArea { area: *area, image_offset, logical });
            self.logical_len += u32::from(area.length);
        }
        let (outputs, inputs) = placed.split_at(group.outputs.len());
        let bytes = |areas: &[PlacedArea]| areas.iter().map(|a| a.area.length).sum::<u16>();
        let (out_len, in_len) = (bytes(outputs), bytes(inputs));
        let datagram =
            |command, offset: u32, out_len, in_len, reads: &[PlacedArea], writes: &[PlacedArea]| PlannedDatagram {
                command,
                logical: LogicalAddress(base.0 + offset),
                outputs: out_len,
                inputs: in_len,
                contributions: contributions(command, reads, writes),
                output_areas: writes.to_vec(),
                input_areas: reads.to_vec(),
            };
        if group.lrw && out_len > 0 && in_len > 0 {
            frame.datagrams.push(datagram(Command::Lrw, start, out_len, in_len, inputs, outputs));
        } else {
            if out_len > 0 {
                frame.datagrams.push(datagram(Command::Lwr, start, out_len, 0, &[], outputs));
            }
            if in_len > 0 {
                frame.datagrams.push(datagram(Command::Lrd, start + u32::from(out_len), 0, in_len, inputs, &[]));
            }
        }
        self.areas.extend(placed);
        Ok(())
    }
}

/// Increment of the working counter by each SubDevice (protocol 1.4): once per datagram and direction.
fn contributions(command: Command, reads: &[PlacedArea], writes: &[PlacedArea]) -> Vec<(usize, Wkc)> {
    let write = if command == Command::Lrw { 2 } else { 1 };
    let mut contributions: Vec<(usize, Wkc)> = Vec::new();
    let subdevices = |areas: &[PlacedArea]| {
        let mut subdevices: Vec<usize> = areas.iter().map(|a| a.area.subdevice).collect();
        subdevices.put_in_order();
        subdevices.dedup();
        subdevices
    };
    contributions.extend(subdevices(writes).into_iter().map(|subdevice| (subdevice, Wkc(write))));
    for subdevice in subdevices(reads) {
        match contributions.binary_search_by_key(&subdevice, |c| c.0) {
            Ok(at) => contributions[at].1 = contributions[at].1.plus(Wkc(1)),
            Err(at) => contributions.insert(at, (subdevice, Wkc(1))),
        }
    }
    contributions
}

#[cfg(test)]
mod tests;
