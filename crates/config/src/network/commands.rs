//! Start-up commands of a network file as those of the engine.

use std::time::Duration;

use ringcat_engine::config::{
    FileRead, FileWrite, IdnRead, IdnWrite, IpSettings, MailMessage, RegisterAccess, RegisterCommand, SdoDownload,
    SdoUpload, StartupAction, StartupCommand, Transition,
};
use ringcat_wire::address::RegisterAddress;
use ringcat_wire::mailbox::soe::{Idn, SoeElements};

use super::model::{self, At};

/// The command of the engine; `None` if the file does not say what it does.
pub(super) fn command(of: &model::Startup) -> Option<StartupCommand> {
    let transition = match of.at {
        At::Ip => Transition::Ip,
        At::Ps => Transition::Ps,
        At::So => Transition::So,
        At::Os => Transition::Os,
        At::Sp => Transition::Sp,
        At::Ii => Transition::Ii,
        At::Pp => Transition::Pp,
        At::Ss => Transition::Ss,
        At::Pi => Transition::Pi,
        At::Si => Transition::Si,
        At::Oi => Transition::Oi,
        At::Ib => Transition::Ib,
        At::Bi => Transition::Bi,
    };
    let command = StartupCommand::new(transition, action(of)?);
    let command = command.with_limit(of.limit.map(|limit| limit.0)).with_comment(of.comment.clone());
    Some(command.with_after_pdos(of.after_pdos))
}

fn action(of: &model::Startup) -> Option<StartupAction> {
    mail(of).or_else(|| register(of))
}

/// Commands to the mailbox.
fn mail(of: &model::Startup) -> Option<StartupAction> {
    if let Some(sdo) = &of.sdo {
        let download = SdoDownload::new(sdo.index, sdo.sub, sdo.data.0.clone());
        return Some(StartupAction::Sdo(download.with_complete_access(sdo.complete)));
    }
    if let Some(upload) = &of.upload {
        let expected = upload.data.as_ref().map(|data| data.0.clone());
        let of = SdoUpload::new(upload.index, upload.sub).with_complete_access(upload.complete);
        return Some(StartupAction::Upload(of.with_expected(expected)));
    }
    if let Some(idn) = &of.idn {
        return Some(StartupAction::Idn(IdnWrite::new(idn.drive, Idn(idn.idn), idn.data.0.clone())));
    }
    if let Some(ip) = &of.ip {
        let settings = IpSettings::default()
            .with_mac(ip.mac.map(|mac| mac.0))
            .with_address(ip.address)
            .with_mask(ip.mask)
            .with_gateway(ip.gateway)
            .with_dns(ip.dns)
            .with_name(ip.name.as_ref().map(|name| name.as_bytes().to_vec()));
        return Some(StartupAction::Ip(settings));
    }
    if let Some(read) = &of.read_idn {
        let elements = read.elements.map_or(SoeElements::VALUE, SoeElements);
        let expected = read.data.as_ref().map(|data| data.0.clone());
        let command = IdnRead::new(read.drive, Idn(read.idn)).with_elements(elements).with_expected(expected);
        return Some(StartupAction::IdnRead(command));
    }
    if let Some(file) = &of.write_file {
        let write = FileWrite::new(&file.name, file.data.0.clone()).with_password(file.password);
        return Some(StartupAction::FileWrite(write));
    }
    if let Some(file) = &of.read_file {
        return Some(StartupAction::FileRead(FileRead::new(&file.name).with_password(file.password)));
    }
    let aoe = of.aoe.as_ref().map(|data| MailMessage::Aoe(data.0.clone()));
    let message = aoe.or_else(|| of.voe.as_ref().map(|data| MailMessage::Voe(data.0.clone())));
    message.map(StartupAction::Mail)
}

/// Commands to registers.
fn register(of: &model::Startup) -> Option<StartupAction> {
    if let Some(write) = &of.write {
        let access = RegisterAccess::Write(write.data.0.clone());
        let command = RegisterCommand::new(RegisterAddress(write.address), access);
        return Some(StartupAction::Register(command.with_retries(write.retries).with_required(write.required)));
    }
    let check = of.check.as_ref()?;
    let access = RegisterAccess::Check {
        data: check.data.0.clone(),
        mask: check.mask.as_ref().map(|mask| mask.0.clone()),
        limit: check.within.map_or(Duration::ZERO, |within| within.0),
    };
    let command = RegisterCommand::new(RegisterAddress(check.address), access);
    Some(StartupAction::Register(command.with_retries(check.retries).with_required(check.required)))
}
