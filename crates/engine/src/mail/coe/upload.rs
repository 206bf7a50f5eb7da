//! SDO upload: reading an object.

use alloc::vec::Vec;

use ringcat_wire::mailbox::sdo::{AbortCode, SdoRequest, SdoResponse};

use super::address::SdoAddress;
use super::error::{SdoError, SdoFailure};
use super::transfer::Transfer;
use crate::mail::stream::{Bounded, Overflow, Sink};
use crate::mail::{Limits, Mailbox};
use crate::supervisor::long_transfers::TransferKind;

/// Reads an object of at most `limit` bytes.
pub async fn read(mailbox: &Mailbox, object: SdoAddress, limits: Limits, limit: usize) -> Result<Vec<u8>, SdoError> {
    let mut sink = Bounded::new(limit);
    upload(mailbox, object, limits, &mut sink).await?;
    Ok(sink.into_bytes())
}

/// The first response of an upload: the size of the object, and its first data.
struct First {
    total: u64,
    data: Vec<u8>,
}

/// Reads an object of any size; each of `limits` applies to one message.
pub async fn upload(
    mailbox: &Mailbox,
    object: SdoAddress,
    limits: Limits,
    sink: &mut impl Sink,
) -> Result<(), SdoError> {
    let SdoAddress { index, sub_index, complete_access } = object;
    let mut transfer = Transfer::begin(mailbox, object, limits).await?;
    let ours = |i, s| i == index && s == sub_index;
    let request = SdoRequest::Upload { index, sub_index, complete_access };
    let first = transfer.exchange(&request, |response| match response {
        SdoResponse::UploadExpedited { index, sub_index, data, .. } => {
            ours(index, sub_index).then(|| First { total: data.len() as u64, data: data.to_vec() })
        }
        SdoResponse::UploadNormal { index, sub_index, total, data, .. } => {
            ours(index, sub_index).then(|| First { total: total.into(), data: data.to_vec() })
        }
        _ => None,
    });
    let First { total, data } = first.await?;
    let mut got = data.len() as u64;
    if got >= total {
        transfer.done();
    }
    taken(&mut transfer, sink.begin(Some(total)))?;
    taken(&mut transfer, sink.take(&data))?;
    let under_way = (got < total).then(|| mailbox.begin_transfer(TransferKind::ObjectRead, Some(total)));
    let mut toggle = false;
    while got < total {
        let (data, last) = segment(&mut transfer, toggle).await?;
        got += data.len() as u64;
        under_way.iter().for_each(|it| it.done(got));
        if got > total || (last && got < total) {
            if last {
                transfer.done();
            }
            return Err(transfer.abort(AbortCode::LENGTH_MISMATCH, SdoFailure::Size { announced: total, got }));
        }
        if last {
            transfer.done();
        }
        taken(&mut transfer, sink.take(&data))?;
        if !last && data.is_empty() {
            return Err(transfer.abort(AbortCode::GENERAL, SdoFailure::EmptySegment));
        }
        toggle = !toggle;
    }
    // All data is received, although no segment was marked as the last one.
    transfer.done();
    Ok(())
}

/// The next segment, and whether it is the last one.
async fn segment(transfer: &mut Transfer, toggle: bool) -> Result<(Vec<u8>, bool), SdoError> {
    let request = SdoRequest::UploadSegment { toggle };
    let answer = transfer.exchange(&request, |response| match response {
        SdoResponse::UploadSegment { toggle, last, data } => Some((toggle, last, data.to_vec())),
        _ => None,
    });
    let (answered, last, data) = answer.await?;
    if answered != toggle {
        return Err(transfer.abort(AbortCode::TOGGLE_NOT_ALTERNATED, SdoFailure::Toggle));
    }
    Ok((data, last))
}

fn taken(transfer: &mut Transfer, result: Result<(), Overflow>) -> Result<(), SdoError> {
    result.map_err(|overflow| transfer.abort(AbortCode::OUT_OF_MEMORY, SdoFailure::TooLong(overflow)))
}
