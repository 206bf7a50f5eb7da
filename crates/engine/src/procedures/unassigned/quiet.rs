//! Sets an unassigned SubDevice to the same initial state as after a scan: INIT, nothing mapped, its EEPROM assigned to
//! EtherCAT.
//!
//! A SubDevice that was configured by another MainDevice, or was plugged in while powered, would otherwise continue to
//! write its inputs into the process data.

use alloc::vec;
use core::time::Duration;

use ringcat_wire::address::StationAddress;
use ringcat_wire::al::{AlControl, AlState};
use ringcat_wire::register::{Fmmu, Information, SyncManager, map};

use super::super::al_state::read_status;
use super::super::scan::event_mask;
use super::super::sii::claim;
use crate::supervisor::{Bus, BusError};

/// How long an unassigned SubDevice may take to reach INIT before it is read anyway.
const INIT_LIMIT: Duration = Duration::from_millis(100);
/// Interval of reads of its state.
const PAUSE: Duration = Duration::from_millis(1);

/// Sets the initial state of one SubDevice; other registers are written with its configuration.
pub(in super::super) async fn level(bus: &Bus, station: StationAddress) -> Result<(), BusError> {
    bus.fpwr(station, map::DL_CONTROL.offset(1), &[0]).await?;
    bus.fpwr(station, map::DL_CONTROL.offset(3), &[0]).await?;
    bus.fpwr(station, map::ECAT_EVENT_MASK, &event_mask().encode()).await?;
    unmap(bus, station).await?;
    to_init(bus, station).await?;
    claim(bus, station).await
}

/// Clears all FMMUs and SyncManagers of the controller.
async fn unmap(bus: &Bus, station: StationAddress) -> Result<(), BusError> {
    let information = Information::decode(&bus.fprd_array(station, map::TYPE).await?);
    let fmmus = Fmmu::LEN * usize::from(information.fmmu_count);
    let sync_managers = SyncManager::LEN * usize::from(information.sync_manager_count);
    for (register, length) in [(map::FMMU_BASE, fmmus), (map::SYNC_MANAGER_BASE, sync_managers)] {
        if length > 0 {
            bus.fpwr(station, register, &vec![0; length]).await?;
        }
    }
    Ok(())
}

/// Devices that copy AL control into AL status show the acknowledge bit as an error: the state is written to them
/// without it.
async fn to_init(bus: &Bus, station: StationAddress) -> Result<(), BusError> {
    let until = bus.now() + INIT_LIMIT;
    let mut acknowledge = true;
    loop {
        let (status, _) = read_status(bus, station).await?;
        if (status.al_state() == Some(AlState::Init) && !status.error) || bus.now() >= until {
            return Ok(());
        }
        let control =
            if acknowledge { AlControl::with_acknowledge(AlState::Init) } else { AlControl::new(AlState::Init) };
        bus.fpwr(station, map::AL_CONTROL, &control.encode()).await?;
        acknowledge = !acknowledge;
        bus.sleep(PAUSE).await;
    }
}
