//! Brings a SubDevice from its present state to the requested one, by the shortest path that keeps its configuration,
//! and out of its configured state to INIT.

use ringcat_wire::al::AlState;
use ringcat_wire::register::{Fmmu, SyncManager, map};

use super::{BringUp, ConfigureError};
use crate::config::Transition;
use crate::procedures::al_state;
use crate::segment::ProcessDataStep;
use crate::segment::start::Start;
use crate::supervisor::BusError;

impl BringUp<'_> {
    /// Changes to the target state. Without a shorter path the change goes through INIT.
    pub(in crate::procedures) async fn travel(&self) -> Result<(), ConfigureError> {
        let (status, _) = al_state::read_status(self.bus, self.station).await?;
        let configured = self.segment.view().member(self.index).is_some_and(|member| member.configured);
        let from = status.al_state().filter(|_| !status.error).unwrap_or(AlState::Init);
        match (from, self.target) {
            (AlState::PreOp, AlState::SafeOp | AlState::Op) if self.is_prepared() => self.up_from_preop().await,
            (AlState::SafeOp, AlState::Op) if configured => self.op().await,
            (AlState::Op, AlState::SafeOp) if configured => self.leave_op().await,
            (AlState::Op, AlState::PreOp) if configured => {
                self.leave_op().await?;
                self.leave_safeop().await
            }
            (AlState::SafeOp, AlState::PreOp) if configured => self.leave_safeop().await,
            (AlState::SafeOp | AlState::Op, AlState::Init | AlState::Boot) if configured => {
                self.leave_to_init(from).await?;
                self.up_from_init().await
            }
            (AlState::PreOp, AlState::Init | AlState::Boot) if self.is_prepared() => {
                self.leave_to_init(from).await?;
                self.up_from_init().await
            }
            _ => self.run(Start::Unknown).await,
        }
    }

    /// Commands to the mailbox in the present state, then INIT with cleared registers, then commands to registers.
    async fn leave_to_init(&self, from: AlState) -> Result<(), ConfigureError> {
        let transition = Transition::to_init(from);
        self.command_mail(transition).await?;
        self.take_out();
        self.back_to_init().await?;
        self.command_registers(transition).await
    }

    /// From BOOT to INIT. Commands of BI are sent if it is in BOOT as this session has brought it there.
    pub(in crate::procedures) async fn leave_boot(&self) -> Result<(), ConfigureError> {
        let (status, _) = al_state::read_status(self.bus, self.station).await?;
        if status.al_state() == Some(AlState::Boot) && !status.error && self.mailbox.is_open() {
            return self.leave_to_init(AlState::Boot).await;
        }
        self.take_out();
        self.back_to_init().await?;
        self.command_registers(Transition::Ii).await
    }

    /// From INIT behind BOOT to the target state. The SyncManagers of BOOT are disabled by now, and cleared.
    pub(in crate::procedures) async fn up_from_boot(&self) -> Result<(), ConfigureError> {
        self.clear_sync_managers().await?;
        self.up_from_init().await
    }

    /// The state is requested again: commands of the transition to itself.
    pub(in crate::procedures) async fn stay(&self) -> Result<(), ConfigureError> {
        match Transition::within(self.target) {
            Some(Transition::Ii) => self.command_registers(Transition::Ii).await,
            Some(transition) => self.command(transition).await,
            None => Ok(()),
        }
    }

    /// Whether it is in PREOP with the configuration of this session.
    fn is_prepared(&self) -> bool {
        self.setup.plan.mailbox.is_empty() || self.mailbox.is_open()
    }

    /// SyncManagers that are active in OP only are switched off first: if only they depend on states, outputs end with
    /// them.
    async fn leave_op(&self) -> Result<(), ConfigureError> {
        self.command(Transition::Os).await?;
        if self.setup.plan.is_op_only() {
            self.part().await?;
        }
        for area in self.setup.plan.process_data.iter().filter(|area| area.op_only) {
            let activate = map::sync_manager(area.sync_manager).offset(SyncManager::ACTIVATE);
            self.bus.fpwr(self.station, activate, &[0]).await?;
        }
        self.request(AlState::Op, AlState::SafeOp).await
    }

    /// Ends all process data of the SubDevice at the same time, before the state change ends only part of it. Mail
    /// continues.
    pub(super) async fn part(&self) -> Result<(), BusError> {
        self.process_data(ProcessDataStep::Left);
        let mut fmmus = alloc::vec![0; self.setup.fmmu_registers().len()];
        for (number, register) in self.setup.fmmus.iter().filter(|(number, _)| Some(*number) == self.setup.mail_fmmu) {
            let at = Fmmu::LEN * usize::from(*number);
            fmmus[at..at + Fmmu::LEN].copy_from_slice(&register.encode());
        }
        if !fmmus.is_empty() {
            self.bus.fpwr(self.station, map::FMMU_BASE, &fmmus).await?;
        }
        Ok(())
    }

    async fn leave_safeop(&self) -> Result<(), ConfigureError> {
        self.command(Transition::Sp).await?;
        self.set_configured(false);
        self.part().await?;
        self.request(AlState::SafeOp, AlState::PreOp).await?;
        for area in &self.setup.plan.process_data {
            self.write_sync_manager(area.sync_manager, &SyncManager::default()).await?;
        }
        Ok(())
    }
}
