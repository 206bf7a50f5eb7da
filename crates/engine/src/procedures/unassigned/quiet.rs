//! The same starting point for a stranger as after a scan: INIT, nothing mapped, its EEPROM to EtherCAT.
//!
//! One that another MainDevice configured, or that was plugged in with power of its own, would otherwise go on putting
//! its inputs into our process data.

use alloc::vec;
use core::time::Duration;

use ringcat_wire::address::StationAddress;
use ringcat_wire::al::{AlControl, AlState};
use ringcat_wire::register::{Fmmu, Information, SyncManager, map};

use super::super::al_state::read_status;
use super::super::scan::event_mask;
use super::super::sii::claim;
use crate::supervisor::{Bus, BusError};

/// How long a stranger may take to get to INIT before it is read all the same.
const INIT_LIMIT: Duration = Duration::from_millis(100);
/// Pause between two looks at its state.
const PAUSE: Duration = Duration::from_millis(1);

/// Levels one SubDevice; the rest comes with its configuration.
pub(super) async fn level(bus: &Bus, station: StationAddress) -> Result<(), BusError> {
    bus.fpwr(station, map::DL_CONTROL.offset(1), &[0]).await?;
    bus.fpwr(station, map::DL_CONTROL.offset(3), &[0]).await?;
    bus.fpwr(station, map::ECAT_EVENT_MASK, &event_mask().encode()).await?;
    unmap(bus, station).await?;
    to_init(bus, station).await?;
    claim(bus, station).await
}

/// Clears FMMUs and SyncManagers, as many as there are.
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

/// Devices that copy AL control into AL status show the acknowledge bit as an error: they get the bare state.
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
