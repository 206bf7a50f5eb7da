//! Reads all declared SubDevices: which answer, in which state, with which ports.

use alloc::rc::Rc;
use alloc::vec;
use alloc::vec::Vec;
use core::cell::RefCell;
use core::time::Duration;

use ringcat_wire::address::{StationAddress, Wkc};
use ringcat_wire::register::{DlStatus, map};

use super::al_state::read_status;
use super::shared_segment::SharedSegment;
use crate::segment::{Reading, SubDeviceKey};
use crate::supervisor::{Bus, BusError, TURN, TURN_PAUSE};

/// Interval of intermediate results of a round: most answers arrive within the first.
const STEP: Duration = Duration::from_micros(300);

/// Reads all members: a few at a time while `is_calm`, all at once otherwise. Intermediate results are passed to
/// `so_far`, because reads of absent SubDevices take longer.
pub(super) async fn read_members(
    bus: &Bus,
    segment: &SharedSegment,
    is_calm: impl Fn() -> bool,
    mut so_far: impl FnMut(&[Reading]),
) -> Vec<Reading> {
    let stations: Vec<StationAddress> = segment.view().members().map(|member| member.station).collect();
    let readings = Rc::new(RefCell::new(vec![Reading::Unknown; stations.len()]));
    let mut next = 0;
    while next < stations.len() {
        let end = if is_calm() { stations.len().min(next + TURN) } else { stations.len() };
        let group = bus.group();
        for (index, station) in stations.iter().copied().enumerate().take(end).skip(next) {
            let (bus, readings) = (bus.clone(), readings.clone());
            group.spawn(async move {
                let reading = read_subdevice(&bus, station).await;
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

/// Reads all SubDevices without a declaration, by their station addresses.
pub(super) async fn read_all_unassigned(bus: &Bus, segment: &SharedSegment) -> Vec<(SubDeviceKey, Reading)> {
    let keys: Vec<SubDeviceKey> = segment.view().subdevices().unassigned().map(|it| it.key).collect();
    bus.gather(keys, |bus, key| async move { (key, read_subdevice(&bus, key.station).await) }).await
}

/// Scans one SubDevice.
pub(super) async fn read_subdevice(bus: &Bus, station: StationAddress) -> Reading {
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
    let (status, code) = read_status(bus, station).await?;
    let dl_status = DlStatus::decode(&bus.fprd_array(station, map::DL_STATUS).await?);
    Ok(Reading::Answer { status, code, dl_status })
}
