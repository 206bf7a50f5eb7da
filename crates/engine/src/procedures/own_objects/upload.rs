//! Uploads of the MainDevice's own objects: expedited, normal, in segments (protocol 6.3).

use alloc::vec;
use alloc::vec::Vec;

use ringcat_wire::mailbox::sdo::{
    AbortCode, EXPEDITED_MAX_DATA, INITIATE_LEN, SEGMENT_MIN_DATA, SEGMENT_OVERHEAD, SdoResponse,
};

use crate::mail::coe::SdoAddress;

/// An upload in segments that is under way.
#[derive(Clone, Debug)]
pub(super) struct Upload {
    address: SdoAddress,
    data: Vec<u8>,
    sent: usize,
    /// Toggle bit of the next segment.
    toggle: bool,
}

/// The first answer, and the upload with the data for segments.
pub(super) fn begin(address: SdoAddress, data: Vec<u8>, room: usize) -> (Vec<u8>, Option<Upload>) {
    let SdoAddress { index, sub_index, complete_access } = address;
    if (1..=EXPEDITED_MAX_DATA).contains(&data.len()) {
        return (encode(&SdoResponse::UploadExpedited { index, sub_index, complete_access, data: &data }), None);
    }
    let (total, sent) = (data.len() as u32, data.len().min(room.saturating_sub(INITIATE_LEN)));
    let first = encode(&SdoResponse::UploadNormal { index, sub_index, complete_access, total, data: &data[..sent] });
    let upload = (sent < data.len()).then_some(Upload { address, data, sent, toggle: false });
    (first, upload)
}

impl Upload {
    /// The next segment, and whether it is the last one.
    pub(super) fn segment(&mut self, toggle: bool, room: usize) -> Result<(Vec<u8>, bool), AbortCode> {
        if toggle != self.toggle {
            return Err(AbortCode::TOGGLE_NOT_ALTERNATED);
        }
        let rest = &self.data[self.sent..];
        let piece = &rest[..rest.len().min(room.saturating_sub(SEGMENT_OVERHEAD).max(SEGMENT_MIN_DATA))];
        let last = piece.len() == rest.len();
        let answer = encode(&SdoResponse::UploadSegment { toggle, last, data: piece });
        self.sent += piece.len();
        self.toggle = !toggle;
        Ok((answer, last))
    }

    /// Address of the object.
    pub(super) const fn address(&self) -> SdoAddress {
        self.address
    }
}

/// An abort.
pub(super) fn abort(address: SdoAddress, code: AbortCode) -> Vec<u8> {
    encode(&SdoResponse::Abort { index: address.index, sub_index: address.sub_index, code })
}

/// A response as bytes.
pub(super) fn encode(response: &SdoResponse<'_>) -> Vec<u8> {
    let data = match response {
        SdoResponse::UploadNormal { data, .. } | SdoResponse::UploadSegment { data, .. } => data.len(),
        SdoResponse::DownloadDone { .. }
        | SdoResponse::UploadExpedited { .. }
        | SdoResponse::DownloadSegmentDone { .. }
        | SdoResponse::Abort { .. } => 0,
    };
    let mut bytes = vec![0; INITIATE_LEN + data];
    // The buffer has the length of the response.
    let length = response.encode(&mut bytes).unwrap_or(0);
    bytes.truncate(length);
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: 6.3, own-objects
    #[test]
    fn values_of_any_length_are_complete_and_a_wrong_toggle_aborts() {
        let room = 32;
        for length in 0..200_usize {
            let data: Vec<u8> = (0..length).map(|byte| byte as u8).collect();
            let (first, upload) = begin(SdoAddress::complete(0xF020, 0), data.clone(), room);
            assert!(first.len() <= room, "{length}");
            let mut got = match SdoResponse::decode(&first).unwrap() {
                SdoResponse::UploadExpedited { data, .. } => data.to_vec(),
                SdoResponse::UploadNormal { data, total, .. } => {
                    assert_eq!(total as usize, length);
                    data.to_vec()
                }
                other => panic!("{other:?}"),
            };
            assert_eq!(upload.is_some(), got.len() < length);
            let Some(mut upload) = upload else { continue };
            assert_eq!(upload.segment(true, room), Err(AbortCode::TOGGLE_NOT_ALTERNATED));
            for number in 0.. {
                let (segment, last) = upload.segment(number % 2 == 1, room).unwrap();
                assert!(segment.len() <= room);
                let Ok(SdoResponse::UploadSegment { data, .. }) = SdoResponse::decode(&segment) else { panic!() };
                got.extend_from_slice(data);
                if last {
                    break;
                }
            }
            assert_eq!(got, data);
        }
    }
}
