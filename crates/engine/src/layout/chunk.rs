//! Assigns areas to frames, and combines areas in common datagrams.
//!
//! Input: the areas of a domain in order, and the witness of each SubDevice's inputs. Output: chunks that fit a frame.
//! Within a chunk, areas of SubDevices with a presence byte share datagrams; the others have datagrams of their own
//! where a shared working counter would hide missing inputs.

use alloc::collections::BTreeSet;
use alloc::vec;
use alloc::vec::Vec;

use ringcat_wire::address::LogicalAddress;
use ringcat_wire::datagram::{MAX_DATA, OVERHEAD};

use super::error::LayoutError;
use super::plan::PlannedPresence;
use super::spec::{AreaSpec, Cut, Delivers, DomainSpec, Witness};
use crate::declared::SubDeviceId;
use crate::direction::Direction;

/// Room for datagrams in a frame.
const ROOM: usize = MAX_DATA + OVERHEAD;

/// Witness of each SubDevice. Each shows its AL status in one frame; in other frames it has datagrams of its own.
pub(super) struct Witnesses<'a> {
    known: &'a [Witness],
    shown: BTreeSet<usize>,
    /// Logical address of the next presence byte.
    next: LogicalAddress,
}

impl<'a> Witnesses<'a> {
    pub fn new(known: &'a [Witness], first: LogicalAddress) -> Witnesses<'a> {
        Witnesses { known, shown: BTreeSet::new(), next: first }
    }

    fn of(&self, subdevice: usize) -> Witness {
        match self.known.get(subdevice) {
            Some(witness) if !self.shown.contains(&subdevice) => *witness,
            None if !self.shown.contains(&subdevice) => Witness::Mapped(Delivers::FromSafeOp),
            _ => Witness::Alone,
        }
    }

    /// A presence datagram of these SubDevices, which from now on have no byte elsewhere.
    pub fn presence(&mut self, subdevices: &[usize]) -> Option<PlannedPresence> {
        let member = |subdevice: usize| match self.of(subdevice) {
            Witness::Mapped(delivers) => Some((subdevice, delivers)),
            Witness::Alone => None,
        };
        let members: Vec<(usize, Delivers)> = subdevices.iter().filter_map(|it| member(*it)).collect();
        let logical = self.next;
        self.next = LogicalAddress(logical.0 + members.len() as u32);
        self.shown.extend(members.iter().map(|(subdevice, _)| *subdevice));
        (!members.is_empty()).then_some(PlannedPresence { logical, members })
    }
}

/// Areas with common datagrams: one LRW, or an LWR and an LRD.
#[derive(Clone, Debug, Default)]
pub(super) struct Group {
    pub outputs: Vec<AreaSpec>,
    pub inputs: Vec<AreaSpec>,
    pub lrw: bool,
}

impl Group {
    fn add(&mut self, area: AreaSpec) {
        match area.direction {
            Direction::Outputs => self.outputs.push(area),
            Direction::Inputs => self.inputs.push(area),
        }
    }

    fn is_empty(&self) -> bool {
        self.outputs.is_empty() && self.inputs.is_empty()
    }

    /// Its datagrams.
    fn datagrams(&self) -> usize {
        let datagrams = usize::from(!self.outputs.is_empty()) + usize::from(!self.inputs.is_empty());
        if self.lrw { datagrams.min(1) } else { datagrams }
    }

    /// Bytes of its datagrams.
    fn used(&self) -> usize {
        let areas = self.outputs.iter().chain(&self.inputs);
        areas.map(|area| usize::from(area.length)).sum::<usize>() + self.datagrams() * OVERHEAD
    }
}

/// Areas in one frame.
#[derive(Clone, Debug)]
pub(super) struct Chunk {
    /// First the areas with common datagrams, then outputs of SubDevices without a presence byte, then one group for
    /// each other SubDevice.
    groups: Vec<Group>,
    /// SubDevices that can show their AL status, in the order of their areas.
    witnessed: Vec<usize>,
}

const SHARED: usize = 0;
const PLAIN: usize = 1;

impl Chunk {
    fn new(lrw: bool) -> Chunk {
        Chunk { groups: vec![Group { lrw, ..Group::default() }, Group::default()], witnessed: Vec::new() }
    }

    /// The groups that have areas.
    pub fn groups(&self) -> impl Iterator<Item = &Group> {
        self.groups.iter().filter(|group| !group.is_empty())
    }

    /// SubDevices that can show their AL status.
    pub fn witnessed(&self) -> &[usize] {
        &self.witnessed
    }

