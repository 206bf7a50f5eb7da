//! SDO responses of a SubDevice (protocol 6.3).

use super::codec::{ABORT, COMPLETE_ACCESS, EXPEDITED, Encoder, Head, TOGGLE, complete_access_bit};
use super::{AbortCode, SdoError};
use crate::mailbox::coe::CoeService;

const UPLOAD_SEGMENT: u8 = 0;
const DOWNLOAD_SEGMENT: u8 = 1;
const UPLOAD: u8 = 2;
const DOWNLOAD: u8 = 3;

/// A response of the SDO server of a SubDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SdoResponse<'a> {
    /// The object is written, or the server accepts segments.
    DownloadDone {
        /// Index of the object.
        index: u16,
        /// Subindex.
        sub_index: u8,
    },
    /// The value of an object of 1 to 4 bytes.
    UploadExpedited {
        /// Index of the object.
        index: u16,
        /// Subindex.
        sub_index: u8,
        /// Complete access: the value contains all entries.
        complete_access: bool,
        /// The value, 1..=4 bytes.
        data: &'a [u8],
    },
    /// The first bytes of a value; segments have to be requested if `data` is shorter than `total`.
    UploadNormal {
        /// Index of the object.
        index: u16,
        /// Subindex.
        sub_index: u8,
        /// Complete access: the value contains all entries.
        complete_access: bool,
        /// Bytes of the value.
        total: u32,
        /// The first bytes of the value.
        data: &'a [u8],
    },
    /// A segment is written.
    DownloadSegmentDone {
        /// Toggle of the segment.
        toggle: bool,
    },
    /// The next segment of an upload.
    UploadSegment {
        /// Toggle of the request.
        toggle: bool,
        /// Whether this is the last segment.
        last: bool,
        /// The next bytes of the value.
        data: &'a [u8],
    },
    /// The transfer is refused or aborted.
    Abort {
        /// Index of the object.
        index: u16,
        /// Subindex.
        sub_index: u8,
        /// Abort code.
        code: AbortCode,
    },
}

impl<'a> SdoResponse<'a> {
    /// Decodes the payload of a CoE message. An abort is accepted with the service SDO request or SDO response.
    pub fn decode(payload: &'a [u8]) -> Result<SdoResponse<'a>, SdoError> {
        let head = Head::decode(payload)?;
        let abort = head.specifier() == ABORT && head.service == CoeService::SdoRequest;
        if head.service != CoeService::SdoResponse && !abort {
            return Err(SdoError::Service { expected: CoeService::SdoResponse, got: head.service });
        }
        let complete_access = head.flag(COMPLETE_ACCESS);
        match head.specifier() {
            UPLOAD_SEGMENT => {
                let (toggle, last, data) = head.segment()?;
                Ok(SdoResponse::UploadSegment { toggle, last, data })
            }
            DOWNLOAD_SEGMENT => Ok(SdoResponse::DownloadSegmentDone { toggle: head.flag(TOGGLE) }),
            UPLOAD if head.flag(EXPEDITED) => {
                let (index, sub_index) = head.object()?;
                Ok(SdoResponse::UploadExpedited { index, sub_index, complete_access, data: head.expedited()? })
            }
            UPLOAD => {
                let (index, sub_index) = head.object()?;
                let (total, data) = head.normal()?;
                Ok(SdoResponse::UploadNormal { index, sub_index, complete_access, total, data })
            }
            DOWNLOAD => {
                let (index, sub_index) = head.object()?;
                Ok(SdoResponse::DownloadDone { index, sub_index })
            }
            ABORT => {
                let (index, sub_index, code) = head.abort()?;
                Ok(SdoResponse::Abort { index, sub_index, code })
            }
            _ => Err(SdoError::Command { got: head.command }),
        }
    }

    /// Encodes the payload of a CoE message and returns its length; `None` if it does not fit `out`, if expedited data
    /// is not 1 to 4 bytes long, or if `data` is longer than `total`.
    pub fn encode(&self, out: &mut [u8]) -> Option<usize> {
        let encoder = Encoder { out, service: CoeService::SdoResponse };
        match *self {
            SdoResponse::DownloadDone { index, sub_index } => encoder.initiate(DOWNLOAD, 0, (index, sub_index), 0),
            SdoResponse::UploadExpedited { index, sub_index, complete_access, data } => {
                encoder.expedited(UPLOAD, complete_access_bit(complete_access), (index, sub_index), data)
            }
            SdoResponse::UploadNormal { index, sub_index, complete_access, total, data } => {
                encoder.normal(UPLOAD, complete_access_bit(complete_access), (index, sub_index), total, data)
            }
            SdoResponse::DownloadSegmentDone { toggle } => encoder.toggle(DOWNLOAD_SEGMENT, toggle),
            SdoResponse::UploadSegment { toggle, last, data } => encoder.segment(UPLOAD_SEGMENT, toggle, last, data),
            // An abort uses the service "SDO request" in both directions.
            SdoResponse::Abort { index, sub_index, code } => {
                let encoder = Encoder { service: CoeService::SdoRequest, ..encoder };
                encoder.initiate(ABORT, 0, (index, sub_index), code.0)
            }
        }
    }
}
