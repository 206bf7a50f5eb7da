//! Ports of a SubDevice: opened and closed by DL control; SubDevices cut off on purpose (protocol 2.2).

pub use crate::segment::BlockedPort;

use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::{DlControl, LoopControl, map};

use super::ServiceError;
use crate::declared::SubDeviceId;
use crate::order::InOrder;
use crate::procedures::junction::ordering;
use crate::procedures::loops::{LOOPS, lasting, write_together};
use crate::procedures::shared_segment::SharedSegment;
use crate::ring::RingState;
use crate::segment::Observation;
use crate::supervisor::Bus;

/// The loop control of a port.
pub async fn read(bus: &Bus, station: StationAddress, port: u8) -> Result<LoopControl, ServiceError> {
    check(port)?;
    let control = DlControl::decode(&bus.fprd_array(station, map::DL_CONTROL).await?);
    Ok(control.loops[usize::from(port)])
}

/// Opens or closes a port. SubDevices behind a closed port are out of reach.
pub async fn set(
    bus: &Bus,
    segment: &SharedSegment,
    station: StationAddress,
    port: u8,
    control: LoopControl,
) -> Result<(), ServiceError> {
    check(port)?;
    let before = lasting_loops(bus, station).await?;
    let shift = 2 * port;
    let loops = before & !(3 << shift) | control.code() << shift;
    let _order = ordering(segment, station, LOOPS, &[loops]);
    bus.fpwr(station, LOOPS, &[loops]).await?;
    Ok(())
}

async fn lasting_loops(bus: &Bus, station: StationAddress) -> Result<u8, ServiceError> {
    let control = lasting(bus, station).await?.ok_or(ServiceError::Unsteady)?;
    Ok(control.encode()[1])
}

const fn check(port: u8) -> Result<(), ServiceError> {
    if port < 4 { Ok(()) } else { Err(ServiceError::Port { port }) }
}

/// Cuts off a declared SubDevice by closing the port of its neighbour before it. In a closed ring the port of the
/// neighbour behind it is closed too, so the SubDevices behind it stay in reach; in a line they are cut off too.
pub(crate) async fn block(
    bus: &Bus,
    segment: &SharedSegment,
    subdevice: usize,
) -> Result<Vec<BlockedPort>, ServiceError> {
    let ports = neighbours(bus, segment, subdevice)?;
    if let Err(error) = set_all(bus, segment, &ports, LoopControl::Closed).await {
        // A cable with only one closed end loses the frames of the other side.
        let _ = set_all(bus, segment, &ports, LoopControl::Auto).await;
        return Err(error);
    }
    segment.observe(Observation::Blocked(&ports));
    Ok(ports)
}

/// Opens all ports that were closed to cut SubDevices off; returns their number. Those that cannot be reached now are
/// kept for the next attempt.
pub(crate) async fn open_blocked(bus: &Bus, segment: &SharedSegment) -> Result<usize, ServiceError> {
    let blocked = segment.view().blocked().to_vec();
    segment.observe(Observation::Unblocking);
    let mut opened = set_all(bus, segment, &blocked, LoopControl::Auto).await;
    if opened.is_err() {
        opened = Ok(());
        let mut kept = Vec::new();
        for port in &blocked {
            if let Err(error) = set_all(bus, segment, core::slice::from_ref(port), LoopControl::Auto).await {
                kept.push(*port);
                opened = Err(error);
            }
        }
        segment.observe(Observation::Blocked(&kept));
    }
    segment.observe(Observation::RoundWanted);
    opened.map(|()| blocked.len())
}

/// Sets ports of several SubDevices with one frame: a cable with only one closed end loses frames.
async fn set_all(
    bus: &Bus,
    segment: &SharedSegment,
    ports: &[BlockedPort],
    control: LoopControl,
) -> Result<(), ServiceError> {
    let mut stations: Vec<StationAddress> = ports.iter().map(|port| port.station).collect();
    stations.put_in_order();
    stations.dedup();
    let before = bus.gather(stations.clone(), |bus, station| async move { lasting_loops(&bus, station).await }).await;
    let mut writes = Vec::new();
    for (station, before) in stations.into_iter().zip(before) {
        let mut loops = before?;
        for BlockedPort { port, .. } in ports.iter().filter(|port| port.station == station) {
            let shift = 2 * port;
            loops = loops & !(3 << shift) | control.code() << shift;
        }
        writes.push((station, loops));
    }
    let order = |(station, loops): &(StationAddress, u8)| ordering(segment, *station, LOOPS, &[*loops]);
    let _orders: Vec<_> = writes.iter().map(order).collect();
    let write = |(station, loops)| (Command::Fpwr, Target::Station(station, LOOPS), Vec::from([loops]));
    Ok(write_together(bus, writes.into_iter().map(write).collect()).await?)
}

/// The ports of its neighbours that are connected to a SubDevice.
fn neighbours(bus: &Bus, segment: &SharedSegment, subdevice: usize) -> Result<Vec<BlockedPort>, ServiceError> {
    let access = segment.view();
    let missing = ServiceError::NoSubDevice { subdevice: SubDeviceId(subdevice).into() };
    let node = access.member(subdevice).and_then(|member| member.node).ok_or(missing)?;
    let here = access.cabling().topology.nodes.get(node).ok_or(missing)?;
    let port = |node: usize, port: u8| access.station_of(node).map(|station| BlockedPort { station, port });
    let parent = here
        .parent
        .and_then(|(parent, at)| port(parent, at))
        .ok_or(ServiceError::OnTheLink { subdevice: SubDeviceId(subdevice) })?;
    let mut ports = Vec::new();
    if bus.ring() == RingState::Closed && bus.links() == crate::link::LinkSet::Ring {
        let behind = here.children.iter().flatten();
        ports.extend(behind.filter_map(|child| port(*child, access.cabling().topology.nodes.get(*child)?.entry_port)));
    }
    ports.push(parent);
    Ok(ports)
}
