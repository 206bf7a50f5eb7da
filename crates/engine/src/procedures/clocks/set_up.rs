//! Delays, offsets and filters of all clocks (protocol 7.1, 7.2): at the beginning, after each change of the segment,
//! and of one clock that has lost its registers.

use alloc::string::{String, ToString};
use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;
use ringcat_wire::register::map;

use super::measure::{Measured, Opening, latch, measure};
use crate::clocks::{Latched, Unknown, round};
use crate::link::Link;
use crate::procedures::shared_clocks::{Clocks, Node, SharedClocks};
use crate::procedures::shared_segment::SharedSegment;
use crate::supervisor::{Bus, BusError};

/// Reset value of DC_SPEED_COUNTER_START; writing it restarts the filters.
const SPEED_COUNTER_START: u16 = 0x1000;
/// DC_FILTER_DIFFERENCE of clocks that follow one that frames meet before: what they are told is exact, and a mean that
/// lags behind the samples makes the loop swing where drift is large.
const EXACT_DEPTH: u8 = 0;
/// Of clocks that are told what the host believes: its reset value, which takes most of the host's jitter out.
const HOST_DEPTH: u8 = 4;
/// DC_FILTER_SPEED: its reset value.
const SPEED_DEPTH: u8 = 12;
/// Of a reference that is steered: the host's jitter must not change its speed.
const STEADY_DEPTH: u8 = 15;
/// Delays that differ by no more than this from what is written are what the same way gives when it is measured again.
const SAME_NS: i64 = 30;

/// Measures all delays and writes delays and offsets.
pub(super) async fn set_up(bus: &Bus, segment: &SharedSegment, opening: Opening) -> Result<(), String> {
    let clocks = &segment.clocks;
    let text = |error: BusError| error.to_string();
    let reference = {
        let mut clocks = clocks.access();
        let now = clocks.elect(|_, _| true);
        clocks.reference = now;
        now
    };
    if reference.is_none() {
        return Err("no SubDevice has a clock".to_string());
    }
    let measured = measure(bus, segment, opening).await?;
    take_over(&mut clocks.access(), &measured);
    let stations = clocks.access().stations();
    let wanted = bus.now().0.wrapping_add(clocks.access().epoch);
    let latched = latch(bus, clocks, &stations, None).await.map_err(text)?;
    set_offsets(&mut clocks.access(), &latched, wanted);
    set_filters(bus, clocks).await;
    write_all(bus, clocks).await.map_err(text)?;
    clocks.access().is_set_up = true;
    Ok(())
}

/// Measures all delays anew. Where some on a link are not what they were, those of that link are written, after `hold`:
/// nobody must be told a time meanwhile. Returns how many were written with another value, and the largest change.
pub(super) async fn measure_again(bus: &Bus, segment: &SharedSegment, hold: impl Fn()) -> Result<(usize, u32), String> {
    let clocks = &segment.clocks;
    let measured = measure(bus, segment, Opening::Nothing).await?;
    let before: Vec<Node> = clocks.access().nodes.clone();
    let changed: Vec<Link> = {
        let mut clocks = clocks.access();
        take_over(&mut clocks, &measured);
        Link::ALL.into_iter().filter(|link| !keep_same(&mut clocks, &before, *link)).collect()
    };
    for link in changed {
        hold();
        write_delays(bus, clocks, link).await.map_err(|error| error.to_string())?;
    }
    let clocks = clocks.access();
    let change = |(node, before): (&Node, &Node)| (node.delay_ns - before.delay_ns).unsigned_abs();
    let changes = clocks.nodes.iter().zip(&before).map(change).filter(|change| *change > 0);
    Ok((changes.clone().count(), changes.max().unwrap_or(0).min(u32::MAX.into()) as u32))
}

/// Where all delays on a link are what they were, what is known stays as it was: it may count from one place on both
/// links, which what is measured in a broken ring does not. Returns whether it is so.
fn keep_same(clocks: &mut Clocks, before: &[Node], link: Link) -> bool {
    let here: Vec<usize> = (0..before.len())
        .filter(|index| clocks.nodes[*index].has_delay() && clocks.nodes[*index].link == Some(link))
        .collect();
    let origin = here.first().map(|index| before[*index].origin);
    let is_same = |index: &usize| {
        let (now, before) = (&clocks.nodes[*index], &before[*index]);
        let is_known = before.link == Some(link) && before.unit.is_some() && Some(before.origin) == origin;
        is_known && (now.delay_ns - before.delay_ns).abs() <= SAME_NS
    };
    if !here.iter().all(is_same) {
        return false;
    }
    for index in here {
        let (node, before) = (&mut clocks.nodes[index], &before[index]);
        (node.unit, node.origin, node.delay_ns) = (before.unit, before.origin, before.delay_ns);
    }
    true
}

