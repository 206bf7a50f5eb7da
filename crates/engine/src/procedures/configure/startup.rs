//! Start-up commands of a transition, executed in the order of the declaration.

use core::time::Duration;

use super::{BringUp, ConfigureError, StartupError};
use crate::config::{
    IdnRead, IdnWrite, MailMessage, SdoDownload, SdoUpload, StartupAction, StartupCommand, Transition,
};
use crate::declared::SubDeviceId;
use crate::event::Notice;
use crate::mail::Limits;
use crate::mail::coe::{self, SdoAddress};
use crate::mail::soe::{self, SoeAddress};
use crate::mail::{aoe, eoe, voe};

/// Longest object that a start-up command reads.
const MAX_READ: usize = 0x1_0000;

impl BringUp<'_> {
    /// Sends all commands of a transition. The first error ends it.
    pub(super) async fn command(&self, transition: Transition) -> Result<(), ConfigureError> {
        self.command_those(transition, |_| true).await
    }

    /// Sends the commands that need no mailbox.
    pub(super) async fn command_registers(&self, transition: Transition) -> Result<(), ConfigureError> {
        self.command_those(transition, |action| matches!(action, StartupAction::Register(_))).await
    }

    /// Sends the commands that need the mailbox.
    pub(super) async fn command_mail(&self, transition: Transition) -> Result<(), ConfigureError> {
        self.command_those(transition, |action| !matches!(action, StartupAction::Register(_))).await
    }

    async fn command_those(
        &self,
        transition: Transition,
        wanted: fn(&StartupAction) -> bool,
    ) -> Result<(), ConfigureError> {
        let all = self.config.startup.iter().enumerate();
        for (number, command) in all.filter(|(_, command)| command.transition == transition && wanted(&command.action))
        {
            let sent = self.send(number, command).await;
            let comment = || command.comment.clone();
            sent.map_err(|error| ConfigureError::Startup { number, transition, comment: comment(), error })?;
        }
        Ok(())
    }

    async fn send(&self, number: usize, command: &StartupCommand) -> Result<(), StartupError> {
        let timeouts = &self.config.timeouts;
        let limits = |usual: Duration| Limits::new(timeouts.mailbox_request, command.limit.unwrap_or(usual));
        match &command.action {
            StartupAction::Sdo(SdoDownload { index, sub_index, complete_access, data }) => {
                let object = SdoAddress { index: *index, sub_index: *sub_index, complete_access: *complete_access };
                coe::write(&self.mailbox, object, data, limits(timeouts.sdo)).await.map_err(StartupError::Sdo)
            }
            StartupAction::Upload(upload) => self.upload(number, command, upload, limits(timeouts.sdo)).await,
            StartupAction::Idn(IdnWrite { drive, idn, data }) => {
                let address = SoeAddress::value(*drive, *idn);
                soe::write(&self.mailbox, address, data, limits(timeouts.soe)).await.map_err(StartupError::Soe)
            }
            StartupAction::IdnRead(read) => self.read_idn(number, command, read, limits(timeouts.soe)).await,
            StartupAction::Mail(MailMessage::Aoe(message)) => {
                aoe::send(&self.mailbox, message, limits(timeouts.sdo)).await.map_err(StartupError::Aoe)
            }
            StartupAction::Mail(MailMessage::Voe(message)) => {
                let limit = command.limit.unwrap_or(timeouts.mailbox_request);
                voe::send_whole(&self.mailbox, message, limit).await.map_err(StartupError::Voe)
            }
            StartupAction::Ip(settings) => {
                eoe::set_ip(&self.mailbox, 0, settings, limits(timeouts.eoe)).await.map_err(StartupError::Eoe)
            }
            StartupAction::Register(command) => self.register(command).await.map_err(StartupError::Register),
        }
    }

    async fn upload(
        &self,
        number: usize,
        command: &StartupCommand,
        upload: &SdoUpload,
        limits: Limits,
    ) -> Result<(), StartupError> {
        let SdoUpload { index, sub_index, complete_access, ref expected } = *upload;
        let object = SdoAddress { index, sub_index, complete_access };
        let data = coe::read(&self.mailbox, object, limits, MAX_READ).await.map_err(StartupError::Sdo)?;
        match expected {
            Some(expected) if *expected != data => {
                Err(StartupError::Value { object, expected: expected.clone(), got: data })
            }
            Some(_) => Ok(()),
            None => {
                let (subdevice, comment) = (self.index, command.comment.clone());
                self.bus.notice(Notice::StartupRead {
                    subdevice: SubDeviceId(subdevice),
                    number,
                    index,
                    sub_index,
                    comment,
                    data,
                });
                Ok(())
            }
        }
    }

    async fn read_idn(
        &self,
        number: usize,
        command: &StartupCommand,
        read: &IdnRead,
        limits: Limits,
    ) -> Result<(), StartupError> {
        let IdnRead { drive, idn, elements, ref expected } = *read;
        let address = SoeAddress { drive, idn, elements };
        let data = soe::read(&self.mailbox, address, limits, MAX_READ).await.map_err(StartupError::Soe)?;
        match expected {
            Some(expected) if *expected != data => {
                Err(StartupError::IdnValue { address, expected: expected.clone(), got: data })
            }
            Some(_) => Ok(()),
            None => {
                let (subdevice, comment) = (SubDeviceId(self.index), command.comment.clone());
                self.bus.notice(Notice::StartupIdn { subdevice, number, drive, idn, comment, data });
                Ok(())
            }
        }
    }
}