    fn is_empty(&self) -> bool {
        self.groups.iter().all(Group::is_empty)
    }

    /// Whether it fits a frame.
    fn fits(&self, most: Option<usize>) -> bool {
        let presence = usize::from(self.witnessed.len() > 1);
        let datagrams = self.groups.iter().map(Group::datagrams).sum::<usize>() + presence;
        self.used() <= ROOM && most.is_none_or(|most| datagrams <= most)
    }

    /// Largest length of all datagrams in bytes.
    fn used(&self) -> usize {
        let presence = if self.witnessed.len() > 1 { OVERHEAD + self.witnessed.len() } else { 0 };
        self.groups.iter().map(Group::used).sum::<usize>() + presence
    }

    /// Adds areas of a SubDevice.
    fn add(&mut self, areas: &[AreaSpec], witness: Witness) {
        let Some(subdevice) = areas.first().map(|area| area.subdevice) else { return };
        let lrw = self.groups[SHARED].lrw;
        let has_inputs = areas.iter().any(|area| area.direction == Direction::Inputs);
        // The SubDevice increments a working counter once, whatever part of its inputs is in the frame: each further
        // area needs a datagram of its own.
        let has_some = |group: &Group| group.inputs.iter().any(|area| area.subdevice == subdevice);
        let mut is_further = self.groups.iter().any(has_some);
        let (further, first): (Vec<AreaSpec>, Vec<AreaSpec>) = areas
            .iter()
            .partition(|area| area.direction == Direction::Inputs && core::mem::replace(&mut is_further, true));
        for area in further {
            let mut alone = Group::default();
            alone.add(area);
            self.groups.push(alone);
        }
        if matches!(witness, Witness::Mapped(_)) {
            first.iter().for_each(|area| self.groups[SHARED].add(*area));
            if !self.witnessed.contains(&subdevice) {
                self.witnessed.push(subdevice);
            }
            return;
        }
        let mut own = Group { lrw, ..Group::default() };
        for area in &first {
            // Outputs alone may share: the sum shows whether all SubDevices took them.
            let is_plain = area.direction == Direction::Outputs && !(lrw && has_inputs);
            if is_plain { self.groups[PLAIN].add(*area) } else { own.add(*area) }
        }
        if !own.is_empty() {
            self.groups.push(own);
        }
    }

    fn with(&self, areas: &[AreaSpec], witness: Witness) -> Chunk {
        let mut with = self.clone();
        with.add(areas, witness);
        with
    }
}

/// Cuts the areas of a domain into chunks.
pub(super) fn chunks(
    spec: &DomainSpec,
    Cut { lrw, each, most }: Cut,
    witnesses: &Witnesses<'_>,
) -> Result<Vec<Chunk>, LayoutError> {
    let mut chunks = Vec::new();
    let mut chunk = Chunk::new(lrw);
    let mut shown: BTreeSet<usize> = BTreeSet::new();
    let areas: Vec<AreaSpec> = spec.areas.iter().filter(|area| area.length > 0).copied().collect();
    for group in areas.chunk_by(|a, b| a.subdevice == b.subdevice) {
        if let Some(long) = group.iter().find(|area| usize::from(area.length) > MAX_DATA) {
            let AreaSpec { subdevice, sync_manager, length, .. } = *long;
            return Err(LayoutError::AreaTooLong { subdevice: SubDeviceId(subdevice), sync_manager, length });
        }
        let subdevice = group[0].subdevice;
        let witness =
            |shown: &BTreeSet<usize>| if shown.contains(&subdevice) { Witness::Alone } else { witnesses.of(subdevice) };
        // A SubDevice's areas stay together where possible: fewer working counters to evaluate.
        let mut whole = chunk.with(group, witness(&shown));
        if !chunk.is_empty() && (each || !whole.fits(most)) {
            shown.extend(chunk.witnessed.iter().copied());
            chunks.push(core::mem::replace(&mut chunk, Chunk::new(lrw)));
            whole = chunk.with(group, witness(&shown));
        }
        if whole.fits(most) {
            chunk = whole;
            continue;
        }
        for area in group {
            let next = chunk.with(core::slice::from_ref(area), witness(&shown));
            if !chunk.is_empty() && !next.fits(most) {
                shown.extend(chunk.witnessed.iter().copied());
                chunks.push(core::mem::replace(&mut chunk, Chunk::new(lrw)));
            }
            chunk.add(core::slice::from_ref(area), witness(&shown));
        }
    }
    if !chunk.is_empty() {
        chunks.push(chunk);
    }
    Ok(chunks)
}
