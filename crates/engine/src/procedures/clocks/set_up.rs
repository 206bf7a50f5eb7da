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
use crate::segment::clocks::{ClockObservation, LatchedTimes, Node};
use crate::supervisor::{Bus, BusError};
use crate::time::Instant;

/// Reset value of DC_SPEED_COUNTER_START; writing it restarts the filters.
const SPEED_COUNTER_START: u16 = 0x1000;

/// Measures all delays and writes delays and offsets.
pub(super) async fn set_up(bus: &Bus, segment: &SharedSegment, opening: Opening) -> Result<(), String> {
    let text = |error: BusError| error.to_string();
    segment.observe_clocks(ClockObservation::SetUpBegun);
    if segment.view().clocks().reference.is_none() {
        return Err("no SubDevice has a clock".to_string());
    }
    let measured = measure(bus, segment, opening).await?;
    segment.observe_clocks(ClockObservation::Measured(&measured));
    let (stations, epoch) = {
        let view = segment.view();
        (view.clocks().stations(), view.clocks().epoch)
    };
    bus.step(Subject::Clocks, || format!("delays measured; offsets of {} clocks follow", stations.len()));
    // The frame may have waited for an empty wire: its time counts.
    let (sent_at, latched) = latched_times(bus, segment, &stations).await.map_err(text)?;
    let wanted = sent_at.0.wrapping_add(epoch);
    segment.observe_clocks(ClockObservation::Latched { latched: &latched, wanted });
    set_filters(bus, segment).await;
    write_all(bus, segment).await.map_err(text)
}

/// Measures all delays again and writes those of the links on which a delay has changed.
pub(super) async fn measure_again(bus: &Bus, segment: &SharedSegment) -> Result<(), String> {
    let measured = measure(bus, segment, Opening::Nothing).await?;
    segment.observe_clocks(ClockObservation::MeasuredAgain(&measured));
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
    let all = segment.view().clocks().filters();
    let written = bus.gather(all, |bus, (station, depths)| async move {
        bus.fpwr(station, map::DC_FILTER_DIFFERENCE, &depths).await.ok().map(|()| (station, depths))
    });
    // SubDevices without these registers, and absent ones, are not changed.
    let written: Vec<(StationAddress, [u8; 2])> = written.await.into_iter().flatten().collect();
    segment.observe_clocks(ClockObservation::FiltersWritten(&written));
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
    let all: Vec<(StationAddress, u32)> = {
        let view = segment.view();
        let here = view.clocks().nodes.iter().filter(|node| node.has_delay() && node.link == Some(link));
        here.map(|node| (node.station, node.delay_ns as u32)).collect()
    };
    let written = bus.gather(all, |bus, (station, delay)| async move {
        bus.fpwr(station, map::DC_SYSTEM_TIME_DELAY, &delay.to_le_bytes()).await
    });
    let results = written.await.into_iter();
    results.filter(|result| !matches!(result, Err(BusError::Wkc { .. }))).collect::<Result<(), BusError>>()?;
    segment.observe_clocks(ClockObservation::DelaysWritten(link));
    Ok(())
}

/// Latches one frame in all clocks; when it was sent.
async fn latched_times(
    bus: &Bus,
    segment: &SharedSegment,
    stations: &[StationAddress],
) -> Result<(Instant, LatchedTimes), BusError> {
    let frame = latch(bus, segment, stations, None).await?;
    let times = stations.iter().zip(frame.latched);
    Ok((frame.sent_at, times.filter_map(|(station, latched)| Some((*station, latched?))).collect()))
}

/// Sets up one clock that has lost its registers: its offset is computed from a frame that it and its reference latch,
/// or from the time of the host without a reference.
pub(super) async fn set_up_one(bus: &Bus, segment: &SharedSegment, station: StationAddress) -> Result<(), BusError> {
    let stations = segment.view().clocks().stations();
    let (sent_at, latched) = latched_times(bus, segment, &stations).await?;
    if !latched.contains_key(&station) {
        return Ok(());
    }
    segment.observe_clocks(ClockObservation::LatchedFor { station, latched: &latched, host: sent_at.0 });
    let Some(registers) = segment.view().clocks().node_at(station).map(registers) else { return Ok(()) };
    write(bus, station, registers).await?;
    segment.observe_clocks(ClockObservation::OneSetUp(station));
    set_filters(bus, segment).await;
    Ok(())
}
