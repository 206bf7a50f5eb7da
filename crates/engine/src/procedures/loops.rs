//! Loop settings of ports that are changed for a moment, and restored (protocol 2.2, DL control bit 1).
//!
//! They are restored to what the application orders by then: a port that it closes meanwhile stays closed. If an
//! application ends or begins meanwhile, they are restored before anything else is done; if no frame reaches the
//! SubDevice, they expire.

use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::future::Future;
use core::time::Duration;

use ringcat_wire::address::{RegisterAddress, StationAddress, Wkc};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::{DlControl, LoopControl, map};

use super::shared_segment::SharedSegment;
use crate::order::InOrder;
use crate::ring::RingState;
use crate::segment::Observation;
use crate::segment::disturbance::Disturbance;
use crate::supervisor::{Bus, BusError};

/// Bytes of DL_CONTROL that are written: forwarding rule and temporary bit, loops.
const WRITTEN: usize = 2;
/// Time after which temporary settings have certainly expired.
pub(super) const TEMPORARY: Duration = Duration::from_millis(1_300);
/// Interval of the check for it.
const PAUSE: Duration = Duration::from_millis(20);
/// Attempts to restore settings: a frame that opens a path may not return itself.
const TRIES: usize = 2;
/// Attempts to read settings while the application writes them.
const READS: usize = 4;

/// Interval of the check whether the ring is closed.
const CLOSING_PAUSE: Duration = Duration::from_millis(1);

/// The byte of DL_CONTROL with the loop settings of all ports.
pub(super) const LOOPS: RegisterAddress = map::DL_CONTROL.offset(1);

/// The settings of a SubDevice. Waits until temporary settings have expired, as those of examined rings: a value
/// written meanwhile would expire with them. `None` if another program sets them again and again.
pub(super) async fn lasting(bus: &Bus, station: StationAddress) -> Result<Option<DlControl>, BusError> {
    let until = bus.now() + TEMPORARY;
    loop {
        let control = DlControl::decode(&bus.fprd_array(station, map::DL_CONTROL).await?);
        if !control.temporary {
            return Ok(Some(control));
        }
        if bus.now() >= until {
            return Ok(None);
        }
        bus.sleep(PAUSE).await;
    }
}

async fn is_lasting(bus: &Bus, station: StationAddress) -> bool {
    let read = bus.fprd_array(station, map::DL_CONTROL).await;
    read.is_ok_and(|bytes| !DlControl::decode(&bytes).temporary)
}

/// Waits until none of these SubDevices has temporary settings any more, for at most [`TEMPORARY`].
async fn until_expired(bus: &Bus, stations: impl Iterator<Item = StationAddress>) {
    let until = bus.now() + TEMPORARY;
    for station in stations {
        while bus.now() < until && !is_lasting(bus, station).await {
            bus.sleep(PAUSE).await;
        }
    }
}

/// The settings of a SubDevice, which the model follows from now on: what the application orders later is known. `None`
/// if the application or another program writes them again and again.
pub(super) async fn followed(
    bus: &Bus,
    segment: &SharedSegment,
    station: StationAddress,
) -> Result<Option<DlControl>, BusError> {
    segment.observe(Observation::PortsFollowed(station));
    for _ in 0..READS {
        let before = orders(segment, station);
        let Some(control) = lasting(bus, station).await? else { break };
        if let Some((orders, 0)) = before.filter(|before| Some(*before) == orders(segment, station)) {
            segment.observe(Observation::PortsRead { station, orders, control });
            return Ok(Some(control));
        }
        bus.sleep(PAUSE).await;
    }
    Ok(None)
}

fn orders(segment: &SharedSegment, station: StationAddress) -> Option<(u32, u32)> {
    segment.view().port_control(station).map(|it| (it.orders, it.under_way))
}

/// Writes settings, all in one frame: a second frame would be sent into a closed port. An error if a SubDevice is not
/// reached.
pub(super) async fn write(bus: &Bus, controls: Vec<(StationAddress, DlControl)>) -> Result<(), BusError> {
    write_together(bus, controls.into_iter().map(write_of).collect()).await
}

/// The same with datagrams of any length, each of which addresses one SubDevice.
pub(super) async fn write_together(bus: &Bus, writes: Vec<(Command, Target, Vec<u8>)>) -> Result<(), BusError> {
    let expected = Wkc(1);
    let targets: Vec<Target> = writes.iter().map(|(_, target, _)| *target).collect();
    let replies = bus.transfer_together(writes, Some(expected)).await?;
    match targets.into_iter().zip(&replies).find(|(_, reply)| reply.wkc() != expected) {
        Some((target, reply)) => Err(BusError::Wkc { target, expected, got: reply.wkc() }),
        None => Ok(()),
    }
}

/// The datagram with these settings.
pub(super) fn write_of((station, control): (StationAddress, DlControl)) -> (Command, Target, Vec<u8>) {
    (Command::Fpwr, Target::Station(station, map::DL_CONTROL), control.encode()[..WRITTEN].to_vec())
}

