//! SDO requests of a MainDevice (protocol 6.3).

use super::codec::{ABORT, COMPLETE_ACCESS, EXPEDITED, Encoder, Head, TOGGLE, complete_access_bit};
use super::{AbortCode, SdoError};
use crate::mailbox::coe::CoeService;

const DOWNLOAD_SEGMENT: u8 = 0;
const DOWNLOAD: u8 = 1;
const UPLOAD: u8 = 2;
const UPLOAD_SEGMENT: u8 = 3;

/// A request to the SDO server of a SubDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SdoRequest<'a> {
    /// Writes an object of 1 to 4 bytes.
    DownloadExpedited {
        /// Index of the object.
        index: u16,
        /// Subindex.
        sub_index: u8,
        /// Complete access: writes all entries at once.
        complete_access: bool,
        /// The value, 1..=4 bytes.
        data: &'a [u8],
    },
    /// Starts writing an object; segments follow if `data` is shorter than `total`.
    DownloadNormal {
        /// Index of the object.
        index: u16,
        /// Subindex.
        sub_index: u8,
        /// Complete access: writes all entries at once.
        complete_access: bool,
        /// Bytes of the value.
        total: u32,
        /// The first bytes of the value.
        data: &'a [u8],
    },
    /// Reads an object.
    Upload {
        /// Index of the object.
        index: u16,
        /// Subindex.
        sub_index: u8,
        /// Complete access: reads all entries at once.
        complete_access: bool,
    },
    /// Writes the next segment.
    DownloadSegment {
        /// Toggle, false in the first segment.
        toggle: bool,
        /// Whether this is the last segment.
        last: bool,
        /// The next bytes of the value.
        data: &'a [u8],
    },
    /// Reads the next segment.
    UploadSegment {
        /// Toggle, false in the first segment.
        toggle: bool,
    },
    /// Aborts the transfer.
    Abort {
        /// Index of the object.
        index: u16,
        /// Subindex.
        sub_index: u8,
        /// Abort code.
        code: AbortCode,
    },
}

impl<'a> SdoRequest<'a> {
    /// Decodes the payload of a CoE message.
    pub fn decode(payload: &'a [u8]) -> Result<SdoRequest<'a>, SdoError> {
        let head = Head::decode(payload)?;
        if head.service != CoeService::SdoRequest {
            return Err(SdoError::Service { expected: CoeService::SdoRequest, got: head.service });
        }
        let complete_access = head.flag(COMPLETE_ACCESS);
        match head.specifier() {
            DOWNLOAD_SEGMENT => {
                let (toggle, last, data) = head.segment()?;
                Ok(SdoRequest::DownloadSegment { toggle, last, data })
            }
            DOWNLOAD if head.flag(EXPEDITED) => {
                let (index, sub_index) = head.object()?;
                Ok(SdoRequest::DownloadExpedited { index, sub_index, complete_access, data: head.expedited()? })
            }
            DOWNLOAD => {
                let (index, sub_index) = head.object()?;
                let (total, data) = head.normal()?;
                Ok(SdoRequest::DownloadNormal { index, sub_index, complete_access, total, data })
            }
            UPLOAD => {
                let (index, sub_index) = head.object()?;
                Ok(SdoRequest::Upload { index, sub_index, complete_access })
            }
            UPLOAD_SEGMENT => Ok(SdoRequest::UploadSegment { toggle: head.flag(TOGGLE) }),
            ABORT => {
                let (index, sub_index, code) = head.abort()?;
                Ok(SdoRequest::Abort { index, sub_index, code })
            }
            _ => Err(SdoError::Command { got: head.command }),
        }
    }

    /// Encodes the payload of a CoE message and returns its length; `None` if it does not fit `out`, if expedited data
    /// is not 1 to 4 bytes long, or if `data` is longer than `total`.
    pub fn encode(&self, out: &mut [u8]) -> Option<usize> {
        let encoder = Encoder { out, service: CoeService::SdoRequest };
        match *self {
            SdoRequest::DownloadExpedited { index, sub_index, complete_access, data } => {
                encoder.expedited(DOWNLOAD, complete_access_bit(complete_access), (index, sub_index), data)
            }
            SdoRequest::DownloadNormal { index, sub_index, complete_access, total, data } => {
                encoder.normal(DOWNLOAD, complete_access_bit(complete_access), (index, sub_index), total, data)
            }
            SdoRequest::Upload { index, sub_index, complete_access } => {
                encoder.initiate(UPLOAD, complete_access_bit(complete_access), (index, sub_index), 0)
            }
            SdoRequest::DownloadSegment { toggle, last, data } => encoder.segment(DOWNLOAD_SEGMENT, toggle, last, data),
            SdoRequest::UploadSegment { toggle } => encoder.toggle(UPLOAD_SEGMENT, toggle),
            SdoRequest::Abort { index, sub_index, code } => encoder.initiate(ABORT, 0, (index, sub_index), code.0),
        }
    }
}
