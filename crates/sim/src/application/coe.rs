//! SDO server: expedited and normal transfers, complete access, aborts (facts 6.3).
//!
//! In: the payload of a CoE message, the dictionary, the process data (mapped objects show what is in it), the state.
//! Out: the payload of the answer. Segmented transfers are refused: what does not fit into the mailbox is aborted with
//! 0x06010005; services other than SDO requests get the mailbox error "service not supported".

use ringcat_wire::al::AlState;
use ringcat_wire::mailbox::ErrorReply;
use ringcat_wire::mailbox::coe::{CoeHeader, CoeService};
use ringcat_wire::mailbox::sdo::{AbortCode, EXPEDITED_MAX_DATA, INITIATE_LEN, SdoError, SdoRequest, SdoResponse};

use super::dictionary::Dictionary;
use super::process_data::ProcessData;

/// What a transfer works on.
#[derive(Debug)]
pub struct Objects<'a> {
    /// The objects.
    pub dictionary: &'a mut Dictionary,
    /// Values of mapped objects.
    pub process_data: &'a ProcessData,
    /// Present state; some objects are writable in PREOP alone.
    pub state: AlState,
    /// Complete access is served.
    pub complete_access: bool,
}

/// What a message leads to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Answer {
    /// An answer of the same protocol.
    Payload(Vec<u8>),
    /// An error reply of the mailbox with this detail.
    Error(u16),
    /// Nothing.
    Silence,
}

/// Serves one message. `room` is what the answer may have behind the mailbox header.
pub fn serve(payload: &[u8], room: usize, objects: &mut Objects<'_>) -> Answer {
    let Some(header) = payload.first_chunk() else {
        return Answer::Error(ErrorReply::SIZE_TOO_SHORT);
    };
    if CoeHeader::decode(header).service != CoeService::SdoRequest {
        return Answer::Error(ErrorReply::SERVICE_NOT_SUPPORTED);
    }
    match SdoRequest::decode(payload) {
        Ok(request) => transfer(&request, room, objects),
        Err(SdoError::Short { .. }) => Answer::Error(ErrorReply::SIZE_TOO_SHORT),
        Err(SdoError::Service { .. }) => Answer::Error(ErrorReply::SERVICE_NOT_SUPPORTED),
        Err(SdoError::Command { .. }) => abort(0, 0, AbortCode::UNKNOWN_COMMAND),
    }
}

fn transfer(request: &SdoRequest<'_>, room: usize, objects: &mut Objects<'_>) -> Answer {
    match *request {
        SdoRequest::DownloadExpedited { index, sub_index, complete_access, data } => {
            download(index, sub_index, complete_access, data, objects)
        }
        SdoRequest::DownloadNormal { index, sub_index, complete_access, total, data } => {
            if usize::try_from(total).is_ok_and(|total| total == data.len()) {
                download(index, sub_index, complete_access, data, objects)
            } else {
                abort(index, sub_index, AbortCode::OBJECT_EXCEEDS_MAILBOX)
            }
        }
        SdoRequest::Upload { index, sub_index, complete_access } => {
            upload(index, sub_index, complete_access, room, objects)
        }
        SdoRequest::DownloadSegment { .. } | SdoRequest::UploadSegment { .. } => {
            abort(0, 0, AbortCode::UNKNOWN_COMMAND)
        }
        SdoRequest::Abort { .. } => Answer::Silence,
    }
}

fn download(index: u16, sub_index: u8, complete: bool, data: &[u8], objects: &mut Objects<'_>) -> Answer {
    let result = if complete {
        check_complete(sub_index, objects)
            .and_then(|()| objects.dictionary.write_complete(index, sub_index, data, objects.state))
    } else if objects.state == AlState::Op && objects.process_data.is_output(index, sub_index) {
        Err(AbortCode::MAPPED_TO_RX_PDO)
    } else {
        objects.dictionary.write(index, sub_index, data, objects.state)
    };
    match result {
        Ok(()) => encode(&SdoResponse::DownloadDone { index, sub_index }),
        Err(code) => abort(index, sub_index, code),
    }
}

fn upload(index: u16, sub_index: u8, complete_access: bool, room: usize, objects: &Objects<'_>) -> Answer {
    let result = if complete_access {
        check_complete(sub_index, objects).and_then(|()| objects.dictionary.read_complete(index, sub_index))
    } else {
        read(index, sub_index, objects)
    };
    let data = match result {
        Ok(data) => data,
        Err(code) => return abort(index, sub_index, code),
    };
    if (1..=EXPEDITED_MAX_DATA).contains(&data.len()) {
        return encode(&SdoResponse::UploadExpedited { index, sub_index, complete_access, data: &data });
    }
    let total = data.len() as u32;
    if INITIATE_LEN + data.len() > room {
        return abort(index, sub_index, AbortCode::OBJECT_EXCEEDS_MAILBOX);
    }
    encode(&SdoResponse::UploadNormal { index, sub_index, complete_access, total, data: &data })
}

fn check_complete(sub_index: u8, objects: &Objects<'_>) -> Result<(), AbortCode> {
    if !objects.complete_access {
        return Err(AbortCode::COMPLETE_ACCESS_NOT_SUPPORTED);
    }
    if sub_index > 1 { Err(AbortCode::SUB_INDEX_DOES_NOT_EXIST) } else { Ok(()) }
}

/// The value in the process data goes before the one in the dictionary.
fn read(index: u16, sub_index: u8, objects: &Objects<'_>) -> Result<Vec<u8>, AbortCode> {
    let mut value = objects.dictionary.read(index, sub_index)?.to_vec();
    if let Some(current) = objects.process_data.value(index, sub_index) {
        for (byte, new) in value.iter_mut().zip(current.to_le_bytes()) {
            *byte = new;
        }
    }
    Ok(value)
}

fn abort(index: u16, sub_index: u8, code: AbortCode) -> Answer {
    encode(&SdoResponse::Abort { index, sub_index, code })
}

fn encode(response: &SdoResponse<'_>) -> Answer {
    let data = match response {
        SdoResponse::UploadNormal { data, .. } => data.len(),
        SdoResponse::DownloadDone { .. }
        | SdoResponse::UploadExpedited { .. }
        | SdoResponse::DownloadSegmentDone { .. }
        | SdoResponse::UploadSegment { .. }
        | SdoResponse::Abort { .. } => 0,
    };
    let mut bytes = vec![0; INITIATE_LEN + data];
    match response.encode(&mut bytes) {
        Some(length) => {
            bytes.truncate(length);
            Answer::Payload(bytes)
        }
        None => Answer::Error(ErrorReply::NO_MORE_MEMORY),
    }
}
