//! Scans all declared SubDevices: which answer, in which state, with which ports.

use alloc::rc::Rc;
use alloc::vec;
use alloc::vec::Vec;
use core::cell::RefCell;
use core::time::Duration;

use ringcat_wire::address::{StationAddress, Wkc};
use ringcat_wire::register::{DlStatus, map};

use super::al_state::split_status;
use super::shared_segment::SharedSegment;
use crate::segment::Look;
use crate::supervisor::{Bus, BusError, TURN, TURN_PAUSE};

/// Interval of intermediate results of a scan: most answers arrive within the first.
const STEP: Duration = Duration::from_micros(300);

/// Scans all members: a few at a time while `is_calm`, all at once otherwise. Intermediate results are passed to
/// `so_far`, because reads of absent SubDevices take longer.
pub(super) async fn look_at_all(
    bus: &Bus,
    segment: &SharedSegment,
    is_calm: impl Fn() -> bool,
    mut so_far: impl FnMut(&[Look]),
) -> Vec<Look> {
    let stations: Vec<StationAddress> = segment.view().members.iter().map(|member| member.station).collect();
    let looks = Rc::new(RefCell::new(vec![Look::Unknown; stations.len()]));
    let mut next = 0;
    while next < stations.len() {
        let end = if is_calm() { stations.len().min(next + TURN) } else { stations.len() };
        let group = bus.group();
        for (index, station) in stations.iter().copied().enumerate().take(end).skip(next) {
            let (bus, looks) = (bus.clone(), looks.clone());
            group.spawn(async move {
                let look = look_at(&bus, station).await;
                looks.borrow_mut()[index] = look;
            });
        }
        while bus.within(STEP, group.done()).await.is_err() {
            so_far(&looks.borrow());
        }
        next = end;
        if next < stations.len() && is_calm() {
            bus.sleep(TURN_PAUSE).await;
        }
    }
    looks.take()
}

/// Scans all SubDevices without a declaration, by their addresses.
pub(super) async fn look_at_unassigned(bus: &Bus, segment: &SharedSegment) -> Vec<(StationAddress, Look)> {
    let stations: Vec<StationAddress> = segment.view().unassigned.iter().map(|it| it.station).collect();
    bus.gather(stations, |bus, station| async move { (station, look_at(&bus, station).await) }).await
}

async fn look_at(bus: &Bus, station: StationAddress) -> Look {
    match read_both(bus, station).await {
        Ok(look) => look,
        Err(BusError::Wkc { got: Wkc(0), .. }) => Look::Silent,
        Err(BusError::Wkc { .. }) => Look::Doubled,
        Err(
            BusError::Lost { .. }
            | BusError::TooLong { .. }
            | BusError::Busy { .. }
            | BusError::Disturbed { .. }
            | BusError::Split { .. },
        ) => Look::Unknown,
    }
}

async fn read_both(bus: &Bus, station: StationAddress) -> Result<Look, BusError> {
    let bytes: [u8; 6] = bus.fprd_array(station, map::AL_STATUS).await?;
    let (status, code) = split_status(&bytes);
    let dl_status = DlStatus::decode(&bus.fprd_array(station, map::DL_STATUS).await?);
    Ok(Look::Answer { status, code, dl_status })
}
