//! Start-up commands of a transition, one after the other in the order of the declaration.

use super::{BringUp, ConfigureError, StartupError};
use crate::config::{IdnWrite, SdoDownload, StartupAction, Transition};
use crate::mail::coe::{self, SdoAddress};
use crate::mail::eoe;
use crate::mail::soe::{self, SoeAddress};

impl BringUp<'_> {
    /// Sends all commands of a transition. The first that fails ends it.
    pub(super) async fn command(&self, transition: Transition) -> Result<(), ConfigureError> {
        let all = self.config.startup.iter().enumerate();
        for (number, command) in all.filter(|(_, command)| command.transition == transition) {
            let sent = self.send(&command.action).await;
            sent.map_err(|error| ConfigureError::Startup { number, transition, error })?;
        }
        Ok(())
    }

    async fn send(&self, action: &StartupAction) -> Result<(), StartupError> {
        let timeouts = &self.config.timeouts;
        match action {
            StartupAction::Sdo(SdoDownload { index, sub_index, complete_access, data }) => {
                let object = SdoAddress { index: *index, sub_index: *sub_index, complete_access: *complete_access };
                let limits = (timeouts.mailbox_request, timeouts.sdo);
                coe::write(&self.mailbox, object, data, limits).await.map_err(StartupError::Sdo)
            }
            StartupAction::Idn(IdnWrite { drive, idn, data }) => {
                let limits = (timeouts.mailbox_request, timeouts.soe);
                let address = SoeAddress::value(*drive, *idn);
                soe::write(&self.mailbox, address, data, limits).await.map_err(StartupError::Soe)
            }
            StartupAction::Ip(settings) => {
                let limits = (timeouts.mailbox_request, timeouts.eoe);
                eoe::set_ip(&self.mailbox, 0, settings, limits).await.map_err(StartupError::Eoe)
            }
        }
    }
}
