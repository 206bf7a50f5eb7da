//! What junctions were told to do about their ports: read while they can be asked, and noted when the application orders
//! something else.
//!
//! Whoever looks into rings of which no frame comes back writes the loops of all ports of their junctions at once
//! ([`super::look_inside`]). A port that somebody closed on purpose must stay closed, also where that was less than a look ago,
//! or where the answer to the order did not come back any more. So an order counts from before it leaves on, and nothing
//! that is read while it is under way.

use alloc::vec::Vec;

use ringcat_wire::address::{RegisterAddress, StationAddress};
use ringcat_wire::register::{DlControl, map};

use super::super::fleet::{Fleet, SharedFleet};
use super::station_of;
use crate::supervisor::Bus;

/// What a junction was told.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Told {
    station: StationAddress,
    control: DlControl,
    /// Orders of the application so far, and of these the ones that are under way.
    orders: u32,
    under_way: u32,
}

/// An order of the application that is under way.
#[derive(Debug)]
pub(crate) struct UnderWay {
    fleet: SharedFleet,
    station: StationAddress,
}

impl Drop for UnderWay {
    fn drop(&mut self) {
        if let Some(told) = self.fleet.access().junction_controls.iter_mut().find(|told| told.station == self.station) {
            told.under_way = told.under_way.saturating_sub(1);
        }
    }
}

/// What a junction was told; as after a scan where it is not known.
pub(super) fn control_of(fleet: &Fleet, junction: StationAddress) -> DlControl {
    let known = fleet.junction_controls.iter().find(|told| told.station == junction);
    known.map_or_else(DlControl::default, |told| told.control)
}

/// Notes that bytes are about to be written from a register on, until what it returns is dropped. `None` where that is
/// not about the ports of a junction with a ring.
pub(crate) fn ordering(
    fleet: Option<&SharedFleet>,
    station: StationAddress,
    register: RegisterAddress,
    data: &[u8],
) -> Option<UnderWay> {
    let fleet = fleet?;
    let mut access = fleet.access();
    if !junctions(&access).contains(&station) {
        return None;
    }
    let mut bytes = control_of(&access, station).encode();
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
    let told = entry(&mut access, station);
    (told.control, told.orders, told.under_way) = (control, told.orders.wrapping_add(1), told.under_way + 1);
    drop(access);
    Some(UnderWay { fleet: fleet.clone(), station })
}

/// Reads what the junctions of all local rings were told to do about their ports, while they can be asked. Where there is
/// one ring only it never has to be known.
pub(in super::super) async fn note_controls(bus: &Bus, fleet: &SharedFleet) {
    let asked: Vec<(StationAddress, u32)> = {
        let mut access = fleet.access();
        let junctions = if access.topology.local_rings.len() > 1 { junctions(&access) } else { Vec::new() };
        junctions.into_iter().map(|station| (station, entry(&mut access, station).orders)).collect()
    };
    let read = bus.gather(asked, |bus, (station, orders)| async move {
        let control = DlControl::decode(&bus.fprd_array(station, map::DL_CONTROL).await.ok()?);
        // What holds for a moment is our own order.
        (!control.temporary).then_some((station, orders, control))
    });
    for (station, orders, control) in read.await.into_iter().flatten() {
        let mut access = fleet.access();
        let told = entry(&mut access, station);
        if told.orders == orders && told.under_way == 0 {
            told.control = control;
        }
    }
}

/// The junctions at which local rings begin.
fn junctions(fleet: &Fleet) -> Vec<StationAddress> {
    let heads = fleet.topology.local_rings.iter().map(|ring| ring.closing.head.node);
    heads.filter_map(|head| station_of(fleet, head)).collect()
}

fn entry(fleet: &mut Fleet, station: StationAddress) -> &mut Told {
    let all = &mut fleet.junction_controls;
    let at = all.iter().position(|told| told.station == station).unwrap_or(all.len());
    if at == all.len() {
        all.push(Told { station, control: DlControl::default(), orders: 0, under_way: 0 });
    }
    &mut all[at]
}