/// Takes over what was measured, on whose link everybody is, and from whom delays count there.
fn take_over(clocks: &mut Clocks, measured: &Measured) {
    clocks.measured = clocks.measured.wrapping_add(1);
    let are_estimated = clocks.config.as_ref().is_some_and(|config| config.estimated_delays);
    let positions: Vec<(StationAddress, usize)> =
        clocks.nodes.iter().map(|node| (node.station, usize::from(node.position))).collect();
    for node in &mut clocks.nodes {
        let Some(at) = measured.stations.iter().position(|station| *station == node.station) else { continue };
        let tree = measured.delays.trees.get(at).copied().unwrap_or(0);
        // Later it runs as fast as the reference, because its loop makes it.
        let is_free = node.unit.is_none() || node.is_unset;
        if let Some(drift_ppb) = measured.drift_ppb.get(at).copied().flatten().filter(|_| is_free) {
            node.drift_ppb = drift_ppb;
        }
        node.unit = measured.delays.units.get(at).copied().flatten();
        node.hidden = None;
        if let Some(unknown) = measured.delays.unknown.iter().find(|unknown| unknown.node == at) {
            let fork =
                unknown.fork.and_then(|fork| positions.iter().find(|(station, _)| *station == measured.stations[fork]));
            node.hidden = Some(Unknown { fork: fork.map(|(_, position)| *position), ..*unknown });
            node.unit = unknown.range.filter(|_| are_estimated).map(|(least, most)| (least + most) / 2);
            // What it had at another place does not count here.
            if node.is_unset {
                node.delay_ns = 0;
            }
        }
        node.origin = 2 * clocks.measured + tree as u32;
        node.link = Some(if tree == 0 { Link::Main } else { Link::Redundant });
    }
    for link in Link::ALL {
        clocks.refer(link);
    }
}

impl Clocks {
    /// Station addresses of all clocks and those without one.
    fn stations(&self) -> Vec<StationAddress> {
        self.nodes.iter().map(|node| node.station).collect()
    }

    /// Index of the clock that the others on a link follow: the reference of the segment where it is there, else the
    /// first that frames meet. Nobody where it is not known what is between them.
    pub fn reference_on(&self, link: Link) -> Option<usize> {
        if self.is_mixed(link) {
            return None;
        }
        let here = |index: &usize| {
            let node = &self.nodes[*index];
            node.has_clock && !node.is_unset && node.link == Some(link) && node.unit.is_some()
        };
        let all = || (0..self.nodes.len()).filter(here);
        let first = || all().min_by_key(|index| self.nodes[*index].unit);
        self.reference.filter(here).or_else(first)
    }

    /// DC_FILTER_DIFFERENCE and DC_FILTER_SPEED as they should be.
    fn filter_depths(&self, index: usize) -> [u8; 2] {
        let node = &self.nodes[index];
        let reference = self.reference_on(node.link.unwrap_or(Link::Main));
        // A SubDevice is behind its reference where frames meet it later.
        let is_behind = reference.is_some_and(|reference| match node.unit {
            Some(_) => node.unit > self.nodes[reference].unit,
            None => node.position > self.nodes[reference].position,
        });
        let follows_host = self.config.as_ref().is_some_and(|config| config.bus_shift);
        let is_steered = reference == Some(index) && (follows_host || self.reference != Some(index));
        let difference = if is_behind { EXACT_DEPTH } else { HOST_DEPTH };
        [difference, if is_steered { STEADY_DEPTH } else { SPEED_DEPTH }]
    }

    /// Whether delays on a link count from different places.
    pub fn is_mixed(&self, link: Link) -> bool {
        let mut here =
            self.nodes.iter().filter(|node| node.has_clock && node.link == Some(link) && node.unit.is_some());
        let first = here.next().map(|node| node.origin);
        here.any(|node| Some(node.origin) != first)
    }

    /// Delays on a link count from the clock that is followed there. Returns whether any changed.
    pub fn refer(&mut self, link: Link) -> bool {
        let Some(reference) = self.reference_on(link).and_then(|index| self.nodes[index].unit) else {
            return false;
        };
        let mut changed = false;
        for node in self.nodes.iter_mut().filter(|node| node.link == Some(link)) {
            let Some(unit) = node.unit else { continue };
            let delay = round(unit - reference);
            changed |= node.delay_ns != delay;
            node.delay_ns = delay;
        }
        changed
    }
}

/// Offsets such that all show `wanted` where the frame came in, plus their way.
fn set_offsets(clocks: &mut Clocks, latched: &[Option<Latched>], wanted: u64) {
    let references = Link::ALL.map(|link| clocks.reference_on(link).and_then(|index| clocks.nodes[index].unit));
    for (node, latched) in clocks.nodes.iter_mut().zip(latched) {
        let Some(latched) = latched else { continue };
        // Without a delay it shows what it is told: the time at which the frame passes the reference.
        let told = || references[usize::from(node.link == Some(Link::Redundant))];
        let unit = node.unit.or_else(told).map_or(0, round);
        node.offset_ns = wanted.wrapping_add_signed(unit).wrapping_sub(latched.unit) as i64;
    }
}

