//! Port commands to junctions: read while junctions answer, and stored when the application sends another command
//! ([`crate::segment::PortControl`]).

use alloc::vec::Vec;

use ringcat_wire::address::{RegisterAddress, StationAddress};
use ringcat_wire::register::{DlControl, map};

use super::super::shared_segment::SharedSegment;
use crate::segment::Observation;
use crate::supervisor::Bus;

/// A command of the application that is under way.
#[derive(Debug)]
pub(crate) struct UnderWay {
    segment: SharedSegment,
    station: StationAddress,
}

impl Drop for UnderWay {
    fn drop(&mut self) {
        self.segment.observe(Observation::PortsWritten(self.station));
    }
}

/// Records a write of these bytes from a register on as under way, until the returned value is dropped. `None` if the
/// write does not concern lasting settings of ports. A measurement that changes ports may begin while the write is
/// under way: so the write is recorded even if no procedure observes these ports yet.
pub(crate) fn ordering(
    segment: &SharedSegment,
    station: StationAddress,
    register: RegisterAddress,
    data: &[u8],
) -> Option<UnderWay> {
    let mut bytes = segment.view().control_of(station).encode();
    let begin = usize::from(register.0);
    let mut is_written = false;
    for (at, byte) in bytes.iter_mut().enumerate() {
        let written = (usize::from(map::DL_CONTROL.0) + at).checked_sub(begin).and_then(|at| data.get(at));
        is_written |= written.is_some();
        *byte = *written.unwrap_or(byte);
    }
    let control = DlControl::decode(&bytes);
    // Temporary settings need not be stored.
    if !is_written || control.temporary {
        return None;
    }
    segment.observe(Observation::PortsOrdered { station, control });
    Some(UnderWay { segment: segment.clone(), station })
}

/// Reads the port control of the junctions of all local rings, while they answer. With only one ring it is never
/// needed.
pub(in super::super) async fn note_controls(bus: &Bus, segment: &SharedSegment) {
    let before: Vec<(StationAddress, u32)> = {
        let view = segment.view();
        let junctions = if view.cabling().topology.local_rings.len() > 1 { view.junctions() } else { Vec::new() };
        let orders = |station| view.port_control(station).map_or(0, |entry| entry.orders);
        junctions.into_iter().map(|station| (station, orders(station))).collect()
    };
    let read = bus.gather(before, |bus, (station, orders)| async move {
        let control = DlControl::decode(&bus.fprd_array(station, map::DL_CONTROL).await.ok()?);
        // Temporary settings are our own.
        (!control.temporary).then_some((station, orders, control))
    });
    for (station, orders, control) in read.await.into_iter().flatten() {
        segment.observe(Observation::PortsRead { station, orders, control });
    }
}
