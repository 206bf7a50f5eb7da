//! SDO transfers: expedited, normal and segmented, complete access, aborts (protocol 6.3).

use ringcat_wire::al::AlState;
use ringcat_wire::mailbox::ErrorReply;
use ringcat_wire::mailbox::sdo::{
    AbortCode, EXPEDITED_MAX_DATA, INITIATE_LEN, SEGMENT_MIN_DATA, SEGMENT_OVERHEAD, SdoError, SdoRequest, SdoResponse,
};

use super::objects::Objects;
use crate::application::answer::Answer;
use crate::application::dictionary::MAX_TRANSFER_BYTES;

/// A segmented transfer of an object.
#[derive(Clone, Debug, Default)]
pub struct Transfer {
    open: Option<Open>,
}

#[derive(Clone, Debug)]
struct Open {
    index: u16,
    sub_index: u8,
    complete_access: bool,
    /// Expected toggle of the next segment.
    toggle: bool,
    /// All data of an upload, the received data of a download.
    data: Vec<u8>,
    kind: Kind,
}

#[derive(Clone, Copy, Debug)]
enum Kind {
    /// Bytes sent.
    Upload { sent: usize },
    /// Announced number of bytes.
    Download { total: usize },
}

impl Transfer {
    /// Serves one SDO request.
    pub fn serve(&mut self, payload: &[u8], room: usize, objects: &mut Objects<'_>) -> Answer {
        match SdoRequest::decode(payload) {
            Ok(request) => self.request(&request, room, objects),
            Err(SdoError::Short { .. }) => Answer::Error(ErrorReply::SIZE_TOO_SHORT),
            Err(SdoError::Command { .. }) => abort(0, 0, AbortCode::UNKNOWN_COMMAND),
            Err(_) => Answer::Error(ErrorReply::SERVICE_NOT_SUPPORTED),
        }
    }

    fn request(&mut self, request: &SdoRequest<'_>, room: usize, objects: &mut Objects<'_>) -> Answer {
        match *request {
            SdoRequest::DownloadSegment { toggle, last, data } => self.download_segment(toggle, last, data, objects),
            SdoRequest::UploadSegment { toggle } => self.upload_segment(toggle, room),
            SdoRequest::Abort { .. } => {
                self.open = None;
                Answer::Silence
            }
            // A new transfer ends the previous one.
            SdoRequest::DownloadExpedited { index, sub_index, complete_access, data } => {
                self.open = None;
                download(index, sub_index, complete_access, data, objects)
            }
            SdoRequest::DownloadNormal { index, sub_index, complete_access, total, data } => {
                self.open = None;
                let total = usize::try_from(total).unwrap_or(usize::MAX);
                if total == data.len() {
                    return download(index, sub_index, complete_access, data, objects);
                }
                match check_download(index, sub_index, complete_access, total, objects) {
                    Ok(()) => {
                        let (data, kind) = (data.to_vec(), Kind::Download { total });
                        self.open = Some(Open { index, sub_index, complete_access, toggle: false, data, kind });
                        encode(&SdoResponse::DownloadDone { index, sub_index })
                    }
                    Err(code) => abort(index, sub_index, code),
                }
            }
            SdoRequest::Upload { index, sub_index, complete_access } => {
                self.open = None;
                self.upload(index, sub_index, complete_access, room, objects)
            }
        }
    }

    fn upload(
        &mut self,
        index: u16,
        sub_index: u8,
        complete_access: bool,
        room: usize,
        objects: &Objects<'_>,
    ) -> Answer {
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
        let sent = data.len().min(room.saturating_sub(INITIATE_LEN));
        let first = SdoResponse::UploadNormal { index, sub_index, complete_access, total, data: &data[..sent] };
        let answer = encode(&first);
        if sent < data.len() {
            let kind = Kind::Upload { sent };
            self.open = Some(Open { index, sub_index, complete_access, toggle: false, data, kind });
        }
        answer
    }

    fn upload_segment(&mut self, toggle: bool, room: usize) -> Answer {
        let Some(open) = &mut self.open else {
            return abort(0, 0, AbortCode::UNKNOWN_COMMAND);
        };
        let Kind::Upload { sent } = &mut open.kind else {
            return self.abort_transfer(AbortCode::UNKNOWN_COMMAND);
        };
        if toggle != open.toggle {
            return self.abort_transfer(AbortCode::TOGGLE_NOT_ALTERNATED);
        }
        let rest = &open.data[*sent..];
        let piece = &rest[..rest.len().min(room.saturating_sub(SEGMENT_OVERHEAD).max(SEGMENT_MIN_DATA))];
        let last = piece.len() == rest.len();
        let answer = encode(&SdoResponse::UploadSegment { toggle, last, data: piece });
        *sent += piece.len();
        open.toggle = !toggle;
        if last {
            self.open = None;
        }
        answer
    }

