//! From the state in which a SubDevice is to the one that was requested, by the shortest way that keeps what it has.

use ringcat_wire::al::AlState;
use ringcat_wire::register::{Fmmu, SyncManager, map};

use super::{BringUp, ConfigureError};
use crate::config::Transition;
use crate::procedures::al_state;
use crate::segment::ProcessDataStep;
use crate::segment::start::Start;
use crate::supervisor::BusError;

impl BringUp<'_> {
    /// Goes to the target state. Where there is no short way it is the one through INIT.
    pub(in crate::procedures) async fn travel(&self) -> Result<(), ConfigureError> {
        let (status, _) = al_state::read_status(self.bus, self.station).await?;
        let configured = self.segment.view().members[self.index].configured;
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
            _ => self.run(Start::Unknown).await,
        }
    }

    /// Whether it is in PREOP as we brought it there.
    fn is_prepared(&self) -> bool {
        self.setup.plan.mailbox.is_empty() || self.mailbox.is_open()
    }

    /// SyncManagers for OP only are switched off first: where only they depend on states, outputs end with them.
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

    /// Process data ends for all of it at once, before the SubDevice ends it by halves. Mail goes on.
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
