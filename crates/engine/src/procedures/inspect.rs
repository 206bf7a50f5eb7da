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
use crate::segment::Reading;
use crate::supervisor::{Bus, BusError, TURN, TURN_PAUSE};

/// Interval of intermediate results of a scan: most answers arrive within the first.
const STEP: Duration = Duration::from_micros(300);

/// Scans all members: a few at a time while `is_calm`, all at once otherwise. Intermediate results are passed to
/// `so_far`, because reads of absent SubDevices take longer.
pub(super) async fn read_members(
    bus: &Bus,
    segment: &SharedSegment,
    is_calm: impl Fn() -> bool,
    mut so_far: impl FnMut(&[Reading]),
) -> Vec<Reading> {
    let stations: Vec<StationAddress> = segment.view().members().iter().map(|member| member.station).collect();
    let readings = Rc::new(RefCell::new(vec![Reading::Unknown; stations.len()]));
    let mut next = 0;
    while next < stations.len() {
        let end = if is_calm() { stations.len().min(next + TURN) } else { stations.len() };
        let group = bus.group();
        for (index, station) in stations.iter().copied().enumerate().take(end).skip(next) {
            let (bus, readings) = (bus.clone(), readings.clone());
            group.spawn(async move {
                let reading = read_member(&bus, station).await;
                readings.borrow_mut()[index] = reading;
            });
        }
        while bus.within(STEP, group.done()).await.is_err() {
            so_far(&readings.borrow());
        }
        next = end;
        if next < stations.len() && is_calm() {
            bus.sleep(TURN_PAUSE).await;
        }
    }
    readings.take()
}

/// Scans all SubDevices without a declaration, by their addresses.
pub(super) async fn read_all_unassigned(bus: &Bus, segment: &SharedSegment) -> Vec<(StationAddress, Reading)> {
    let stations: Vec<StationAddress> = segment.view().all_unassigned().iter().map(|it| it.station).collect();
    bus.gather(stations, |bus, station| async move { (station, read_member(&bus, station).await) }).await
}

async fn read_member(bus: &Bus, station: StationAddress) -> Reading {
    match read_both(bus, station).await {
        Ok(reading) => reading,
        Err(BusError::Wkc { got: Wkc(0), .. }) => Reading::Silent,
        Err(BusError::Wkc { .. }) => Reading::Doubled,
        Err(
            BusError::Lost { .. }
            | BusError::TooLong { .. }
            | BusError::Busy { .. }
            | BusError::Disturbed { .. }
            | BusError::Split { .. },
        ) => Reading::Unknown,
    }
}

async fn read_both(bus: &Bus, station: StationAddress) -> Result<Reading, BusError> {
    let bytes: [u8; 6] = bus.fprd_array(station, map::AL_STATUS).await?;
    let (status, code) = split_status(&bytes);
    let dl_status = DlStatus::decode(&bus.fprd_array(station, map::DL_STATUS).await?);
    Ok(Reading::Answer { status, code, dl_status })
}
