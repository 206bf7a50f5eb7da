//! AoE: ADS requests to the ports of a SubDevice (protocol 6.7).

use alloc::string::String;
use alloc::vec;
use alloc::vec::Vec;
use core::fmt;

use ringcat_wire::mailbox::PayloadError;
use ringcat_wire::mailbox::aoe::{AdsCommand, AdsErrorCode, AdsRequest, AdsResponse, AmsAddress, AmsHeader};

use super::conversation::Limits;
use super::lane::Lane;
use super::{Mailbox, MailboxError};

/// Source and target of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct AoeRoute {
    /// NetId and port in the SubDevice.
    pub target: AmsAddress,
    /// NetId and port of the MainDevice.
    pub source: AmsAddress,
}

impl AoeRoute {
    /// A request from `source` to `target`.
    pub const fn new(target: AmsAddress, source: AmsAddress) -> AoeRoute {
        AoeRoute { target, source }
    }
}

/// Why a request failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum AoeError {
    /// The mailbox failed.
    Mailbox(MailboxError),
    /// The request did not reach its ADS port.
    Undelivered(AdsErrorCode),
    /// The ADS port refused.
    Refused(AdsErrorCode),
    /// The answer is malformed.
    Malformed(PayloadError),
}

impl fmt::Display for AoeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("AoE: ")?;
        match self {
            AoeError::Mailbox(error) => error.fmt(f),
            AoeError::Undelivered(code) => write!(f, "not delivered: {code}"),
            AoeError::Refused(code) => write!(f, "refused by the SubDevice: {code}"),
            AoeError::Malformed(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for AoeError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            AoeError::Mailbox(error) => Some(error),
            AoeError::Malformed(error) => Some(error),
            _ => None,
        }
    }
}

impl From<MailboxError> for AoeError {
    fn from(error: MailboxError) -> AoeError {
        AoeError::Mailbox(error)
    }
}

/// Name and version of a device.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct AoeDeviceInfo {
    /// Major version.
    pub major: u8,
    /// Minor version.
    pub minor: u8,
    /// Build.
    pub build: u16,
    /// Name.
    pub name: String,
}

/// States of ADS and of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct AoeStates {
    /// State of ADS: 5 is run, 6 stop.
    pub ads: u16,
    /// State of the device, in its own numbers.
    pub device: u16,
}

impl AoeStates {
    /// States with these values.
    pub const fn new(ads: u16, device: u16) -> AoeStates {
        AoeStates { ads, device }
    }
}

/// Reads at most `length` bytes.
pub async fn read(
    mailbox: &Mailbox,
    route: AoeRoute,
    (group, offset): (u32, u32),
    length: u32,
    limits: Limits,
) -> Result<Vec<u8>, AoeError> {
    data(mailbox, route, &AdsRequest::Read { group, offset, length }, limits).await
}

/// Writes.
pub async fn write(
    mailbox: &Mailbox,
    route: AoeRoute,
    (group, offset): (u32, u32),
    data: &[u8],
    limits: Limits,
) -> Result<(), AoeError> {
    request(mailbox, route, &AdsRequest::Write { group, offset, data }, limits, |_| Some(())).await
}

/// Writes, then reads at most `read_length` bytes.
pub async fn read_write(
    mailbox: &Mailbox,
    route: AoeRoute,
    (group, offset): (u32, u32),
    read_length: u32,
    written: &[u8],
    limits: Limits,
) -> Result<Vec<u8>, AoeError> {
    data(mailbox, route, &AdsRequest::ReadWrite { group, offset, read_length, data: written }, limits).await
}

/// The states of ADS and of the device.
pub async fn read_state(mailbox: &Mailbox, route: AoeRoute, limits: Limits) -> Result<AoeStates, AoeError> {
    let states = |response: AdsResponse<'_>| match response {
        AdsResponse::State { ads_state, device_state, .. } => Some(AoeStates::new(ads_state, device_state)),
        AdsResponse::DeviceInfo { .. } | AdsResponse::Data { .. } | AdsResponse::Done { .. } => None,
    };
    request(mailbox, route, &AdsRequest::ReadState, limits, states).await
}

