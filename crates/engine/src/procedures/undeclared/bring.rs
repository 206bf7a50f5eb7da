//! Brings a SubDevice without a declaration to a state, with the defaults of its SII.
//!
//! It exchanges no process data: it has no FMMU, and its outputs are zeros that are written to its memory. A SubDevice
//! that goes to OP only with outputs, or whose watchdog monitors them, therefore gets them.

use alloc::rc::Rc;
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
use crate::info::{Direction, PdoSource, SubDeviceInfo};
use crate::mail::{Limits, Mailbox};
use crate::plan::{SubDevicePlan, plan};
use crate::procedures::al_state;
use crate::procedures::assign_pdos::{Known, assign};
use crate::procedures::configure::ConfigureError;
use crate::procedures::dictionary::{self, Dictionary};
use crate::procedures::read_state;
use crate::procedures::recover::is_of_bus;
use crate::procedures::shared_segment::SharedSegment;
use crate::procedures::visit::visit;
use crate::segment::setup::SetupError;
use crate::segment::{PdoFinding, ShownState, SubDeviceKey, UndeclaredObservation};
use crate::supervisor::{Bus, BusError};

/// Time limits of one request for PDOs.
const LIMITS: Limits = Limits::new(Duration::from_millis(100), Duration::from_secs(1));
/// Pause before PDOs are read again after a loss of frames.
const READ_PAUSE: Duration = Duration::from_millis(20);
/// Interval at which outputs are written: a fifth of the default time of the watchdog.
const OUTPUTS_PERIOD: Duration = Duration::from_millis(20);

/// A SubDevice that is brought to a state.
pub(super) struct Bringing<'a> {
    pub bus: &'a Bus,
    pub segment: &'a SharedSegment,
    pub key: SubDeviceKey,
    pub info: Rc<SubDeviceInfo>,
    pub mailbox: Mailbox,
}

impl Bringing<'_> {
    /// Brings it to the requested state, through INIT. Its mailbox is open from PREOP and BOOT on.
    pub(super) async fn bring(mut self, target: AlState) -> Result<(), ConfigureError> {
        unmap(self.bus, &self.info).await?;
        let assignment = self.segment.view().sii_assignment();
        match target {
            AlState::Init | AlState::Boot => visit(self.bus, &self.info, &self.mailbox, target, assignment).await,
            AlState::PreOp | AlState::SafeOp | AlState::Op => {
                visit(self.bus, &self.info, &self.mailbox, AlState::PreOp, assignment).await?;
                self.read_pdos(true).await;
                if target == AlState::PreOp {
                    return Ok(());
                }
                self.assign_pdos().await?;
                raise(self.bus, &self.info, target).await
            }
        }
    }

    /// Reads the PDOs in its dictionary, unless they are known. False if they are still to be read.
    async fn read_pdos(&mut self, from_init: bool) -> bool {
        if !self.segment.view().wants_pdos(&self.info, from_init) {
            return true;
        }
        self.mailbox.forget_written_pdos();
        let dictionary = self.while_in_preop(dictionary::read(self.bus, &self.info, &self.mailbox)).await;
        let finding = match &dictionary {
            Dictionary::Held(held) => PdoFinding::Held(held),
            Dictionary::None => PdoFinding::Unreadable,
            Dictionary::Unreadable(reason) => {
                dictionary::report_unreadable(self.bus, &self.info, reason);
                PdoFinding::Unreadable
            }
            Dictionary::Interrupted => return false,
        };
        self.observe(finding);
        let view = self.segment.view();
        if let Some(info) = view.unassigned(self.key).and_then(|it| it.knowledge.info()) {
            self.info = info.clone();
        }
        true
    }

    /// Reads its dictionary until it shows a state without mail: no answer is waited for then.
    async fn while_in_preop(&self, reading: impl Future<Output = Dictionary>) -> Dictionary {
        let left = async {
            loop {
                self.bus.sleep(READ_PAUSE).await;
                let shown = read_state::read(self.bus, self.info.station).await;
                if matches!(shown, ShownState::Shown((status, _)) if status.al_state() == Some(AlState::Init)) {
                    return Dictionary::Interrupted;
                }
            }
        };
        let (mut reading, mut left) = (pin!(reading), pin!(left));
        poll_fn(|context| match reading.as_mut().poll(context) {
            Poll::Ready(dictionary) => Poll::Ready(dictionary),
            Poll::Pending => left.as_mut().poll(context),
        })
        .await
    }

    /// Writes what is known of its dictionary into it, if another owner may have written it and it cannot be read.
    /// What it refuses stays: its application decides about SAFEOP.
    async fn assign_pdos(&self) -> Result<(), ConfigureError> {
        if self.info.pdo_source != PdoSource::Outdated || !self.mailbox.is_open() {
            return Ok(());
        }
        for planned in &defaults(&self.info)?.pdos {
            let assigned = assign(&self.mailbox, planned, Known::Doubtfully, LIMITS, |_| ()).await;
            match assigned.map_err(ConfigureError::Sdo) {
                Err(error) if is_of_bus(&error) => return Err(error),
                Ok(_) | Err(_) => {}
            }
        }
        self.mailbox.forget_written_pdos();
        Ok(())
    }

    fn observe(&self, finding: PdoFinding<'_>) {
        self.segment.observe_undeclared(UndeclaredObservation::Pdos { key: self.key, finding });
    }
}

/// Reads the PDOs in the dictionary of a SubDevice that is in its requested state, while it is to stay there.
pub(in crate::procedures) async fn read_pdos(bus: Bus, segment: SharedSegment, (key, attempt): (SubDeviceKey, u32)) {
    loop {
        let known = {
            let view = segment.view();
            let is_to_stay = view.upkeep(key).is_some_and(|upkeep| upkeep.is_reached(attempt));
            view.unassigned(key).filter(|_| is_to_stay).and_then(|it| it.knowledge.info()).cloned()
        };
        let (Some(info), Some(mailbox)) = (known, segment.undeclared.of(key)) else { return };
        let mut bringing = Bringing { bus: &bus, segment: &segment, key, info, mailbox };
        if bringing.read_pdos(false).await {
            return;
        }
        bus.sleep(READ_PAUSE).await;
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
