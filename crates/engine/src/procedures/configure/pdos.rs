//! PDO assignment and mapping of a member, before SAFEOP.

use alloc::format;
use alloc::vec::Vec;

use super::{BringUp, ConfigureError};
use crate::config::{PdoAssignment, RefusedPdos};
use crate::event::Subject;
use crate::info::PdoSource;
use crate::mail::Limits;
use crate::mail::coe::SdoError;
use crate::procedures::assign_pdos::{Assigned, Known, assign};
use crate::procedures::recover::is_of_bus;
use crate::segment::{MemberFinding, PdoFinding};

impl BringUp<'_> {
    /// Brings the dictionary to what is planned. If the SubDevice refuses and the declaration permits that, it goes on
    /// with what it holds.
    pub(super) async fn assign_pdos(&self) -> Result<(), ConfigureError> {
        let limits = Limits::new(self.config.timeouts.mailbox_request, self.config.timeouts.sdo);
        let known = if self.is_dictionary_known() { Known::Surely } else { Known::Doubtfully };
        let (mut held, mut is_whole): (Vec<PdoAssignment>, _) = (Vec::new(), self.is_planned_whole());
        for plan in &self.setup.plan.pdos {
            let mut is_announced = false;
            let assigned = assign(&self.mailbox, plan, known, limits, |sdo| {
                // Whatever happens from here on, the dictionary may hold anything until all is written.
                if !core::mem::replace(&mut is_announced, true) {
                    self.observe_pdos(PdoFinding::Outdated);
                }
                let (index, sub_index) = (sdo.index, sdo.sub_index);
                let text = || format!("{}: SDO {index:#06x}:{sub_index:02x} assigns PDOs", self.station);
                self.bus.step(Subject::Mail, text);
            });
            match assigned.await {
                Ok(Assigned::AsKnown) => {}
                Ok(Assigned::Held(assignment)) => held.push(assignment),
                Err(error) => {
                    self.refused(plan.wanted.sync_manager, error)?;
                    is_whole = false;
                }
            }
        }
        if is_whole && !held.is_empty() {
            self.observe_pdos(PdoFinding::Held(&held));
        } else if !is_whole && self.mailbox.has_written_pdos() {
            self.observe_pdos(PdoFinding::Outdated);
        }
        self.mailbox.forget_written_pdos();
        Ok(())
    }

    /// Whether all PDOs are planned: those of start-up commands are not.
    fn is_planned_whole(&self) -> bool {
        self.setup.plan.pdos.len() == self.setup.plan.process_data.len()
    }

    /// Whether the dictionary holds what is known of it: it is as at power-on, and no start-up command has written it.
    /// An SII without any PDO says nothing about it.
    fn is_dictionary_known(&self) -> bool {
        let view = self.segment.view();
        let info = view.member(self.index).and_then(|member| member.info);
        let is_known = info.is_some_and(|info| match info.pdo_source {
            PdoSource::Sii => !info.pdos.is_empty(),
            source => source.is_of_power_on(),
        });
        is_known && !self.mailbox.has_written_pdos()
    }

    fn refused(&self, sync_manager: u8, error: SdoError) -> Result<(), ConfigureError> {
        let error = ConfigureError::Sdo(error);
        if self.config.refused_pdos == RefusedPdos::Fail || is_of_bus(&error) {
            return Err(error);
        }
        let what = format!("SM {sync_manager}: its PDOs are not as declared: {error}");
        self.segment.observe_member((self.index, self.attempt), MemberFinding::SettingFinding(what));
        Ok(())
    }

    fn observe_pdos(&self, finding: PdoFinding<'_>) {
        self.segment.observe_member((self.index, self.attempt), MemberFinding::Pdos(finding));
    }
}
