//! Areas of the process data of the declared SubDevices, and their PDO entries.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;
use core::fmt;
use core::ops::Range;

use super::working_counters::expected_as_igh;
use crate::config::{PdoEntry, PdoMapping, SubDeviceConfig};
use crate::declared::SubDeviceId;
use crate::domain::DomainId;
use crate::exchange::Entry;
use crate::info::{Direction, SubDeviceInfo};
use crate::layout::{Layout, PlacedArea};
use crate::main_device::activate::sent_once::SentOnce;
use crate::order::InOrder;
use crate::plan::{MappedEntry, SubDevicePlan};
use crate::segment::setup::{SetupError, declared_areas, planned_areas};

/// Places of the PDO entries of all declared SubDevices in the domains' images.
#[derive(Clone, Debug, Default)]
pub struct Directory {
    subdevices: Vec<Vec<AreaEntries>>,
    /// Share of each SubDevice in the working counters of all domains.
    contributions: Vec<u32>,
    /// Bits of outputs by domain, in order and without gaps inside a range.
    outputs: Vec<(DomainId, Range<u64>)>,
    /// By SubDevice, why not all of its process data is sent again.
    sent_once: Vec<Option<SentOnce>>,
}

/// An area with its entries.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct AreaEntries {
    /// The domain.
    pub domain: DomainId,
    /// Place in the image.
    pub placed: PlacedArea,
    /// Direction.
    pub direction: Direction,
    /// Its entries; without gaps.
    pub entries: Vec<PlacedEntry>,
}

/// A PDO entry with its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct PlacedEntry {
    /// Index of the object.
    pub index: u16,
    /// Subindex.
    pub sub_index: u8,
    /// Place in the image of the domain.
    pub place: Entry,
}

/// An object of a declared SubDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub struct ObjectOf {
    /// The SubDevice.
    pub subdevice: SubDeviceId,
    /// Index.
    pub index: u16,
    /// Subindex.
    pub sub_index: u8,
}

impl ObjectOf {
    /// The object of a SubDevice at an index and a subindex.
    pub const fn new(subdevice: SubDeviceId, index: u16, sub_index: u8) -> ObjectOf {
        ObjectOf { subdevice, index, sub_index }
    }
}

impl fmt::Display for ObjectOf {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "SubDevice {}: {:#06x}:{:02x}", self.subdevice, self.index, self.sub_index)
    }
}

impl Directory {
    pub(in crate::main_device) fn new(plans: &[Areas], layout: &Layout) -> Directory {
        let subdevices = plans.iter().enumerate().map(|(index, areas)| areas.directory(index, layout)).collect();
        let mut contributions = vec![0; plans.len()];
        let frames = layout.domains.iter().flat_map(|domain| &domain.frames);
        for (subdevice, wkc) in frames.flat_map(|f| &f.datagrams).flat_map(|datagram| &datagram.contributions) {
            if let Some(sum) = contributions.get_mut(*subdevice) {
                *sum += u32::from(wkc.0);
            }
        }
        let mut directory = Directory { subdevices, contributions, ..Directory::default() };
        directory.outputs = directory.output_ranges();
        directory
    }

    /// `repeats`: by SubDevice, what may be sent again, or why not everything may.
    pub(in crate::main_device) fn with_sent_once<T>(self, repeats: &[Result<T, SentOnce>]) -> Directory {
        let sent_once = repeats.iter().map(|repeat| repeat.as_ref().err().copied()).collect();
        Directory { sent_once, ..self }
    }

    /// The SubDevices of which not all process data is sent again when a frame is lost, in domains that do that
    /// ([`DomainConfig::sends_again`](super::super::DomainConfig::sends_again)), and why.
    pub fn sent_once(&self) -> impl Iterator<Item = (SubDeviceId, SentOnce)> {
        self.sent_once.iter().enumerate().filter_map(|(subdevice, reason)| Some((SubDeviceId(subdevice), (*reason)?)))
    }