/// Writes offset and delay of all clocks and restarts their filters.
async fn write_all(bus: &Bus, clocks: &SharedClocks) -> Result<(), BusError> {
    let all: Vec<(StationAddress, [u8; 12])> = {
        let clocks = clocks.access();
        clocks.nodes.iter().filter(|node| node.has_clock).map(|node| (node.station, registers(node))).collect()
    };
    let written = bus.gather(all, |bus, (station, registers)| async move { write(&bus, station, registers).await });
    // Who is gone is set up when it comes back.
    written.await.into_iter().filter(|result| !matches!(result, Err(BusError::Wkc { .. }))).collect()
}

/// Writes the filter depths of those for whom they are others than before: references and clocks in front of them are
/// told what the host believes, all others what a reference shows.
pub(super) async fn set_filters(bus: &Bus, clocks: &SharedClocks) {
    let all: Vec<(usize, StationAddress, [u8; 2])> = {
        let clocks = clocks.access();
        let nodes = || clocks.nodes.iter().enumerate().filter(|(_, node)| node.has_clock && node.link.is_some());
        let depths = |(index, node): (usize, &Node)| (index, node.station, clocks.filter_depths(index));
        nodes().map(depths).filter(|(index, _, depths)| clocks.nodes[*index].filter_depths != Some(*depths)).collect()
    };
    let written = bus.gather(all, |bus, (index, station, depths)| async move {
        bus.fpwr(station, map::DC_FILTER_DIFFERENCE, &depths).await.ok().map(|()| (index, depths))
    });
    // Who has no such registers, or is gone, stays as it is.
    for (index, depths) in written.await.into_iter().flatten() {
        clocks.access().nodes[index].filter_depths = Some(depths);
    }
}

/// DC_SYSTEM_TIME_OFFSET and DC_SYSTEM_TIME_DELAY.
fn registers(node: &Node) -> [u8; 12] {
    let mut bytes = [0; 12];
    bytes[..8].copy_from_slice(&node.offset_ns.to_le_bytes());
    bytes[8..].copy_from_slice(&(node.delay_ns as u32).to_le_bytes());
    bytes
}

async fn write(bus: &Bus, station: StationAddress, registers: [u8; 12]) -> Result<(), BusError> {
    bus.fpwr(station, map::DC_SYSTEM_TIME_OFFSET, &registers).await?;
    bus.fpwr(station, map::DC_SPEED_COUNTER_START, &SPEED_COUNTER_START.to_le_bytes()).await
}

/// Writes the delays of those on a link, without touching filters.
pub(super) async fn write_delays(bus: &Bus, clocks: &SharedClocks, link: Link) -> Result<(), BusError> {
    let all: Vec<(StationAddress, u32)> = {
        let clocks = clocks.access();
        let here = clocks.nodes.iter().filter(|node| node.has_delay() && node.link == Some(link));
        here.map(|node| (node.station, node.delay_ns as u32)).collect()
    };
    let written = bus.gather(all, |bus, (station, delay)| async move {
        bus.fpwr(station, map::DC_SYSTEM_TIME_DELAY, &delay.to_le_bytes()).await
    });
    written.await.into_iter().filter(|result| !matches!(result, Err(BusError::Wkc { .. }))).collect()
}

/// Sets up one clock that has lost its registers: offset by a frame that it and its reference latch. Where nobody else
/// has the time, the host has.
pub(super) async fn set_up_one(bus: &Bus, clocks: &SharedClocks, index: usize) -> Result<(), BusError> {
    let host = bus.now().0;
    let stations = clocks.access().stations();
    let latched = latch(bus, clocks, &stations, None).await?;
    let (station, registers) = {
        let mut clocks = clocks.access();
        let link = clocks.nodes[index].link.unwrap_or(Link::Main);
        let time = |index: usize| latched.get(index).copied().flatten().map(|latched| latched.unit);
        let Some(own) = time(index) else { return Ok(()) };
        let reference = clocks.reference_on(link).filter(|reference| *reference != index);
        let system = match reference.and_then(|reference| Some((reference, time(reference)?))) {
            Some((reference, local)) => local.wrapping_add_signed(clocks.nodes[reference].offset_ns),
            None => host.wrapping_add(clocks.epoch),
        };
        let node = &mut clocks.nodes[index];
        node.offset_ns = system.wrapping_add_signed(node.delay_ns).wrapping_sub(own) as i64;
        (node.good, node.difference_ns, node.average, node.worst_ns) = (0, None, None, 0);
        (node.station, registers(node))
    };
    write(bus, station, registers).await?;
    clocks.access().nodes[index].is_unset = false;
    set_filters(bus, clocks).await;
    Ok(())
}
