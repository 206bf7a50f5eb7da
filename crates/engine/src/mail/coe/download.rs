//! SDO download: writing an object.

use alloc::vec;

use ringcat_wire::mailbox::sdo::{
    AbortCode, EXPEDITED_MAX_DATA, INITIATE_LEN, SEGMENT_OVERHEAD, SdoRequest, SdoResponse,
};

use super::address::SdoAddress;
use super::error::{SdoError, SdoFailure};
use super::transfer::Transfer;
use crate::mail::stream::{Bytes, Source};
use crate::mail::{Limits, Mailbox};
use crate::supervisor::long_transfers::TransferKind;

/// Writes an object.
pub async fn write(mailbox: &Mailbox, object: SdoAddress, data: &[u8], limits: Limits) -> Result<(), SdoError> {
    download(mailbox, object, limits, &mut Bytes::new(data)).await
}

/// Writes an object of any size; each of `limits` applies to one message.
pub async fn download(
    mailbox: &Mailbox,
    object: SdoAddress,
    limits: Limits,
    source: &mut impl Source,
) -> Result<(), SdoError> {
    let SdoAddress { index, sub_index, complete_access } = object;
    let size = source.total().and_then(|total| u32::try_from(total).ok());
    let Some(total) = size else { return Err(SdoError { object, cause: SdoFailure::UnknownSize }) };
    let mut transfer = Transfer::begin(mailbox, object, limits).await?;
    let capacity = transfer.conversation.request_capacity();
    let left = |sent: u64| usize::try_from(u64::from(total) - sent).unwrap_or(usize::MAX);
    let expedited = (1..=EXPEDITED_MAX_DATA).contains(&left(0));
    let beside = if expedited { EXPEDITED_MAX_DATA } else { capacity.saturating_sub(INITIATE_LEN) };
    let mut data = vec![0; beside.min(left(0))];
    fill(&mut transfer, source, &mut data, 0, total)?;
    let request = if expedited {
        SdoRequest::DownloadExpedited { index, sub_index, complete_access, data: &data }
    } else {
        SdoRequest::DownloadNormal { index, sub_index, complete_access, total, data: &data }
    };
    let done = |response: SdoResponse<'_>| match response {
        SdoResponse::DownloadDone { index: i, sub_index: s } => (i == index && s == sub_index).then_some(()),
        _ => None,
    };
    transfer.exchange(&request, done).await?;
    let mut sent = data.len() as u64;
    let more = (sent < u64::from(total)).then_some(total.into());
    let under_way = more.map(|total| mailbox.begin_transfer(TransferKind::ObjectWrite, Some(total)));
    let mut toggle = false;
    while sent < u64::from(total) {
        data.resize(capacity.saturating_sub(SEGMENT_OVERHEAD).max(1).min(left(sent)), 0);
        fill(&mut transfer, source, &mut data, sent, total)?;
        sent += data.len() as u64;
        segment(&mut transfer, toggle, sent == u64::from(total), &data).await?;
        under_way.iter().for_each(|it| it.done(sent));
        toggle = !toggle;
    }
    transfer.done();
    Ok(())
}

async fn segment(transfer: &mut Transfer, toggle: bool, last: bool, data: &[u8]) -> Result<(), SdoError> {
    let request = SdoRequest::DownloadSegment { toggle, last, data };
    let answer = transfer.exchange(&request, |response| match response {
        SdoResponse::DownloadSegmentDone { toggle } => Some(toggle),
        _ => None,
    });
    if answer.await? == toggle {
        return Ok(());
    }
    Err(transfer.abort(AbortCode::TOGGLE_NOT_ALTERNATED, SdoFailure::Toggle))
}

fn fill(
    transfer: &mut Transfer,
    source: &mut impl Source,
    data: &mut [u8],
    sent: u64,
    total: u32,
) -> Result<(), SdoError> {
    let count = source.fill(data);
    if count == data.len() {
        return Ok(());
    }
    let cause = SdoFailure::SourceEnded { got: sent + count as u64, announced: total.into() };
    Err(transfer.abort(AbortCode::GENERAL, cause))
}