/// Changes the states of ADS and of the device.
pub async fn write_control(
    mailbox: &Mailbox,
    route: AoeRoute,
    states: AoeStates,
    data: &[u8],
    limits: Limits,
) -> Result<(), AoeError> {
    let control = AdsRequest::WriteControl { ads_state: states.ads, device_state: states.device, data };
    request(mailbox, route, &control, limits, |_| Some(())).await
}

/// Name and version.
pub async fn read_device_info(mailbox: &Mailbox, route: AoeRoute, limits: Limits) -> Result<AoeDeviceInfo, AoeError> {
    let info = |response: AdsResponse<'_>| match response {
        AdsResponse::DeviceInfo { major, minor, build, name, .. } => {
            let end = name.iter().position(|byte| *byte == 0).unwrap_or(name.len());
            let name = String::from_utf8_lossy(&name[..end]).into_owned();
            Some(AoeDeviceInfo { major, minor, build, name })
        }
        AdsResponse::Data { .. } | AdsResponse::State { .. } | AdsResponse::Done { .. } => None,
    };
    request(mailbox, route, &AdsRequest::ReadDeviceInfo, limits, info).await
}

async fn data(mailbox: &Mailbox, route: AoeRoute, ads: &AdsRequest<'_>, limits: Limits) -> Result<Vec<u8>, AoeError> {
    let data = |response: AdsResponse<'_>| match response {
        AdsResponse::Data { data, .. } => Some(data.to_vec()),
        AdsResponse::DeviceInfo { .. } | AdsResponse::State { .. } | AdsResponse::Done { .. } => None,
    };
    request(mailbox, route, ads, limits, data).await
}

/// Sends a request and waits for the response with its invoke id.
async fn request<T>(
    mailbox: &Mailbox,
    route: AoeRoute,
    ads: &AdsRequest<'_>,
    limits: Limits,
    take: impl Fn(AdsResponse<'_>) -> Option<T>,
) -> Result<T, AoeError> {
    let mut conversation = mailbox.conversation(Lane::Aoe).await?;
    let (command, invoke_id) = (ads.command(), conversation.number());
    let mut payload = vec![0; conversation.request_capacity().max(AmsHeader::LEN)];
    let limit = payload.len();
    let too_long = MailboxError::TooLong { bytes: limit + 1, limit };
    let length = ads.encode(&mut payload[AmsHeader::LEN..]).ok_or(too_long)?;
    let AoeRoute { target, source } = route;
    let (flags, error) = (AmsHeader::REQUEST, AdsErrorCode::NO_ERROR);
    let header = AmsHeader { target, source, command, flags, length: length as u32, error, invoke_id };
    payload[..AmsHeader::LEN].copy_from_slice(&header.encode());
    let accept = |payload: &[u8]| answer(payload, command, invoke_id, &take);
    conversation.request(&payload[..AmsHeader::LEN + length], limits, accept).await?
}

/// Sends a whole request, an AMS header with its data, and waits for the response with its invoke id.
pub(crate) async fn send(mailbox: &Mailbox, message: &[u8], limits: Limits) -> Result<(), AoeError> {
    let (header, _) = AmsHeader::decode(message).map_err(AoeError::Malformed)?;
    let mut conversation = mailbox.conversation(Lane::Aoe).await?;
    let (bytes, limit) = (message.len(), conversation.request_capacity());
    if bytes > limit {
        return Err(MailboxError::TooLong { bytes, limit }.into());
    }
    let accept = |payload: &[u8]| answer(payload, header.command, header.invoke_id, |_| Some(()));
    conversation.request(message, limits, accept).await?
}

fn answer<T>(
    payload: &[u8],
    command: AdsCommand,
    invoke_id: u32,
    take: impl Fn(AdsResponse<'_>) -> Option<T>,
) -> Option<Result<T, AoeError>> {
    let (header, data) = AmsHeader::decode(payload).ok()?;
    if !header.is_response() || header.invoke_id != invoke_id || header.command != command {
        return None;
    }
    if header.error != AdsErrorCode::NO_ERROR {
        return Some(Err(AoeError::Undelivered(header.error)));
    }
    let response = match AdsResponse::decode(command, data) {
        Ok(response) => response,
        Err(error) => return Some(Err(AoeError::Malformed(error))),
    };
    if response.result() != AdsErrorCode::NO_ERROR {
        return Some(Err(AoeError::Refused(response.result())));
    }
    take(response).map(Ok)
}
