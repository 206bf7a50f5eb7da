//! Common parts of SDO requests and responses: command bits, addresses, expedited data, segments (protocol 6.3).

use super::{AbortCode, EXPEDITED_MAX_DATA, INITIATE_LEN, SEGMENT_MIN_DATA, SEGMENT_OVERHEAD, SdoError};
use crate::bytes::u32_at;
use crate::mailbox::coe::{CoeHeader, CoeService};

pub(super) const SIZE_INDICATED: u8 = 1 << 0;
pub(super) const EXPEDITED: u8 = 1 << 1;
pub(super) const COMPLETE_ACCESS: u8 = 1 << 4;
pub(super) const TOGGLE: u8 = 1 << 4;
pub(super) const ABORT: u8 = 4;

const LAST: u8 = 1 << 0;
const COMMAND_SHIFT: u8 = 5;

/// CoE header and command of an SDO message.
pub(super) struct Head<'a> {
    bytes: &'a [u8],
    pub service: CoeService,
    pub command: u8,
}

impl<'a> Head<'a> {
    pub fn decode(bytes: &'a [u8]) -> Result<Head<'a>, SdoError> {
        match *bytes {
            [low, high, command, ..] => Ok(Head { bytes, service: CoeHeader::decode(&[low, high]).service, command }),
            _ => Err(SdoError::Short { expected: SEGMENT_OVERHEAD, got: bytes.len() }),
        }
    }

    pub const fn specifier(&self) -> u8 {
        self.command >> COMMAND_SHIFT
    }

    pub const fn flag(&self, flag: u8) -> bool {
        self.command & flag != 0
    }

    /// Index and subindex.
    pub fn object(&self) -> Result<(u16, u8), SdoError> {
        match *self.bytes {
            [_, _, _, low, high, sub_index, ..] => Ok((u16::from_le_bytes([low, high]), sub_index)),
            _ => Err(SdoError::Short { expected: 6, got: self.bytes.len() }),
        }
    }

    /// The four bytes after the subindex as a number.
    pub fn size(&self) -> Result<u32, SdoError> {
        u32_at(self.bytes, 6).ok_or(SdoError::Short { expected: INITIATE_LEN, got: self.bytes.len() })
    }

    /// Data of an expedited transfer; all four bytes if the size is not indicated.
    pub fn expedited(&self) -> Result<&'a [u8], SdoError> {
        let unused = if self.flag(SIZE_INDICATED) { usize::from(self.command >> 2 & 0x03) } else { 0 };
        let short = SdoError::Short { expected: INITIATE_LEN, got: self.bytes.len() };
        self.bytes.get(6..INITIATE_LEN - unused).ok_or(short)
    }

    /// Total size of a normal transfer and the data of the message; bytes beyond the total are padding.
    pub fn normal(&self) -> Result<(u32, &'a [u8]), SdoError> {
        let total = self.size()?;
        let data = &self.bytes[INITIATE_LEN..];
        let length = usize::try_from(total).map_or(data.len(), |total| total.min(data.len()));
        Ok((total, &data[..length]))
    }

    /// Toggle, whether the segment is the last one, and its data.
    pub fn segment(&self) -> Result<(bool, bool, &'a [u8]), SdoError> {
        let data = &self.bytes[SEGMENT_OVERHEAD..];
        // Only a segment of minimum length indicates its padding. A segment without padding is accepted.
        let length = if data.len() > SEGMENT_MIN_DATA {
            data.len()
        } else {
            SEGMENT_MIN_DATA - usize::from(self.command >> 1 & 0x07)
        };
        let short = SdoError::Short { expected: SEGMENT_OVERHEAD + length, got: self.bytes.len() };
        let data = data.get(..length).ok_or(short)?;
        Ok((self.flag(TOGGLE), self.flag(LAST), data))
    }

    /// Index, subindex and code of an abort.
    pub fn abort(&self) -> Result<(u16, u8, AbortCode), SdoError> {
        let (index, sub_index) = self.object()?;
        Ok((index, sub_index, AbortCode(self.size()?)))
    }
}

/// Writes one SDO message into a buffer of the caller; `None` if it does not fit.
pub(super) struct Encoder<'b> {
    pub out: &'b mut [u8],
    pub service: CoeService,
}

impl Encoder<'_> {
    fn start(&mut self, length: usize, specifier: u8, flags: u8) -> Option<&mut [u8]> {
        let out = self.out.get_mut(..length)?;
        out.fill(0);
        out[..2].copy_from_slice(&CoeHeader::new(self.service).encode());
        out[2] = specifier << COMMAND_SHIFT | flags;
        Some(&mut out[SEGMENT_OVERHEAD..])
    }

    /// A message without data: command and, if there is an object, index, subindex and four bytes.
    pub fn initiate(mut self, specifier: u8, flags: u8, object: (u16, u8), size: u32) -> Option<usize> {
        let out = self.start(INITIATE_LEN, specifier, flags)?;
        out[..2].copy_from_slice(&object.0.to_le_bytes());
        out[2] = object.1;
        out[3..7].copy_from_slice(&size.to_le_bytes());
        Some(INITIATE_LEN)
    }

    /// A message of an expedited transfer; `None` also if the data is not 1 to 4 bytes long.
    pub fn expedited(self, specifier: u8, flags: u8, object: (u16, u8), data: &[u8]) -> Option<usize> {
        if data.is_empty() || data.len() > EXPEDITED_MAX_DATA {
            return None;
        }
        let mut size = [0; EXPEDITED_MAX_DATA];
        size[..data.len()].copy_from_slice(data);
        let unused = ((EXPEDITED_MAX_DATA - data.len()) as u8) << 2;
        self.initiate(specifier, flags | EXPEDITED | SIZE_INDICATED | unused, object, u32::from_le_bytes(size))
    }

    /// The first message of a normal transfer; `None` also if the data is longer than the total.
    pub fn normal(self, specifier: u8, flags: u8, object: (u16, u8), total: u32, data: &[u8]) -> Option<usize> {
        if u32::try_from(data.len()).ok()? > total {
            return None;
        }
        let end = INITIATE_LEN + data.len();
        self.out.get_mut(INITIATE_LEN..end)?.copy_from_slice(data);
        let head = Encoder { out: &mut *self.out, service: self.service };
        head.initiate(specifier, flags | SIZE_INDICATED, object, total)?;
        Some(end)
    }

    /// A segment; short data is padded to seven bytes.
    pub fn segment(mut self, specifier: u8, toggle: bool, last: bool, data: &[u8]) -> Option<usize> {
        let unused = SEGMENT_MIN_DATA.saturating_sub(data.len());
        let flags = toggle_bit(toggle) | u8::from(last) | (unused as u8) << 1;
        let length = SEGMENT_OVERHEAD + data.len() + unused;
        self.start(length, specifier, flags)?[..data.len()].copy_from_slice(data);
        Some(length)
    }

    /// A message that contains only its toggle.
    pub fn toggle(self, specifier: u8, toggle: bool) -> Option<usize> {
        self.initiate(specifier, toggle_bit(toggle), (0, 0), 0)
    }
}

const fn toggle_bit(toggle: bool) -> u8 {
    if toggle { TOGGLE } else { 0 }
}

/// The complete access bit.
pub(super) const fn complete_access_bit(complete_access: bool) -> u8 {
    if complete_access { COMPLETE_ACCESS } else { 0 }
}