    fn download_segment(&mut self, toggle: bool, last: bool, data: &[u8], objects: &mut Objects<'_>) -> Answer {
        let Some(open) = &mut self.open else {
            return abort(0, 0, AbortCode::UNKNOWN_COMMAND);
        };
        let Kind::Download { total } = open.kind else {
            return self.abort_transfer(AbortCode::UNKNOWN_COMMAND);
        };
        if toggle != open.toggle {
            return self.abort_transfer(AbortCode::TOGGLE_NOT_ALTERNATED);
        }
        if open.data.len() + data.len() > total {
            return self.abort_transfer(AbortCode::LENGTH_TOO_LONG);
        }
        open.data.extend_from_slice(data);
        open.toggle = !toggle;
        if last {
            if open.data.len() != total {
                return self.abort_transfer(AbortCode::LENGTH_TOO_SHORT);
            }
            let (index, sub_index, complete_access) = (open.index, open.sub_index, open.complete_access);
            let data = core::mem::take(&mut open.data);
            self.open = None;
            if let Err(code) = write(index, sub_index, complete_access, &data, objects) {
                return abort(index, sub_index, code);
            }
        }
        encode(&SdoResponse::DownloadSegmentDone { toggle })
    }

    /// Aborts the transfer.
    fn abort_transfer(&mut self, code: AbortCode) -> Answer {
        let (index, sub_index) = self.open.take().map_or((0, 0), |open| (open.index, open.sub_index));
        abort(index, sub_index, code)
    }
}

/// Whether a segmented download is possible, checked before its data arrives.
fn check_download(
    index: u16,
    sub_index: u8,
    complete: bool,
    total: usize,
    objects: &Objects<'_>,
) -> Result<(), AbortCode> {
    if total > MAX_TRANSFER_BYTES {
        return Err(AbortCode::OUT_OF_MEMORY);
    }
    if complete {
        check_complete(sub_index, objects)?;
        return objects.dictionary.object(index).map(|_| ()).ok_or(AbortCode::OBJECT_DOES_NOT_EXIST);
    }
    check_unmapped(index, sub_index, objects)?;
    objects.dictionary.check_access(index, sub_index, total, objects.state)
}

fn download(index: u16, sub_index: u8, complete: bool, data: &[u8], objects: &mut Objects<'_>) -> Answer {
    match write(index, sub_index, complete, data, objects) {
        Ok(()) => encode(&SdoResponse::DownloadDone { index, sub_index }),
        Err(code) => abort(index, sub_index, code),
    }
}

fn write(index: u16, sub_index: u8, complete: bool, data: &[u8], objects: &mut Objects<'_>) -> Result<(), AbortCode> {
    if complete {
        check_complete(sub_index, objects)?;
        return objects.dictionary.write_complete(index, sub_index, data, objects.state);
    }
    check_unmapped(index, sub_index, objects)?;
    objects.dictionary.write(index, sub_index, data, objects.state)
}

/// Outputs exchanged as process data cannot be written by mailbox in OP.
fn check_unmapped(index: u16, sub_index: u8, objects: &Objects<'_>) -> Result<(), AbortCode> {
    let mapped = objects.state == AlState::Op && objects.process_data.is_output(index, sub_index);
    if mapped { Err(AbortCode::MAPPED_TO_RX_PDO) } else { Ok(()) }
}

fn check_complete(sub_index: u8, objects: &Objects<'_>) -> Result<(), AbortCode> {
    if !objects.complete_access {
        return Err(AbortCode::COMPLETE_ACCESS_NOT_SUPPORTED);
    }
    if sub_index > 1 { Err(AbortCode::SUB_INDEX_DOES_NOT_EXIST) } else { Ok(()) }
}

/// A value in the process data takes precedence over the value in the dictionary.
fn read(index: u16, sub_index: u8, objects: &Objects<'_>) -> Result<Vec<u8>, AbortCode> {
    let mut value = objects.dictionary.read(index, sub_index)?.to_vec();
    if let Some(current) = objects.process_data.value(index, sub_index) {
        for (byte, new) in value.iter_mut().zip(current.to_le_bytes()) {
            *byte = new;
        }
    }
    Ok(value)
}

/// An abort as an answer.
pub fn abort(index: u16, sub_index: u8, code: AbortCode) -> Answer {
    encode(&SdoResponse::Abort { index, sub_index, code })
}

fn encode(response: &SdoResponse<'_>) -> Answer {
    let data = match response {
        SdoResponse::UploadNormal { data, .. } | SdoResponse::UploadSegment { data, .. } => data.len(),
        SdoResponse::DownloadDone { .. }
        | SdoResponse::UploadExpedited { .. }
        | SdoResponse::DownloadSegmentDone { .. }
        | SdoResponse::Abort { .. } => 0,
    };
    let mut bytes = vec![0; INITIATE_LEN + data];
    match response.encode(&mut bytes) {
        Some(length) => {
            bytes.truncate(length);
            Answer::payload(bytes)
        }
        None => Answer::Error(ErrorReply::NO_MORE_MEMORY),
    }
}
