//! Logical addresses of the process data: FMMUs, and the cyclic commands.
//!
//! The logical address of a byte of process data is its place in the image plus the beginning of a window, one window
//! for the outputs and one for the inputs of each task, and one for what is in LRW commands. So the offset of a command
//! in the image is its logical address minus the beginning of the window.

mod cyclic;

use std::collections::{BTreeMap, HashMap};
use std::ops::Range;

use ringcat_engine::info::Direction;
use ringcat_wire::address::LogicalAddress;
use ringcat_wire::register::Fmmu;

use super::error::ExportError;
use super::lrw::Lrw;
use crate::configuration::{Configuration, ImageArea};

/// The first window.
const FIRST: u32 = 0x0100_0000;
/// Windows begin at multiples of this, with as much room between them.
const GRAIN: usize = 0x1000;
/// Beyond the last window.
const END: u32 = 0x8000_0000;
/// FMMUs of a SubDevice controller.
const FMMUS: usize = 16;
/// Data bytes of a datagram (protocol 1.3).
const MAX_DATA: usize = 1486;

/// Process data that one kind of command exchanges.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Stream {
    Outputs,
    Inputs,
    Both,
}

/// Commands of a task and a stream.
#[derive(Debug)]
struct Window {
    begin: u32,
    /// Areas of the image by their index, in the order of their first bytes; one list per command.
    commands: Vec<Vec<usize>>,
}

/// The FMMUs and the commands of a network.
#[derive(Debug, Default)]
pub(super) struct Layout {
    fmmus: Vec<Vec<Fmmu>>,
    windows: BTreeMap<(usize, Stream), Window>,
}

impl Layout {
    pub fn of(whole: &Configuration, lrw: &Lrw) -> Result<Layout, ExportError> {
        let domains = Domains::of(whole);
        check_places(whole, &domains)?;
        let mut streams: BTreeMap<(usize, Stream), Vec<usize>> = BTreeMap::new();
        for (number, area) in whole.image.areas.iter().enumerate() {
            let Some(sync_manager) = area.sync_manager else { continue };
            let task = domains.of_area(area.subdevice, sync_manager).ok_or_else(|| {
                let what = format!("SyncManager {sync_manager}");
                ExportError::of(whole, area.subdevice, what, "it has a place in the image, but is in no domain")
            })?;
            streams.entry((task, stream(area, lrw))).or_default().push(number);
        }
        let room = whole.image.inputs_len.max(whole.image.outputs_len);
        let step = u32::try_from((room / GRAIN + 2) * GRAIN).unwrap_or(END);
        let mut layout = Layout { fmmus: vec![Vec::new(); whole.declaration.subdevices.len()], ..Layout::default() };
        let mut begin = FIRST;
        for (key, numbers) in streams {
            let end = begin.saturating_add(step);
            if end > END {
                let reason = "all tasks together have more logical addresses than there are";
                return Err(ExportError::whole("process image", reason));
            }
            let commands = commands(whole, numbers)?;
            layout.windows.insert(key, Window { begin, commands });
            begin = end;
        }
        layout.add_fmmus(whole)?;
        Ok(layout)
    }

    /// The FMMUs of a SubDevice.
    pub fn fmmus(&self, subdevice: usize) -> &[Fmmu] {
        self.fmmus.get(subdevice).map(Vec::as_slice).unwrap_or_default()
    }

    fn add_fmmus(&mut self, whole: &Configuration) -> Result<(), ExportError> {
        let mut placed: Vec<(usize, u32)> = Vec::new();
        for window in self.windows.values() {
            placed.extend(window.commands.iter().flatten().map(|number| (*number, window.begin)));
        }
        placed.sort_unstable();
        for (number, begin) in placed {
            let area = &whole.image.areas[number];
            let fmmu = fmmu(whole, area, begin).ok_or_else(|| {
                let reason = "its process data is not in a SyncManager of the declaration";
                ExportError::of(whole, area.subdevice, "process image", reason)
            })?;
            let fmmus = &mut self.fmmus[area.subdevice];
            if fmmus.len() == FMMUS {
                let reason = format!("its process data has more than {FMMUS} separate places in the image");
                return Err(ExportError::of(whole, area.subdevice, "process image", reason));
            }
            fmmus.push(fmmu);
        }
        Ok(())
    }
}

fn stream(area: &ImageArea, lrw: &Lrw) -> Stream {
    match area.direction {
        _ if lrw.contains(&area.subdevice) => Stream::Both,
        Direction::Outputs => Stream::Outputs,
        Direction::Inputs => Stream::Inputs,
    }
}

/// A part of a SubDevice in a domain: the domain, the SyncManagers; `None`: all.
type Part<'a> = (usize, Option<&'a [u8]>);

/// The domain of each SyncManager, by SubDevice.
struct Domains<'a> {
    members: HashMap<usize, Vec<Part<'a>>>,
}

