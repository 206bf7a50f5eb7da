//! Propagation delays, offsets and filters of all clocks (facts 7.1, 7.2).
//!
//! A closed ring is measured as a line: frames of the main link would not come back to where they went out. Its last port
//! is closed meanwhile, with the bit that opens it again by itself.

use alloc::string::{String, ToString};
use alloc::vec;
use alloc::vec::Vec;

use ringcat_wire::address::{StationAddress, Wkc};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::map;

use super::{Clocks, SharedClocks};
use crate::clocks::delay::entry_ports;
use crate::clocks::{Delays, Latched, Measurements, propagation, round};
use crate::link::{Link, LinkSet};
use crate::procedures::fleet::SharedFleet;
use crate::ring::RingState;
use crate::supervisor::{Bus, BusError};
use crate::topology::{PortOf, Topology};

/// Bytes from DC_RECEIVE_TIME to the end of DC_RECEIVE_TIME_EPU.
const LATCHED_LEN: usize = 32;
/// A measurement whose frames were lost is taken again so often in all.
const MOST_FAILURES: u32 = 16;
/// Low byte of DL_CONTROL: forwarding rule, and the bit for settings that hold for about a second.
const LASTING: u8 = 0x01;
const TEMPORARY: u8 = 0x03;
/// Reset value of DC_SPEED_COUNTER_START; writing it restarts the filters.
const SPEED_COUNTER_START: u16 = 0x1000;

/// Measures all delays and writes delays and offsets.
pub(super) async fn set_up(bus: &Bus, fleet: &SharedFleet) -> Result<(), String> {
    let topology = fleet.access().topology.clone();
    let closed = close_ring(bus, &fleet.clocks, &topology).await;
    let result = match &closed {
        Ok(_) => measure_and_write(bus, &fleet.clocks, &topology).await,
        Err(error) => Err(error.to_string()),
    };
    if let Ok(Some((station, port))) = closed {
        open_ring(bus, station, port).await;
    }
    fleet.clocks.access().is_measuring = false;
    result
}

/// Makes a line of a closed ring. Returns where.
async fn close_ring(
    bus: &Bus,
    clocks: &SharedClocks,
    topology: &Topology,
) -> Result<Option<(StationAddress, u8)>, BusError> {
    let is_closed = bus.links() == LinkSet::Ring && bus.ring() == RingState::Closed;
    let last = topology.open_ports.last().filter(|_| is_closed && topology.redundant_head.is_none());
    let Some(PortOf { node, port }) = last.copied() else { return Ok(None) };
    let Some(station) = clocks.access().nodes.get(node).map(|node| node.station) else { return Ok(None) };
    clocks.access().is_measuring = true;
    bus.fpwr(station, map::DL_CONTROL, &[TEMPORARY, 0b11 << (2 * port)]).await?;
    Ok(Some((station, port)))
}

async fn open_ring(bus: &Bus, station: StationAddress, _port: u8) {
    // Where this is lost, too, the port opens by itself.
    let _ = bus.fpwr(station, map::DL_CONTROL, &[LASTING, 0]).await;
}

async fn measure_and_write(bus: &Bus, clocks: &SharedClocks, topology: &Topology) -> Result<(), String> {
    let count = clocks.access().config.as_ref().map_or(1, |config| config.measurements.clamp(1, 64));
    let entries = entry_ports(topology);
    enter_backwards(bus, clocks, &entries).await;
    let mut measurements = Measurements::new(entries);
    let mut failures = 0;
    while measurements.count() < count {
        match latch(bus, clocks).await {
            Ok(latched) => measurements.add(&latched),
            Err(error) if failures >= MOST_FAILURES => return Err(error.to_string()),
            Err(_) => failures += 1,
        }
    }
    let reference = {
        let mut clocks = clocks.access();
        let now = clocks.elect(|_, _| true);
        clocks.reference = now;
        now
    };
    let Some(reference) = reference else { return Err("no SubDevice has a clock".to_string()) };
    let delays = propagation(topology, &measurements.mean(reference));
    take_over(&mut clocks.access(), &delays, &measurements.drift_ppb(reference));
    let wanted = bus.now().0.wrapping_add(clocks.access().epoch);
    let latched = latch(bus, clocks).await.map_err(|error| error.to_string())?;
    set_offsets(&mut clocks.access(), &latched, wanted);
    write_all(bus, clocks).await.map_err(|error| error.to_string())?;
    clocks.access().is_set_up = true;
    Ok(())
}

/// Controllers that latch in one direction only are told in which the frame comes (facts 3.12, 7.5).
async fn enter_backwards(bus: &Bus, clocks: &SharedClocks, entries: &[u8]) {
    let stations: Vec<StationAddress> = {
        let clocks = clocks.access();
        let backwards = clocks.nodes.iter().zip(entries).filter(|(node, entry)| node.has_clock && **entry != 0);
        backwards.map(|(node, _)| node.station).collect()
    };
    // Those without the register do not answer.
    let _ = bus.gather(stations, |bus, station| async move { bus.fpwr(station, map::DC_LATCH_MODE, &[1]).await }).await;
}