    fn output_ranges(&self) -> Vec<(DomainId, Range<u64>)> {
        let areas = self.subdevices.iter().flatten().filter(|area| area.direction == Direction::Outputs);
        let range = |area: &AreaEntries| {
            let start = u64::from(area.placed.image_offset) * 8;
            (area.domain, start..start + u64::from(area.placed.area.length) * 8)
        };
        let mut ranges: Vec<_> = areas.map(range).filter(|(_, bits)| !bits.is_empty()).collect();
        ranges.put_in_order_by_key(|(domain, bits)| (*domain, bits.start));
        ranges.dedup_by(|(domain, bits), (domain_before, before)| {
            let continues = domain == domain_before && bits.start <= before.end;
            if continues {
                before.end = before.end.max(bits.end);
            }
            continues
        });
        ranges
    }

    /// Whether all these bits of a domain's image are outputs.
    pub fn are_outputs(&self, domain: DomainId, bits: Range<u64>) -> bool {
        let behind = self.outputs.partition_point(|(other, range)| (*other, range.start) <= (domain, bits.start));
        let before = behind.checked_sub(1).and_then(|at| self.outputs.get(at));
        bits.is_empty() || before.is_some_and(|(other, range)| *other == domain && bits.end <= range.end)
    }

    /// The object at a bit of a domain's image. For messages: it searches all entries.
    pub fn object_at(&self, domain: DomainId, bit: u64) -> Option<ObjectOf> {
        let covers = |entry: &Entry| {
            let start = u64::from(entry.bit_offset);
            entry.domain == domain && (start..start + u64::from(entry.bit_length)).contains(&bit)
        };
        self.subdevices.iter().enumerate().find_map(|(subdevice, areas)| {
            let mut entries = areas.iter().flat_map(|area| &area.entries);
            let found = entries.find(|entry| covers(&entry.place))?;
            Some(ObjectOf::new(SubDeviceId(subdevice), found.index, found.sub_index))
        })
    }

    /// Number of declared SubDevices.
    pub fn subdevice_count(&self) -> usize {
        self.subdevices.len()
    }

    /// The share of a SubDevice in the working counters of its domains.
    pub fn contribution(&self, subdevice: SubDeviceId) -> u32 {
        self.contributions.get(subdevice.0).copied().unwrap_or(0)
    }

    /// The working counter of a domain as IgH's interface expects it
    /// ([`expected_wkc_as_igh`](super::super::Declaration::expected_wkc_as_igh));
    /// [`crate::domain::DomainStatus::expected`] is that of the datagrams in use.
    pub fn expected_wkc_as_igh(&self, domain: DomainId) -> u32 {
        let areas = self.subdevices.iter().flatten().filter(|area| area.domain == domain);
        let mut placed: Vec<PlacedArea> = areas.map(|area| area.placed).collect();
        placed.put_in_order_by_key(|placed| placed.image_offset);
        let area = |placed: PlacedArea| (SubDeviceId(placed.area.subdevice), placed.area.direction, placed.area.length);
        expected_as_igh(placed.into_iter().map(area))
    }

    /// All areas of a SubDevice; an area that is in several domains once for each.
    pub fn areas(&self, subdevice: SubDeviceId) -> &[AreaEntries] {
        self.subdevices.get(subdevice.0).map_or(&[], Vec::as_slice)
    }

    /// The place of a PDO entry; the first one if it is mapped more than once.
    pub fn entry(&self, subdevice: SubDeviceId, index: u16, sub_index: u8) -> Option<Entry> {
        let entries = self.areas(subdevice).iter().flat_map(|area| &area.entries);
        entries.into_iter().find(|it| (it.index, it.sub_index) == (index, sub_index)).map(|it| it.place)
    }
}

/// Process data of a declared SubDevice: planned from its SII, or from the declaration if it is absent or its SII
/// cannot be used.
pub(in crate::main_device) enum Areas {
    /// Planned; `None` if no process data is exchanged in its target state.
    Planned(Option<SubDevicePlan>),
    Declared(Declared),
}

/// Data fixed by the declaration alone.
pub(in crate::main_device) struct Declared {
    areas: Vec<(u8, Direction, u16)>,
    config: Box<SubDeviceConfig>,
    /// It supports LRW.
    lrw: bool,
    /// Why it is not planned although it is present.
    unfit: Option<SetupError>,
}

