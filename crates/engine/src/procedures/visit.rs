//! Bringing a scanned SubDevice to PREOP or BOOT before activation, so that its mailbox can be used (protocol 5.2).

use alloc::vec;
use core::time::Duration;

use ringcat_wire::al::AlState;
use ringcat_wire::register::{SyncManager, map};

use super::al_state;
use super::configure::ConfigureError;
use super::sii;
use crate::config::{SubDeviceConfig, Timeouts};
use crate::info::{SiiAssignment, SubDeviceInfo};
use crate::mail::Mailbox;
use crate::plan::plan;
use crate::segment::setup::SetupError;
use crate::supervisor::Bus;

/// Brings a SubDevice to a state with a mailbox, PREOP or BOOT, and opens the mailbox; or to INIT, and closes it.
pub(crate) async fn visit(
    bus: &Bus,
    info: &SubDeviceInfo,
    mailbox: &Mailbox,
    state: AlState,
    assignment: SiiAssignment,
) -> Result<(), ConfigureError> {
    let (station, emulated) = (info.station, info.device_emulation);
    let limits = Timeouts::default();
    let request = async |from, to| -> Result<(), ConfigureError> {
        let limit: Duration = limits.transition(from, to);
        Ok(al_state::request(bus, station, to, emulated, limit).await?)
    };
    mailbox.close();
    let status = al_state::read_quiet_status(bus, station).await?;
    if status.error {
        al_state::acknowledge(bus, station, emulated).await?;
    }
    request(AlState::Op, AlState::Init).await?;
    sii::claim(bus, station).await?;
    // Start address and length of an enabled SyncManager cannot be changed.
    let sync_managers = vec![0; SyncManager::LEN * usize::from(info.controller.sync_manager_count)];
    bus.fpwr(station, map::SYNC_MANAGER_BASE, &sync_managers).await?;
    let layout = match state {
        AlState::Boot => info.bootstrap,
        AlState::Init | AlState::PreOp | AlState::SafeOp | AlState::Op => info.mailbox,
    };
    let layout = match (layout, state) {
        (_, AlState::Init) => return Ok(()),
        (Some(layout), _) => layout,
        (None, AlState::Boot) => return Err(ConfigureError::NoBoot),
        (None, state) => return request(AlState::Init, state).await,
    };
    let plan = plan(&SubDeviceConfig::from_info(info), info);
    let plan = plan.map_err(|error| ConfigureError::Unfit(SetupError::Plan(error)))?;
    let managers = if state == AlState::Boot { &plan.bootstrap } else { &plan.mailbox };
    let [_, send] = &managers[..] else { return Err(ConfigureError::NoSetup) };
    for manager in managers {
        bus.fpwr(station, map::sync_manager(manager.index), &manager.register.encode()).await?;
    }
    let is_lent = state == AlState::Boot || assignment.lends_towards_preop();
    if is_lent {
        sii::assign(bus, station, true).await?;
    }
    let result = request(AlState::Init, state).await;
    // A boot loader may need the EEPROM as long as it runs.
    if is_lent && (state != AlState::Boot || result.is_err()) {
        sii::claim(bus, station).await?;
    }
    result?;
    mailbox.open(station, layout, send.index);
    Ok(())
}