/// Closes ports for a moment, in one frame, carries out `work`, and restores the settings of the model. `before`: the
/// present settings of their SubDevices ([`controls`]). Returns the result, an error without `work` if the ports could
/// not be closed, and whether the settings were restored ([`restore`]): if not, they have expired by then.
pub(super) async fn while_closed<T>(
    bus: &Bus,
    segment: &SharedSegment,
    before: &[(StationAddress, DlControl)],
    ports: &[(StationAddress, u8)],
    work: impl Future<Output = T>,
) -> (Result<T, BusError>, bool) {
    segment.observe(Observation::PortsAltered(before));
    let closed = segment.view().altered().into_iter();
    let closed = closed.map(|(station, control)| (station, closed_at(control, station, ports)));
    let written = write(bus, closed.collect()).await;
    let result = match written {
        Ok(()) => Ok(work.await),
        Err(error) => Err(error),
    };
    let is_restored = restore(bus, segment).await;
    if !is_restored {
        // A port that is out of reach opens by itself. Until then SubDevices behind it would count as removed.
        until_expired(bus, before.iter().map(|(station, _)| *station)).await;
    }
    (result, is_restored)
}

/// The present loop settings of the SubDevices that have these ports; `None` if the application or another program
/// writes them again and again ([`followed`]).
pub(super) async fn settings(
    bus: &Bus,
    segment: &SharedSegment,
    ports: &[(StationAddress, u8)],
) -> Result<Option<Vec<(StationAddress, DlControl)>>, BusError> {
    let mut stations: Vec<StationAddress> = ports.iter().map(|(station, _)| *station).collect();
    stations.put_in_order();
    stations.dedup();
    let mut settings = Vec::new();
    for station in stations {
        let Some(control) = followed(bus, segment, station).await? else { return Ok(None) };
        settings.push((station, control));
    }
    Ok(Some(settings))
}

/// As [`settings`]. An error if there are none, or if one of the ports is closed.
pub(super) async fn controls(
    bus: &Bus,
    segment: &SharedSegment,
    ports: &[(StationAddress, u8)],
) -> Result<Vec<(StationAddress, DlControl)>, String> {
    let read = settings(bus, segment, ports).await.map_err(|error| error.to_string())?;
    let controls = read.ok_or("ports that have to be closed for a moment are being written")?;
    for (station, control) in &controls {
        let is_closed = |port: &u8| control.loops[usize::from(port & 3)] == LoopControl::Closed;
        if ports.iter().any(|(of, port)| of == station && is_closed(port)) {
            return Err(format!("a port of station {station} that has to be closed for a moment is already closed"));
        }
    }
    Ok(controls)
}

/// Restores what is changed according to the model, if anything is. All in one frame: behind one end of a ring that is
/// open again, frames are lost until the other end is open too. False if some were not reached: they restore themselves
/// when the temporary settings expire.
pub(crate) async fn restore(bus: &Bus, segment: &SharedSegment) -> bool {
    let mut is_restored = false;
    for _ in 0..TRIES {
        let altered = segment.view().altered();
        if altered.is_empty() {
            return true;
        }
        is_restored = write(bus, altered).await.is_ok();
        if is_restored {
            break;
        }
    }
    segment.observe(Observation::PortsAltered(&[]));
    is_restored
}

/// Restores ports where an application begins, before anything else: the scan or test that has changed them ends there.
/// A measurement that changes ports waits until then.
pub(crate) fn restore_for_application(bus: &Bus, segment: &SharedSegment) {
    if segment.view().altered().is_empty() {
        return;
    }
    let turn = segment.queue_up(Disturbance::OpenByPort);
    let (own_bus, own_segment) = (bus.clone(), segment.clone());
    bus.spawn(async move {
        restore(&own_bus, &own_segment).await;
        drop(turn);
    });
}

/// Restores ports at the end of an application, within a quarter of its limit: lost frames must not take the time of
/// the states. What is left of the limit.
pub(crate) async fn restore_within(bus: &Bus, segment: &SharedSegment, limit: Duration) -> Duration {
    let begun = bus.now();
    if bus.within(limit / 4, restore(bus, segment)).await.is_err() {
        segment.observe(Observation::PortsAltered(&[]));
    }
    limit.saturating_sub(bus.now().since(begun))
}

/// The same settings of a SubDevice, with these of its ports closed for a moment.
pub(super) fn closed_at(control: DlControl, station: StationAddress, ports: &[(StationAddress, u8)]) -> DlControl {
    let mut loops = control.loops;
    for (_, port) in ports.iter().filter(|(of, _)| *of == station) {
        loops[usize::from(port & 3)] = LoopControl::Closed;
    }
    DlControl { temporary: true, loops, ..control }
}

/// Waits until frames on both links have shown that the ring is closed, for at most `limit`.
pub(super) async fn until_ring_is_closed(bus: &Bus, limit: Duration) {
    let until = bus.now() + limit;
    while bus.now() < until {
        bus.sleep(CLOSING_PAUSE).await;
        let _ = bus.brd(map::TYPE, 1).await;
        let in_cycles = bus.board().map(|board| board.ring().state);
        if bus.ring() == RingState::Closed && in_cycles != Some(RingState::Open) {
            break;
        }
    }
}