impl Declared {
    /// For an absent SubDevice: it may not support LRW.
    pub fn absent(config: &SubDeviceConfig) -> Declared {
        let areas = declared_areas(config).unwrap_or_default();
        Declared { areas, config: Box::new(config.clone()), lrw: false, unfit: None }
    }

    /// For a present SubDevice that cannot be set up.
    pub fn unfit(config: &SubDeviceConfig, info: &SubDeviceInfo, error: SetupError) -> Declared {
        Declared { lrw: info.lrw_supported(), unfit: Some(error), ..Declared::absent(config) }
    }
}

impl Areas {
    pub(in crate::main_device) fn list(&self) -> Vec<(u8, Direction, u16)> {
        match self {
            Areas::Planned(plan) => plan.as_ref().map(planned_areas).unwrap_or_default(),
            Areas::Declared(declared) => declared.areas.clone(),
        }
    }

    /// Why a present SubDevice is not planned.
    pub(in crate::main_device) fn unfit(&self) -> Option<&SetupError> {
        match self {
            Areas::Planned(_) => None,
            Areas::Declared(declared) => declared.unfit.as_ref(),
        }
    }

    pub(in crate::main_device) fn lrw(&self) -> bool {
        match self {
            Areas::Planned(plan) => plan.as_ref().is_none_or(|plan| plan.lrw_supported),
            Areas::Declared(declared) => declared.lrw,
        }
    }

    pub(in crate::main_device) fn directory(&self, index: usize, layout: &Layout) -> Vec<AreaEntries> {
        let mut found = Vec::new();
        let mut places: Vec<(DomainId, PlacedArea)> = layout.areas_of(index).collect();
        // In the order of the SyncManagers; the places of one in the order of the domains.
        let listed = self.list();
        let rank = |placed: &PlacedArea| listed.iter().position(|(number, ..)| *number == placed.area.sync_manager);
        places.put_in_order_by_key(|(_, placed)| rank(placed).unwrap_or(listed.len()));
        for (domain, placed) in places {
            let (sync_manager, direction) = (placed.area.sync_manager, placed.area.direction);
            let entries = self.mapped(sync_manager).into_iter().filter(|entry| entry.index != 0).map(|entry| {
                let bit_offset = placed.image_offset * 8 + entry.bit_offset;
                let place = Entry { domain, bit_offset, bit_length: entry.bit_length.into() };
                PlacedEntry { index: entry.index, sub_index: entry.sub_index, place }
            });
            found.push(AreaEntries { domain, placed, direction, entries: entries.collect() });
        }
        found
    }

    /// Entries of an area in order, gaps included.
    pub(in crate::main_device) fn mapped(&self, sync_manager: u8) -> Vec<MappedEntry> {
        self.pdos(sync_manager).into_iter().flatten().collect()
    }

    /// Entries of an area by PDO, gaps included.
    pub(in crate::main_device) fn pdos(&self, sync_manager: u8) -> Vec<Vec<MappedEntry>> {
        match self {
            Areas::Planned(plan) => {
                let areas = plan.iter().flat_map(|plan| &plan.process_data);
                let pdos = areas.filter(|area| area.sync_manager == sync_manager).flat_map(|area| &area.pdos);
                pdos.map(|pdo| pdo.entries.clone()).collect()
            }
            Areas::Declared(Declared { config, .. }) => {
                let pdos: &[PdoMapping] = match &config.declared {
                    Some(all) => all.iter().find(|sm| sm.index == sync_manager).map_or(&[], |sm| &sm.pdos),
                    None => {
                        let mut all = config.pdos.iter().flatten();
                        all.find(|a| a.sync_manager == sync_manager).map_or(&[], |a| &a.pdos)
                    }
                };
                let mut bit_offset = 0;
                let mut place = |entry: &PdoEntry| {
                    let PdoEntry { index, sub_index, bit_length } = *entry;
                    let mapped = MappedEntry { index, sub_index, bit_offset, bit_length };
                    bit_offset += u32::from(bit_length);
                    mapped
                };
                pdos.iter().map(|pdo| pdo.entries.iter().flatten().map(&mut place).collect()).collect()
            }
        }
    }
}
