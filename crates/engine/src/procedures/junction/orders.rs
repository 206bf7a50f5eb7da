//! What junctions were told to do about their ports: read while they can be asked, and noted when the application
//! orders something else ([`crate::segment::PortControl`]).

use alloc::vec::Vec;

use ringcat_wire::address::{RegisterAddress, StationAddress};
use ringcat_wire::register::{DlControl, map};

use super::super::shared_segment::SharedSegment;
use crate::segment::Observation;
use crate::supervisor::Bus;

/// An order of the application that is under way.
#[derive(Debug)]
pub(crate) struct UnderWay {
    segment: SharedSegment,
    station: StationAddress,
}

impl Drop for UnderWay {
    fn drop(&mut self) {
        self.segment.observe(Observation::PortsTold(self.station));
    }
}

/// Notes that bytes are about to be written from a register on, until what it returns is dropped. `None` where that is
/// not about the ports of a junction with a ring.
pub(crate) fn ordering(
    segment: Option<&SharedSegment>,
    station: StationAddress,
    register: RegisterAddress,
    data: &[u8],
) -> Option<UnderWay> {
    let segment = segment?;
    if !segment.view().junctions().contains(&station) {
        return None;
    }
    let mut bytes = segment.view().control_of(station).encode();
    let begin = usize::from(register.0);
    let mut is_written = false;
    for (at, byte) in bytes.iter_mut().enumerate() {
        let written = (usize::from(map::DL_CONTROL.0) + at).checked_sub(begin).and_then(|at| data.get(at));
        is_written |= written.is_some();
        *byte = *written.unwrap_or(byte);
    }
    let control = DlControl::decode(&bytes);
    // What holds for a moment only need not be kept.
    if !is_written || control.temporary {
        return None;
    }
    segment.observe(Observation::PortsOrdered { station, control });
    Some(UnderWay { segment: segment.clone(), station })
}

/// Reads what the junctions of all local rings were told to do about their ports, while they can be asked. Where there
/// is one ring only it never has to be known.
pub(in super::super) async fn note_controls(bus: &Bus, segment: &SharedSegment) {
    let asked: Vec<(StationAddress, u32)> = {
        let view = segment.view();
        let junctions = if view.cabling.topology.local_rings.len() > 1 { view.junctions() } else { Vec::new() };
        let orders = |station| view.port_control(station).map_or(0, |told| told.orders);
        junctions.into_iter().map(|station| (station, orders(station))).collect()
    };
    let read = bus.gather(asked, |bus, (station, orders)| async move {
        let control = DlControl::decode(&bus.fprd_array(station, map::DL_CONTROL).await.ok()?);
        // What holds for a moment is our own order.
        (!control.temporary).then_some((station, orders, control))
    });
    for (station, orders, control) in read.await.into_iter().flatten() {
        segment.observe(Observation::PortsRead { station, orders, control });
    }
}