impl<'a> Domains<'a> {
    fn of(whole: &'a Configuration) -> Domains<'a> {
        let mut members: HashMap<usize, Vec<_>> = HashMap::new();
        for (task, domain) in whole.declaration.domains.iter().enumerate() {
            for member in &domain.members {
                members.entry(member.subdevice.0).or_default().push((task, member.sync_managers.as_deref()));
            }
        }
        Domains { members }
    }

    fn of_area(&self, subdevice: usize, sync_manager: u8) -> Option<usize> {
        let is_in = |numbers: Option<&[u8]>| numbers.is_none_or(|numbers| numbers.contains(&sync_manager));
        self.members.get(&subdevice)?.iter().find(|(_, numbers)| is_in(*numbers)).map(|(task, _)| *task)
    }
}

/// Exchanged process data needs a place in the image: the offsets of the commands are there.
fn check_places(whole: &Configuration, domains: &Domains<'_>) -> Result<(), ExportError> {
    let places: std::collections::HashSet<(usize, u8)> =
        whole.image.areas.iter().filter_map(|area| Some((area.subdevice, area.sync_manager?))).collect();
    for (index, config) in whole.declaration.subdevices.iter().enumerate() {
        let areas = config.declared.iter().flatten().filter_map(|it| it.area()).filter(|area| area.length > 0);
        for area in areas {
            let is_exchanged = domains.of_area(index, area.sync_manager).is_some();
            if is_exchanged && !places.contains(&(index, area.sync_manager)) {
                let what = format!("SyncManager {}", area.sync_manager);
                return Err(ExportError::of(whole, index, what, "its process data has no place in the image"));
            }
        }
    }
    Ok(())
}

/// The bytes of the image with bits of an area.
fn bytes(area: &ImageArea) -> Range<usize> {
    let (begin, end) = (u64::from(area.image_bit), u64::from(area.image_bit) + u64::from(area.bits));
    (begin / 8) as usize..end.div_ceil(8) as usize
}

/// Cuts the areas of a stream into commands: without gaps, and without a byte in two commands.
fn commands(whole: &Configuration, mut numbers: Vec<usize>) -> Result<Vec<Vec<usize>>, ExportError> {
    let bytes = |number: &usize| bytes(&whole.image.areas[*number]);
    numbers.sort_by_key(|number| (bytes(number).start, *number));
    // Areas that share bytes stay together.
    let mut joined: Vec<(Range<usize>, Vec<usize>)> = Vec::new();
    for number in numbers {
        let own = bytes(&number);
        match joined.last_mut().filter(|(range, _)| own.start < range.end) {
            Some((range, areas)) => {
                range.end = range.end.max(own.end);
                areas.push(number);
            }
            None => joined.push((own, vec![number])),
        }
    }
    let mut commands: Vec<(Range<usize>, Vec<usize>)> = Vec::new();
    for (range, areas) in joined {
        if range.len() > MAX_DATA {
            let reason = format!("{} bytes that cannot be cut, more than {MAX_DATA} of a datagram", range.len());
            let subdevice = whole.image.areas[areas[0]].subdevice;
            return Err(ExportError::of(whole, subdevice, "process data", reason));
        }
        match commands.last_mut().filter(|(last, _)| range.start == last.end && range.end - last.start <= MAX_DATA) {
            Some((last, all)) => {
                last.end = range.end;
                all.extend(areas);
            }
            None => commands.push((range, areas)),
        }
    }
    Ok(commands.into_iter().map(|(_, areas)| areas).collect())
}

/// The FMMU of an area; `None`: it is in no declared SyncManager.
fn fmmu(whole: &Configuration, area: &ImageArea, begin: u32) -> Option<Fmmu> {
    let declared = whole.declaration.subdevices[area.subdevice].declared.as_ref()?;
    let sync_manager = declared.iter().find(|it| Some(it.index) == area.sync_manager)?;
    let (first, last) = (area.image_bit, area.image_bit.checked_add(area.bits.checked_sub(1)?)?);
    Some(Fmmu {
        logical_start: LogicalAddress(begin.checked_add(first / 8)?),
        length: u16::try_from(last / 8 - first / 8 + 1).ok()?,
        logical_start_bit: (first % 8) as u8,
        logical_stop_bit: (last % 8) as u8,
        physical_start: sync_manager.register.start.checked_add(u16::try_from(area.bit_offset / 8).ok()?)?,
        physical_start_bit: (area.bit_offset % 8) as u8,
        read: area.direction == Direction::Inputs,
        write: area.direction == Direction::Outputs,
        active: true,
        reserved: [0; 8],
    })
}

/// Whether in the LRW commands inputs of a SubDevice would replace outputs for one behind it.
pub(super) fn overlaps_in_lrw(whole: &Configuration, lrw: &Lrw) -> bool {
    let domains = Domains::of(whole);
    let mut by_task: BTreeMap<usize, Vec<&ImageArea>> = BTreeMap::new();
    for area in whole.image.areas.iter().filter(|area| lrw.contains(&area.subdevice)) {
        let task = area.sync_manager.and_then(|sync_manager| domains.of_area(area.subdevice, sync_manager));
        by_task.entry(task.unwrap_or_default()).or_default().push(area);
    }
    by_task.into_values().any(|mut areas| {
        areas.sort_by_key(|area| area.image_bit);
        let mut outputs: Vec<&ImageArea> = Vec::new();
        let mut inputs: Vec<&ImageArea> = Vec::new();
        areas.into_iter().any(|area| {
            let (own, others) = match area.direction {
                Direction::Outputs => (&mut outputs, &mut inputs),
                Direction::Inputs => (&mut inputs, &mut outputs),
            };
            let end = |other: &ImageArea| u64::from(other.image_bit) + u64::from(other.bits);
            others.retain(|other| end(other) > u64::from(area.image_bit));
            let is_behind = |other: &&ImageArea| match area.direction {
                Direction::Outputs => area.subdevice > other.subdevice,
                Direction::Inputs => other.subdevice > area.subdevice,
            };
            own.push(area);
            others.iter().any(is_behind)
        })
    })
}
