//! Delays, offsets and filters are measured and written (protocol 7.1, 7.2): of all clocks at the beginning, after each
//! change of the segment, and of one clock that has lost its registers.

use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;
use ringcat_wire::register::map;

use super::measure::{Opening, latch, measure};
use crate::event::Subject;
use crate::link::Link;
use crate::procedures::shared_segment::SharedSegment;
use crate::segment::clocks::{ClockFinding, ClockKey, ClockVersions, LatchedTimes, Node};
use crate::supervisor::{Bus, BusError};
use crate::time::Instant;

/// Reset value of DC_SPEED_COUNTER_START; writing it restarts the filters.
const SPEED_COUNTER_START: u16 = 0x1000;

/// Measures all delays and writes delays and offsets. The set-up has begun, in this version.
pub(super) async fn set_up(
    bus: &Bus,
    segment: &SharedSegment,
    versions: ClockVersions,
    opening: Opening,
) -> Result<(), String> {
    let text = |error: BusError| error.to_string();
    if segment.view().clocks().reference.is_none() {
        return Err("no SubDevice has a clock".to_string());
    }
    let measured = measure(bus, segment, opening).await?;
    segment.find_of_clocks(versions, ClockFinding::Measured(&measured));
    let (keys, epoch) = {
        let view = segment.view();
        (view.clocks().keys(), view.clocks().epoch)
    };
    bus.step(Subject::Clocks, || format!("delays measured; offsets of {} clocks follow", keys.len()));
    // The frame may have waited for an empty wire: its time counts.
    let (sent_at, latched) = latched_times(bus, segment, &keys).await.map_err(text)?;
    let wanted = sent_at.0.wrapping_add(epoch);
    segment.find_of_clocks(versions, ClockFinding::Latched { latched: &latched, wanted });
    set_filters(bus, segment).await;
    write_all(bus, segment).await.map_err(text)
}

/// Measures all delays again and writes those of the links on which a delay has changed.
pub(super) async fn measure_again(bus: &Bus, segment: &SharedSegment, versions: ClockVersions) -> Result<(), String> {
    let measured = measure(bus, segment, Opening::Nothing).await?;
    segment.find_of_clocks(versions, ClockFinding::MeasuredAgain(&measured));
    let links = segment.view().clocks().unwritten();
    for link in links {
        write_delays(bus, segment, link).await.map_err(|error| error.to_string())?;
    }
    Ok(())
}

/// Writes offset and delay of all clocks and restarts their filters.
async fn write_all(bus: &Bus, segment: &SharedSegment) -> Result<(), BusError> {
    let all: Vec<(StationAddress, [u8; 12])> = {
        let view = segment.view();
        let with_clock = view.clocks().nodes.iter().filter(|node| node.has_clock);
        with_clock.map(|node| (node.station, registers(node))).collect()
    };
    let written = bus.gather(all, |bus, (station, registers)| async move { write(&bus, station, registers).await });
    // An absent SubDevice is set up when it comes back.
    written.await.into_iter().filter(|result| !matches!(result, Err(BusError::Wkc { .. }))).collect()
}

/// Writes the filter depths that differ from the written ones.
pub(super) async fn set_filters(bus: &Bus, segment: &SharedSegment) {
    let (all, versions) = (segment.view().clocks().filters(), segment.view().clock_versions());
    let written = bus.gather(all, |bus, (key, depths)| async move {
        bus.fpwr(key.station, map::DC_FILTER_DIFFERENCE, &depths).await.ok().map(|()| (key, depths))
    });
    // SubDevices without these registers, and absent ones, are not changed.
    let written: Vec<(ClockKey, [u8; 2])> = written.await.into_iter().flatten().collect();
    segment.find_of_clocks(versions, ClockFinding::FiltersWritten(&written));
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

/// Writes the delays of the clocks on a link, without touching filters.
pub(super) async fn write_delays(bus: &Bus, segment: &SharedSegment, link: Link) -> Result<(), BusError> {
    let (all, versions): (Vec<(StationAddress, u32)>, _) = {
        let view = segment.view();
        let here = view.clocks().nodes.iter().filter(|node| node.has_delay() && node.link == Some(link));
        (here.map(|node| (node.station, node.delay_ns as u32)).collect(), view.clock_versions())
    };
    let written = bus.gather(all, |bus, (station, delay)| async move {
        bus.fpwr(station, map::DC_SYSTEM_TIME_DELAY, &delay.to_le_bytes()).await
    });
    let results = written.await.into_iter();
    results.filter(|result| !matches!(result, Err(BusError::Wkc { .. }))).collect::<Result<(), BusError>>()?;
    segment.find_of_clocks(versions, ClockFinding::DelaysWritten(link));
    Ok(())
}

/// Latches one frame in all clocks; when it was sent.
async fn latched_times(
    bus: &Bus,
    segment: &SharedSegment,
    keys: &[ClockKey],
) -> Result<(Instant, LatchedTimes), BusError> {
    let stations: Vec<StationAddress> = keys.iter().map(|key| key.station).collect();
    let frame = latch(bus, segment, &stations, None).await?;
    let times = keys.iter().zip(frame.latched);
    Ok((frame.sent_at, times.filter_map(|(key, latched)| Some((*key, latched?))).collect()))
}

/// Sets up one clock that has lost its registers: its offset is computed from a frame that it and its reference latch,
/// or from the time of the host without a reference.
pub(super) async fn set_up_one(bus: &Bus, segment: &SharedSegment, station: StationAddress) -> Result<(), BusError> {
    let (keys, versions) = (segment.view().clocks().keys(), segment.view().clock_versions());
    let Some(key) = keys.iter().copied().find(|key| key.station == station) else { return Ok(()) };
    let (sent_at, latched) = latched_times(bus, segment, &keys).await?;
    if !latched.contains_key(&key) {
        return Ok(());
    }
    segment.find_of_clocks(versions, ClockFinding::LatchedFor { key, latched: &latched, host: sent_at.0 });
    let versions = segment.view().clock_versions();
    let Some(registers) = segment.view().clocks().node_of(key).map(registers) else { return Ok(()) };
    write(bus, station, registers).await?;
    segment.find_of_clocks(versions, ClockFinding::OneSetUp(key));
    set_filters(bus, segment).await;
    Ok(())
}
