//! Bring-up of one SubDevice from INIT to its target state with its whole configuration (protocol 5.2, order of IgH).

mod compare;
mod error;
mod leave;
mod pdos;
mod register_error;
mod registers;
mod startup;

use alloc::format;
use alloc::rc::Rc;
use alloc::vec;
use core::cell::Cell;
use core::time::Duration;

use ringcat_wire::address::StationAddress;
use ringcat_wire::al::AlState;
use ringcat_wire::register::{Fmmu, SyncManager, map};

use super::al_state;
use super::clocks;
use super::shared_segment::SharedSegment;
use super::sii;
use crate::config::{SubDeviceConfig, Transition};
use crate::event::Subject;
use crate::mail::Mailbox;
use crate::segment::setup::Setup;
use crate::segment::start::Start;
use crate::segment::{MemberFinding, ProcessDataStep};
use crate::supervisor::{Bus, BusError};

pub use crate::segment::setup::SetupError;

pub use error::{ConfigureError, StartupError};
pub use register_error::{RegisterCommandError, RegisterFailure, WrongValue};

/// Cycles of the exchange before the request of OP, so that valid outputs are present (protocol 5.2). The first of them
/// may have been queued without process data; one is enough if it is known to have had it.
const CYCLES_BEFORE_OP: u64 = 2;
/// Interval of the check of the cycle counter.
const CYCLE_PAUSE: Duration = Duration::from_micros(200);

/// One SubDevice's bring-up.
pub(super) struct BringUp<'a> {
    pub bus: &'a Bus,
    pub segment: &'a SharedSegment,
    pub index: usize,
    /// Number of the attempt to which it belongs.
    pub attempt: u32,
    pub station: StationAddress,
    pub setup: Rc<Setup>,
    pub config: Rc<SubDeviceConfig>,
    pub target: AlState,
    pub mailbox: Mailbox,
    /// The SYNC signals of the SubDevice were started although its clock was not right in time.
    pub goes_on_unlocked: Cell<bool>,
}

