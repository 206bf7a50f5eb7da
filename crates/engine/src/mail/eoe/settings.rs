//! Sets and reads IP parameters and address filter of a SubDevice (protocol 6.5).

use alloc::vec;

use ringcat_wire::mailbox::eoe::{AddressFilter, EoeBody, EoeMessage, EoeResult, IpParameters, MAX_NAME};

use super::error::{EoeError, EoeFailure};
use crate::config::IpSettings;
use crate::mail::conversation::Limits;
use crate::mail::lane::Lane;
use crate::mail::{Mailbox, MailboxError};

/// Bytes of the longest request: the address filter.
const MAX_REQUEST: usize = 128;

impl IpSettings {
    fn parameters(&self) -> Result<IpParameters<'_>, EoeFailure> {
        let IpSettings { mac, address, mask, gateway, dns, name } = self;
        match name {
            Some(name) if name.len() > MAX_NAME => Err(EoeFailure::LongName { bytes: name.len() }),
            _ => Ok(IpParameters {
                mac: *mac,
                address: *address,
                mask: *mask,
                gateway: *gateway,
                dns: *dns,
                name: name.as_deref(),
            }),
        }
    }
}

impl From<IpParameters<'_>> for IpSettings {
    fn from(parameters: IpParameters<'_>) -> IpSettings {
        let IpParameters { mac, address, mask, gateway, dns, name } = parameters;
        IpSettings { mac, address, mask, gateway, dns, name: name.map(<[u8]>::to_vec) }
    }
}

/// Sets the IP parameters at a port of the SubDevice; 0 is the SubDevice itself or any.
pub async fn set_ip(mailbox: &Mailbox, port: u8, settings: &IpSettings, limits: Limits) -> Result<(), EoeError> {
    let parameters = settings.parameters().map_err(|cause| EoeError { port, cause })?;
    request(mailbox, port, EoeBody::SetIp(parameters), limits, |body| match body {
        EoeBody::SetIpDone(result) => Some((result, ())),
        _ => None,
    })
    .await
}

/// Reads the IP parameters at a port of the SubDevice.
pub async fn read_ip(mailbox: &Mailbox, port: u8, limits: Limits) -> Result<IpSettings, EoeError> {
    request(mailbox, port, EoeBody::GetIp, limits, |body| match body {
        EoeBody::Ip(result, parameters) => Some((result, parameters.into())),
        _ => None,
    })
    .await
}

/// Sets the address filter of a port of the SubDevice.
pub async fn set_filter(mailbox: &Mailbox, port: u8, filter: AddressFilter, limits: Limits) -> Result<(), EoeError> {
    request(mailbox, port, EoeBody::SetFilter(filter), limits, |body| match body {
        EoeBody::SetFilterDone(result) => Some((result, ())),
        _ => None,
    })
    .await
}

/// Reads the address filter of a port of the SubDevice.
pub async fn read_filter(mailbox: &Mailbox, port: u8, limits: Limits) -> Result<AddressFilter, EoeError> {
    request(mailbox, port, EoeBody::GetFilter, limits, |body| match body {
        EoeBody::Filter(result, filter) => Some((result, filter)),
        _ => None,
    })
    .await
}

async fn request<T>(
    mailbox: &Mailbox,
    port: u8,
    body: EoeBody<'_>,
    limits: Limits,
    answer: impl Fn(EoeBody<'_>) -> Option<(EoeResult, T)>,
) -> Result<T, EoeError> {
    let failed = |cause| EoeError { port, cause };
    let mut payload = vec![0; MAX_REQUEST];
    let too_long = MailboxError::TooLong { bytes: MAX_REQUEST, limit: payload.len() };
    let length = EoeMessage { port, body }.encode(&mut payload).ok_or(failed(too_long.into()))?;
    let exchange = async {
        let mut conversation = mailbox.conversation(Lane::Eoe).await?;
        conversation.settle().await?;
        let accept = |payload: &[u8]| {
            let message = EoeMessage::decode(payload).ok()?;
            // Some SubDevices always answer with port 0.
            if message.port == port || message.port == 0 { answer(message.body) } else { None }
        };
        conversation.request(&payload[..length], limits, accept).await
    };
    match exchange.await {
        Ok((EoeResult::OK, value)) => Ok(value),
        Ok((result, _)) => Err(failed(EoeFailure::Refused(result))),
        Err(error) => Err(failed(error.into())),
    }
}
