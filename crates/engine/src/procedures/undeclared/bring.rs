//! Brings a SubDevice without a declaration to a state, with the defaults of its SII.
//!
//! It exchanges no process data: it has no FMMU, and its outputs are zeros that are written to its memory. A SubDevice
//! that goes to OP only with outputs, or whose watchdog monitors them, therefore gets them.

use alloc::vec;
use alloc::vec::Vec;
use core::convert::Infallible;
use core::future::{Future, poll_fn};
use core::pin::pin;
use core::task::Poll;
use core::time::Duration;

use ringcat_wire::address::{RegisterAddress, StationAddress};
use ringcat_wire::al::AlState;
use ringcat_wire::register::{Fmmu, map};

use crate::config::{SubDeviceConfig, Timeouts};
use crate::info::{Direction, SubDeviceInfo};
use crate::mail::Mailbox;
use crate::plan::{SubDevicePlan, plan};
use crate::procedures::al_state;
use crate::procedures::configure::ConfigureError;
use crate::procedures::shared_segment::SharedSegment;
use crate::procedures::visit::visit;
use crate::segment::SubDeviceKey;
use crate::segment::setup::SetupError;
use crate::supervisor::{Bus, BusError};

/// Interval at which outputs are written: a fifth of the default time of the watchdog.
const OUTPUTS_PERIOD: Duration = Duration::from_millis(20);

/// Brings it to the requested state, through INIT. Its mailbox is open from PREOP and BOOT on.
pub(super) async fn bring(
    bus: &Bus,
    info: &SubDeviceInfo,
    mailbox: &Mailbox,
    target: AlState,
) -> Result<(), ConfigureError> {
    unmap(bus, info).await?;
    match target {
        AlState::Init | AlState::PreOp | AlState::Boot => visit(bus, info, mailbox, target).await,
        AlState::SafeOp | AlState::Op => {
            visit(bus, info, mailbox, AlState::PreOp).await?;
            raise(bus, info, target).await
        }
    }
}

/// Clears what an application has left: FMMUs and SYNC signals.
pub(in crate::procedures) async fn unmap(bus: &Bus, info: &SubDeviceInfo) -> Result<(), BusError> {
    let fmmus = Fmmu::LEN * usize::from(info.controller.fmmu_count);
    if fmmus > 0 {
        bus.fpwr(info.station, map::FMMU_BASE, &vec![0; fmmus]).await?;
    }
    if info.controller.features.dc {
        bus.fpwr(info.station, map::DC_ACTIVATION, &[0]).await?;
    }
    Ok(())
}

fn defaults(info: &SubDeviceInfo) -> Result<SubDevicePlan, ConfigureError> {
    let plan = plan(&SubDeviceConfig::from_info(info), info);
    plan.map_err(|error| ConfigureError::Unfit(SetupError::Plan(error)))
}

/// SAFEOP, and OP.
async fn raise(bus: &Bus, info: &SubDeviceInfo, target: AlState) -> Result<(), ConfigureError> {
    let plan = defaults(info)?;
    for area in &plan.process_data {
        let register = area.register.encode();
        bus.fpwr(info.station, map::sync_manager(area.sync_manager), &register).await?;
    }
    request(bus, info, AlState::PreOp, AlState::SafeOp).await?;
    if target == AlState::SafeOp {
        return Ok(());
    }
    let outputs = outputs(&plan);
    write_once(bus, info.station, &outputs).await?;
    let mut requested = pin!(request(bus, info, AlState::SafeOp, AlState::Op));
    let mut written = pin!(write(bus, info.station, &outputs));
    poll_fn(|context| {
        if let Poll::Ready(result) = requested.as_mut().poll(context) {
            return Poll::Ready(result);
        }
        match written.as_mut().poll(context) {
            Poll::Ready(Err(error)) => Poll::Ready(Err(error.into())),
            Poll::Ready(Ok(never)) => match never {},
            Poll::Pending => Poll::Pending,
        }
    })
    .await
}

/// Writes the outputs of a SubDevice that has reached OP, as long as it is to stay there.
pub(in crate::procedures) async fn keep_outputs(bus: Bus, segment: SharedSegment, (key, attempt): (SubDeviceKey, u32)) {
    let info = segment.view().unassigned(key).and_then(|it| it.knowledge.info()).cloned();
    let Some(Ok(plan)) = info.map(|info| defaults(&info)) else { return };
    let outputs = outputs(&plan);
    let is_to_stay = || segment.view().upkeep(key).is_some_and(|upkeep| upkeep.is_reached(attempt));
    while !outputs.is_empty() && is_to_stay() {
        // A SubDevice that does not answer leaves OP; the reading of its state shows this.
        let _ = write_once(&bus, key.station, &outputs).await;
        bus.sleep(OUTPUTS_PERIOD).await;
    }
}

/// First byte and length of each buffer of outputs.
fn outputs(plan: &SubDevicePlan) -> Vec<(RegisterAddress, usize)> {
    let outputs = plan.process_data.iter().filter(|area| area.direction == Direction::Outputs && area.length > 0);
    outputs.map(|area| (RegisterAddress(area.physical), usize::from(area.length))).collect()
}

async fn write_once(bus: &Bus, station: StationAddress, outputs: &[(RegisterAddress, usize)]) -> Result<(), BusError> {
    for (start, length) in outputs {
        bus.fpwr(station, *start, &vec![0; *length]).await?;
    }
    Ok(())
}

/// Writes outputs without end.
async fn write(
    bus: &Bus,
    station: StationAddress,
    outputs: &[(RegisterAddress, usize)],
) -> Result<Infallible, BusError> {
    loop {
        bus.sleep(OUTPUTS_PERIOD).await;
        write_once(bus, station, outputs).await?;
    }
}

async fn request(bus: &Bus, info: &SubDeviceInfo, from: AlState, to: AlState) -> Result<(), ConfigureError> {
    let limit = Timeouts::default().transition(from, to);
    Ok(al_state::request(bus, info.station, to, info.device_emulation, limit).await?)
}