impl BringUp<'_> {
    /// The full bring-up. The working counter expects the SubDevice from SAFEOP on.
    pub(super) async fn run(&self, start: Start) -> Result<(), ConfigureError> {
        self.bus.step(Subject::States, || format!("{}: configuration begins, target {}", self.station, self.target));
        self.take_out();
        if start != Start::Cleared {
            self.back_to_init().await?;
        }
        self.command_registers(Transition::Ii).await?;
        self.up_from_init().await
    }

    /// Its process data, its configuration and its mailbox are not used any more.
    fn take_out(&self) {
        self.process_data(ProcessDataStep::Off);
        self.set_configured(false);
        self.mailbox.close();
    }

    /// From INIT with cleared registers to the target state.
    async fn up_from_init(&self) -> Result<(), ConfigureError> {
        match self.target {
            AlState::Init => Ok(()),
            AlState::Boot => self.boot().await,
            AlState::PreOp | AlState::SafeOp | AlState::Op => {
                self.preop().await?;
                self.up_from_preop().await
            }
        }
    }

    /// From PREOP to the target state.
    async fn up_from_preop(&self) -> Result<(), ConfigureError> {
        if self.target == AlState::PreOp {
            return Ok(());
        }
        self.safeop().await?;
        if self.target == AlState::Op {
            self.op().await?;
        }
        Ok(())
    }

    async fn request(&self, from: AlState, to: AlState) -> Result<(), ConfigureError> {
        let limit = self.config.limit(from, to);
        Ok(al_state::request(self.bus, self.station, to, self.setup.emulated, limit).await?)
    }

    /// The FMMUs are cleared first: a SubDevice that leaves OP may process only part of its process data.
    async fn back_to_init(&self) -> Result<(), ConfigureError> {
        self.process_data(ProcessDataStep::Unmapped);
        let status = al_state::read_quiet_status(self.bus, self.station).await?;
        let fmmus = vec![0; Fmmu::LEN * usize::from(self.setup.fmmu_count)];
        self.bus.fpwr(self.station, map::FMMU_BASE, &fmmus).await?;
        if status.error {
            al_state::acknowledge(self.bus, self.station, self.setup.emulated).await?;
        }
        self.request(status.al_state().unwrap_or(AlState::Op), AlState::Init).await?;
        Ok(self.clear_sync_managers().await?)
    }

    /// Start address and length of an enabled SyncManager are kept: it is only disabled.
    pub(super) async fn clear_sync_managers(&self) -> Result<(), BusError> {
        let sync_managers = vec![0; SyncManager::LEN * usize::from(self.setup.sync_manager_count)];
        self.bus.fpwr(self.station, map::SYNC_MANAGER_BASE, &sync_managers).await
    }

    async fn write_sync_manager(&self, index: u8, register: &SyncManager) -> Result<(), BusError> {
        self.bus.fpwr(self.station, map::sync_manager(index), &register.encode()).await
    }

    /// Commands of IP, mailbox, EEPROM to the PDI during the transition if it is lent, PREOP, other commands of IP.
    async fn preop(&self) -> Result<(), ConfigureError> {
        self.command_registers(Transition::Ip).await?;
        for sync_manager in &self.setup.plan.mailbox {
            self.write_sync_manager(sync_manager.index, &sync_manager.register).await?;
        }
        let has_application = !self.setup.plan.mailbox.is_empty();
        let is_lent = has_application && self.segment.view().sii_assignment().lends_towards_preop();
        if is_lent || self.config.sii_to_pdi {
            sii::assign(self.bus, self.station, true).await?;
        }
        self.request(AlState::Init, AlState::PreOp).await?;
        if let (Some(layout), [_, send]) = (self.setup.plan.mailbox_layout(), &self.setup.plan.mailbox[..]) {
            self.show_mail(send.index).await?;
            self.mailbox.open(self.station, layout, send.index);
        }
        if is_lent && !self.config.sii_to_pdi {
            sii::assign(self.bus, self.station, false).await?;
        }
        self.command_mail(Transition::Ip).await
    }

    /// Register commands of IB, mailboxes of the boot loader, EEPROM to the PDI (the boot loader keeps it), BOOT, other
    /// commands of IB.
    async fn boot(&self) -> Result<(), ConfigureError> {
        let (Some(layout), [_, send]) = (self.setup.plan.bootstrap_layout(), &self.setup.plan.bootstrap[..]) else {
            return Err(ConfigureError::NoBoot);
        };
        self.command_registers(Transition::Ib).await?;
        for sync_manager in &self.setup.plan.bootstrap {
            self.write_sync_manager(sync_manager.index, &sync_manager.register).await?;
        }
        sii::assign(self.bus, self.station, true).await?;
        self.request(AlState::Init, AlState::Boot).await?;
        self.show_mail(send.index).await?;
        self.mailbox.open(self.station, layout, send.index);
        self.command_mail(Transition::Ib).await
    }

    /// Maps the mailbox-full bit of a SyncManager; the other FMMUs follow on the way to SAFEOP.
    async fn show_mail(&self, sync_manager: u8) -> Result<(), BusError> {
        let mail = self.setup.fmmus.iter().find(|(number, _)| Some(*number) == self.setup.mail_fmmu);
        let Some((number, register)) = mail else { return Ok(()) };
        let physical_start = map::sync_manager(sync_manager).offset(SyncManager::STATUS).0;
        let register = Fmmu { physical_start, ..*register };
        self.bus.fpwr(self.station, map::fmmu(*number), &register.encode()).await
    }

    /// PDO assignment and mapping, with the commands of PS before and after them; then watchdog, process data
    /// SyncManagers, FMMUs, SAFEOP (protocol 5.2). As soon as its FMMUs are set a SubDevice may process outputs and
    /// inputs, at different times. Its share of a working counter is expected only after it has delivered its inputs,
    /// so that the inputs of the others stay fresh meanwhile.
    async fn safeop(&self) -> Result<(), ConfigureError> {
        let plan = &self.setup.plan;
        self.command_pdos(false).await?;
        self.assign_pdos().await?;
        self.command_pdos(true).await?;
        for (register, data) in &plan.watchdog {
            self.bus.fpwr(self.station, *register, data).await?;
        }
        for area in &plan.process_data {
            let mut register = area.register;
            register.activate.enable &= !area.op_only;
            self.write_sync_manager(area.sync_manager, &register).await?;
        }
        if !self.config.wait_before_safeop.is_zero() {
            self.bus.sleep(self.config.wait_before_safeop).await;
        }
        self.start_clock().await?;
        self.map().await?;
        let reached = self.request(AlState::PreOp, AlState::SafeOp).await;
        if let Err(error) = &reached {
            // The working counter does not expect it until the next attempt.
            self.part().await?;
            self.explain(error).await;
        }
        reached?;
        if !plan.is_op_only() {
            self.join();
        }
        self.set_configured(true);
        Ok(())
    }

    /// Maps process data in one frame, together with the FMMU that shows whether the SubDevice processed a frame.
    async fn map(&self) -> Result<(), BusError> {
        self.process_data(ProcessDataStep::Mapped);
        let fmmus = self.setup.fmmu_registers();
        if fmmus.is_empty() {
            return Ok(());
        }
        self.bus.step(Subject::States, || format!("{}: {} bytes of FMMUs written", self.station, fmmus.len()));
        self.bus.fpwr(self.station, map::FMMU_BASE, &fmmus).await
    }

    /// The working counter expects the SubDevice from now on, its inputs as soon as they were proven.
    pub(super) fn join(&self) {
        self.process_data(ProcessDataStep::Joined);
    }

    /// How the SubDevice takes part in process data from now on.
    pub(super) fn process_data(&self, step: ProcessDataStep) {
        self.segment.observe_member((self.index, self.attempt), MemberFinding::ProcessData(step));
    }

    fn set_configured(&self, is: bool) {
        self.segment.observe_member((self.index, self.attempt), MemberFinding::Configured(is));
    }

    /// Starts the declared SYNC signals, or clears earlier settings.
    async fn start_clock(&self) -> Result<(), ConfigureError> {
        if !self.segment.view().clocks().are_declared() {
            return Ok(());
        }
        clocks::restore(self.bus, self.segment, self.index).await?;
        let limit = self.config.limit(AlState::PreOp, AlState::SafeOp);
        if let Some(signals) = &self.config.sync {
            let member = (self.index, self.attempt);
            let start = clocks::start_signals(self.bus, self.segment, member, self.station, signals, limit);
            self.goes_on_unlocked.set(start.await?);
        }
        Ok(())
    }

    /// Commands of SO; waits until clocks are locked and outputs flow, then OP.
    pub(super) async fn op(&self) -> Result<(), ConfigureError> {
        self.command(Transition::So).await?;
        // If the SubDevice continues without a locked clock, the wait for its clock has already ended.
        if self.config.sync.is_some() && !self.goes_on_unlocked.take() {
            let member = (self.index, self.attempt);
            clocks::wait_for_lock(self.bus, self.segment, member).await.map_err(ConfigureError::NotLocked)?;
        }
        for area in self.setup.plan.process_data.iter().filter(|area| area.op_only) {
            self.write_sync_manager(area.sync_manager, &area.register).await?;
        }
        if self.setup.plan.is_op_only() {
            // The FMMUs were cleared when OP was left.
            self.map().await?;
            self.join();
        }
        let (board, begin) = (&self.segment.board, self.segment.board.cycles());
        let is_sent = || board.cycles() > begin && board.has_left(self.index);
        while board.cycles() < begin + CYCLES_BEFORE_OP && !is_sent() {
            self.bus.sleep(CYCLE_PAUSE).await;
        }
        self.request(AlState::SafeOp, AlState::Op).await
    }
}
