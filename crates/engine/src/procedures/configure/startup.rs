//! Start-up commands of a transition, executed in the order of the declaration.

use alloc::vec::Vec;
use core::time::Duration;

use super::{BringUp, ConfigureError, StartupError};
use crate::config::{
    FileRead, FileWrite, IdnRead, IdnWrite, MailMessage, SdoDownload, SdoUpload, StartupAction, StartupCommand,
    Transition,
};
use crate::declared::SubDeviceId;
use crate::event::{Notice, StartupSource};
use crate::mail::Limits;
use crate::mail::coe::{self, SdoAddress};
use crate::mail::foe::FoeOptions;
use crate::mail::soe::{self, SoeAddress};
use crate::mail::stream::{Bounded, Bytes};
use crate::mail::{aoe, eoe, foe, voe};

/// Longest object or file that a start-up command reads.
const MAX_READ: usize = 0x1_0000;

impl BringUp<'_> {
    /// Sends all commands of a transition. The first error ends it.
    pub(super) async fn command(&self, transition: Transition) -> Result<(), ConfigureError> {
        self.command_those(transition, |_| true).await
    }

    /// Sends the commands of PS that come before the PDO assignment and mapping, or those that come after them.
    pub(super) async fn command_pdos(&self, is_after: bool) -> Result<(), ConfigureError> {
        self.command_those(Transition::Ps, |command| command.is_after_pdos() == is_after).await
    }

    /// Sends the commands that need no mailbox.
    pub(super) async fn command_registers(&self, transition: Transition) -> Result<(), ConfigureError> {
        self.command_those(transition, |command| matches!(command.action, StartupAction::Register(_))).await
    }

    /// Sends the commands that need the mailbox.
    pub(super) async fn command_mail(&self, transition: Transition) -> Result<(), ConfigureError> {
        self.command_those(transition, |command| !matches!(command.action, StartupAction::Register(_))).await
    }

    async fn command_those(
        &self,
        transition: Transition,
        wanted: impl Fn(&StartupCommand) -> bool,
    ) -> Result<(), ConfigureError> {
        let all = self.config.startup.iter().enumerate();
        for (number, command) in all.filter(|(_, command)| command.transition == transition && wanted(command)) {
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
            StartupAction::FileWrite(FileWrite { name, password, data }) => {
                let options = file_options(*password, command, timeouts.mailbox_request);
                let written = foe::write(&self.mailbox, name, options, &mut Bytes::new(data), |_| {}).await;
                written.map(|_| ()).map_err(StartupError::Foe)
            }
            StartupAction::FileRead(read) => self.read_file(number, command, read).await,
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
                self.report(number, command, StartupSource::Object { index, sub_index }, data);
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
                self.report(number, command, StartupSource::Idn { drive, idn }, data);
                Ok(())
            }
        }
    }

    async fn read_file(&self, number: usize, command: &StartupCommand, read: &FileRead) -> Result<(), StartupError> {
        let FileRead { name, password } = read;
        let mut contents = Bounded::new(MAX_READ);
        let options = file_options(*password, command, self.config.timeouts.mailbox_request);
        foe::read(&self.mailbox, name, options, &mut contents, |_| {}).await.map_err(StartupError::Foe)?;
        self.report(number, command, StartupSource::File { name: name.clone() }, contents.into_bytes());
        Ok(())
    }

    /// Reports what a command without a required value has read.
    fn report(&self, number: usize, command: &StartupCommand, source: StartupSource, data: Vec<u8>) {
        let (subdevice, comment) = (SubDeviceId(self.index), command.comment.clone());
        self.bus.notice(Notice::StartupRead { subdevice, number, source, comment, data });
    }
}

/// A message has the limit of its command, else that of FoE.
fn file_options(password: u32, command: &StartupCommand, request: Duration) -> FoeOptions {
    let usual = FoeOptions::default();
    let answer = command.limit.unwrap_or(usual.limits.answer);
    usual.with_password(password).with_limits(Limits::new(request, answer))
}