/// Lets all clocks latch one frame and reads what they have.
pub(super) async fn latch(bus: &Bus, clocks: &SharedClocks) -> Result<Vec<Option<Latched>>, BusError> {
    let stations: Vec<(StationAddress, bool)> =
        clocks.access().nodes.iter().map(|node| (node.station, node.has_clock)).collect();
    let with_clock = stations.iter().filter(|(_, has_clock)| *has_clock).count() as u16;
    let target = Target::Broadcast(map::DC_RECEIVE_TIME);
    bus.transfer(Command::Bwr, target, vec![0; 4], Some(Wkc(with_clock))).await?;
    let read = bus.gather(stations, |bus, (station, has_clock)| async move {
        if !has_clock {
            return Ok(None);
        }
        let bytes: [u8; LATCHED_LEN] = match bus.fprd_array(station, map::DC_RECEIVE_TIME).await {
            Ok(bytes) => bytes,
            // One that is gone is one without a clock.
            Err(BusError::Wkc { .. }) => return Ok(None),
            Err(error) => return Err(error),
        };
        let word = |at: usize| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
        let unit = u64::from(word(24)) | u64::from(word(28)) << 32;
        Ok(Some(Latched { ports: [word(0), word(4), word(8), word(12)], unit }))
    });
    read.await.into_iter().collect()
}

fn take_over(clocks: &mut Clocks, delays: &Delays, drift: &[Option<i64>]) {
    for (position, node) in clocks.nodes.iter_mut().enumerate() {
        node.unit = delays.units.get(position).copied().flatten();
        node.drift_ppb = drift.get(position).copied().flatten().unwrap_or(0);
        let tree = delays.trees.get(position).copied().unwrap_or(0);
        node.link = Some(if tree == 0 { Link::Main } else { Link::Redundant });
    }
    for link in Link::ALL {
        clocks.refer(link);
    }
}

impl Clocks {
    /// Position of the clock that the others on a link follow: the reference of the segment where it is there, else the
    /// first that frames meet.
    pub fn reference_on(&self, link: Link) -> Option<usize> {
        let here = |position: &usize| {
            let node = &self.nodes[*position];
            node.has_clock && node.link == Some(link) && node.unit.is_some()
        };
        let all = || (0..self.nodes.len()).filter(here);
        let first = || all().min_by_key(|position| self.nodes[*position].unit);
        self.reference.filter(here).or_else(first)
    }

    /// Delays on a link count from the clock that is followed there. Returns whether any changed.
    pub fn refer(&mut self, link: Link) -> bool {
        let Some(reference) = self.reference_on(link).and_then(|position| self.nodes[position].unit) else {
            return false;
        };
        let mut changed = false;
        for node in self.nodes.iter_mut().filter(|node| node.link == Some(link)) {
            let delay = node.unit.map_or(0, |unit| round(unit - reference));
            changed |= node.delay_ns != delay;
            node.delay_ns = delay;
        }
        changed
    }
}

/// Offsets such that all show `wanted` where the frame came in, plus their way.
fn set_offsets(clocks: &mut Clocks, latched: &[Option<Latched>], wanted: u64) {
    for (node, latched) in clocks.nodes.iter_mut().zip(latched) {
        let Some(latched) = latched else { continue };
        let unit = node.unit.map_or(0, round);
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

/// DC_SYSTEM_TIME_OFFSET and DC_SYSTEM_TIME_DELAY.
fn registers(node: &super::Node) -> [u8; 12] {
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
        let here = clocks.nodes.iter().filter(|node| node.has_clock && node.link == Some(link));
        here.map(|node| (node.station, node.delay_ns as u32)).collect()
    };
    let written = bus.gather(all, |bus, (station, delay)| async move {
        bus.fpwr(station, map::DC_SYSTEM_TIME_DELAY, &delay.to_le_bytes()).await
    });
    written.await.into_iter().filter(|result| !matches!(result, Err(BusError::Wkc { .. }))).collect()
}

/// Sets up one clock that has lost its registers: offset by a frame that it and its reference latch.
pub(super) async fn set_up_one(bus: &Bus, clocks: &SharedClocks, position: usize) -> Result<(), BusError> {
    let latched = latch(bus, clocks).await?;
    let (station, registers) = {
        let mut clocks = clocks.access();
        let link = clocks.nodes[position].link.unwrap_or(Link::Main);
        let reference = clocks.reference_on(link).filter(|reference| *reference != position);
        let time = |position: usize| latched.get(position).copied().flatten().map(|latched| latched.unit);
        let (Some(reference), Some(own)) = (reference, time(position)) else { return Ok(()) };
        let Some(local) = time(reference) else { return Ok(()) };
        let system = local.wrapping_add_signed(clocks.nodes[reference].offset_ns);
        let node = &mut clocks.nodes[position];
        node.offset_ns = system.wrapping_add_signed(node.delay_ns).wrapping_sub(own) as i64;
        (node.good, node.difference_ns, node.worst_ns) = (0, None, 0);
        (node.station, registers(node))
    };
    write(bus, station, registers).await
}
