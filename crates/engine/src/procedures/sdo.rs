//! SDO download and upload, expedited and normal (facts 6.3).

use alloc::vec;
use alloc::vec::Vec;
use core::fmt;
use core::time::Duration;

use ringcat_wire::mailbox::sdo::{AbortCode, EXPEDITED_MAX_DATA, INITIATE_LEN, SdoRequest, SdoResponse};
use ringcat_wire::mailbox::{Message, Protocol};

use super::mailbox::{Mailbox, MailboxError};
use crate::supervisor::Bus;

/// Which object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SdoAddress {
    /// Index.
    pub index: u16,
    /// Subindex.
    pub sub_index: u8,
    /// All entries at once.
    pub complete_access: bool,
}

impl fmt::Display for SdoAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:#06x}:{:02x}", self.index, self.sub_index)?;
        if self.complete_access { f.write_str(" (complete access)") } else { Ok(()) }
    }
}

/// Why an SDO transfer failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SdoError {
    /// The object.
    pub object: SdoAddress,
    /// What happened.
    pub cause: SdoFailure,
}

/// What happened to an SDO transfer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SdoFailure {
    /// The mailbox failed.
    Mailbox(MailboxError),
    /// The SubDevice aborted.
    Aborted(AbortCode),
    /// The data needs segments, which this version does not speak.
    NeedsSegments {
        /// Bytes of the object.
        bytes: usize,
        /// Bytes that a normal transfer carries.
        limit: usize,
    },
}

impl fmt::Display for SdoError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "SDO {}: ", self.object)?;
        match &self.cause {
            SdoFailure::Mailbox(error) => error.fmt(f),
            SdoFailure::Aborted(code) => write!(f, "aborted by the SubDevice: {code}"),
            SdoFailure::NeedsSegments { bytes, limit } => {
                write!(f, "{bytes} bytes, a normal transfer through this mailbox carries {limit}")
            }
        }
    }
}

impl core::error::Error for SdoError {}

/// Time limits: until the mailbox takes the request, until the answer is there.
pub type Limits = (Duration, Duration);

/// Writes an object.
pub async fn download(
    bus: &Bus,
    mailbox: &mut Mailbox,
    object: SdoAddress,
    data: &[u8],
    limits: Limits,
    other: impl FnMut(&Message<'_>),
) -> Result<(), SdoError> {
    let SdoAddress { index, sub_index, complete_access } = object;
    let limit = mailbox.capacity().saturating_sub(INITIATE_LEN);
    let request = if (1..=EXPEDITED_MAX_DATA).contains(&data.len()) {
        SdoRequest::DownloadExpedited { index, sub_index, complete_access, data }
    } else if data.len() <= limit {
        SdoRequest::DownloadNormal { index, sub_index, complete_access, total: data.len() as u32, data }
    } else {
        return Err(SdoError { object, cause: SdoFailure::NeedsSegments { bytes: data.len(), limit } });
    };
    let answer = exchange(bus, mailbox, object, &request, limits, other, |response| match response {
        SdoResponse::DownloadDone { index: i, sub_index: s } => (i == index && s == sub_index).then_some(Ok(())),
        SdoResponse::Abort { index: i, sub_index: s, code } => (i == index && s == sub_index).then_some(Err(code)),
        _ => None,
    });
    answer.await?.map_err(|code| SdoError { object, cause: SdoFailure::Aborted(code) })
}

/// Reads an object.
pub async fn upload(
    bus: &Bus,
    mailbox: &mut Mailbox,
    object: SdoAddress,
    limits: Limits,
    other: impl FnMut(&Message<'_>),
) -> Result<Vec<u8>, SdoError> {
    let SdoAddress { index, sub_index, complete_access } = object;
    let request = SdoRequest::Upload { index, sub_index, complete_access };
    let answer = exchange(bus, mailbox, object, &request, limits, other, |response| match response {
        SdoResponse::UploadExpedited { index: i, sub_index: s, data, .. } => {
            (i == index && s == sub_index).then(|| Ok((data.len(), data.to_vec())))
        }
        SdoResponse::UploadNormal { index: i, sub_index: s, total, data, .. } => {
            (i == index && s == sub_index).then(|| Ok((total as usize, data.to_vec())))
        }
        SdoResponse::Abort { index: i, sub_index: s, code } => (i == index && s == sub_index).then_some(Err(code)),
        _ => None,
    });
    let (total, data) = answer.await?.map_err(|code| SdoError { object, cause: SdoFailure::Aborted(code) })?;
    if data.len() < total {
        return Err(SdoError { object, cause: SdoFailure::NeedsSegments { bytes: total, limit: data.len() } });
    }
    Ok(data)
}

/// Sends a request and waits for the response that `accept` takes for its own.
async fn exchange<T>(
    bus: &Bus,
    mailbox: &mut Mailbox,
    object: SdoAddress,
    request: &SdoRequest<'_>,
    limits: Limits,
    other: impl FnMut(&Message<'_>),
    mut accept: impl FnMut(SdoResponse<'_>) -> Option<T>,
) -> Result<T, SdoError> {
    let failed = |error| SdoError { object, cause: SdoFailure::Mailbox(error) };
    let mut payload = vec![0; mailbox.capacity()];
    let Some(length) = request.encode(&mut payload) else {
        return Err(failed(MailboxError::TooLong { bytes: INITIATE_LEN, limit: payload.len() }));
    };
    let accept = |message: &Message<'_>| {
        if message.header.protocol != Protocol::Coe {
            return None;
        }
        accept(SdoResponse::decode(message.payload).ok()?)
    };
    mailbox.exchange(bus, Protocol::Coe, &payload[..length], limits, accept, other).await.map_err(failed)
}
