//! Writes an SII image into a buffer of the caller (protocol 4.1, 4.2).

use core::fmt;

use super::category::{CategoryHeader, CategoryKind};
use super::checksum::CHECKSUM_DISABLED;
use super::dc::DcMode;
use super::fmmu::FmmuUsage;
use super::general::General;
use super::header::SiiHeader;
use super::pdo::{PdoDescription, PdoDirection};
use super::sync_manager::SiiSyncManager;

/// Value of an erased EEPROM; the rest of the buffer is filled with it.
const ERASED: u8 = 0xFF;

/// The reason for which an image cannot be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SiiWriteError {
    /// The buffer is too small.
    Full {
        /// Bytes needed up to the end of the item.
        expected: usize,
        /// Bytes of the buffer.
        got: usize,
    },
    /// A category of more than 65535 words.
    TooLong {
        /// Kind of the category.
        kind: CategoryKind,
        /// Bytes of the category.
        bytes: usize,
    },
    /// More than 255 strings, more than 255 characters in one, or more than 255 entries in a PDO.
    TooMany {
        /// Kind of items.
        what: &'static str,
        /// Number of items.
        got: usize,
    },
    /// Only [`SiiWriter::finish`] writes the end marker.
    EndMarker,
}

impl fmt::Display for SiiWriteError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            SiiWriteError::Full { expected, got } => write!(f, "SII needs {expected} bytes, the buffer has {got}"),
            SiiWriteError::TooLong { kind, bytes } => {
                write!(f, "SII category {kind} of {bytes} bytes: expected at most 131070")
            }
            SiiWriteError::TooMany { what, got } => write!(f, "SII: {got} {what}, expected at most 255"),
            SiiWriteError::EndMarker => f.write_str("SII: the end marker is no category"),
        }
    }
}

impl core::error::Error for SiiWriteError {}

/// Writes the fixed area, then categories in the order of the calls. A failed call keeps everything written before it.
#[derive(Debug)]
pub struct SiiWriter<'b> {
    buffer: &'b mut [u8],
    at: usize,
}

impl<'b> SiiWriter<'b> {
    /// Writes the fixed area with its computed checksum; a disabled check (0x88A4) stays disabled.
    pub fn new(buffer: &'b mut [u8], header: &SiiHeader) -> Result<SiiWriter<'b>, SiiWriteError> {
        let header = if header.checksum == CHECKSUM_DISABLED { *header } else { header.with_checksum() };
        let full = SiiWriteError::Full { expected: SiiHeader::LEN, got: buffer.len() };
        buffer.get_mut(..SiiHeader::LEN).ok_or(full)?.copy_from_slice(&header.encode());
        Ok(SiiWriter { buffer, at: SiiHeader::LEN })
    }

    /// Appends a category; data of an odd length is padded with a zero.
    pub fn category(&mut self, kind: CategoryKind, data: &[u8]) -> Result<(), SiiWriteError> {
        self.open(kind, data.len())?.put(data);
        Ok(())
    }

    /// Appends the strings; the first string gets index 1.
    pub fn strings(&mut self, strings: &[&str]) -> Result<(), SiiWriteError> {
        let byte = |what, got| u8::try_from(got).map_err(|_| SiiWriteError::TooMany { what, got });
        let count = byte("strings", strings.len())?;
        for string in strings {
            byte("characters in a string", string.len())?;
        }
        let length = 1 + strings.iter().map(|string| 1 + string.len()).sum::<usize>();
        let mut data = self.open(CategoryKind::Strings, length)?;
        data.put(&[count]);
        for string in strings {
            data.put(&[string.len() as u8]);
            data.put(string.as_bytes());
        }
        Ok(())
    }

    /// Appends the general category.
    pub fn general(&mut self, general: &General) -> Result<(), SiiWriteError> {
        self.category(CategoryKind::General, &general.encode())
    }

    /// Appends the usages of the FMMUs, FMMU 0 first.
    pub fn fmmus(&mut self, usages: &[FmmuUsage]) -> Result<(), SiiWriteError> {
        let mut data = self.open(CategoryKind::Fmmu, usages.len())?;
        usages.iter().for_each(|usage| data.put(&[usage.code()]));
        Ok(())
    }

    /// Appends the SyncManagers, SM 0 first.
    pub fn sync_managers(&mut self, sync_managers: &[SiiSyncManager]) -> Result<(), SiiWriteError> {
        let mut data = self.open(CategoryKind::SyncManager, sync_managers.len() * SiiSyncManager::LEN)?;
        sync_managers.iter().for_each(|sync_manager| data.put(&sync_manager.encode()));
        Ok(())
    }

    /// Appends PDOs of one direction as one category.
    pub fn pdos(&mut self, direction: PdoDirection, pdos: &[PdoDescription<'_>]) -> Result<(), SiiWriteError> {
        let too_many =
            |pdo: &PdoDescription<'_>| SiiWriteError::TooMany { what: "PDO entries", got: pdo.entries.len() };
        for pdo in pdos {
            pdo.encode_header().ok_or(too_many(pdo))?;
        }
        let mut data = self.open(direction.category(), pdos.iter().map(PdoDescription::len).sum())?;
        for pdo in pdos {
            data.put(&pdo.encode_header().ok_or(too_many(pdo))?);
            pdo.entries.iter().for_each(|entry| data.put(&entry.encode()));
        }
        Ok(())
    }

    /// Appends the operation modes of the distributed clock.
    pub fn dc_modes(&mut self, modes: &[DcMode]) -> Result<(), SiiWriteError> {
        let mut data = self.open(CategoryKind::Dc, modes.len() * DcMode::LEN)?;
        modes.iter().for_each(|mode| data.put(&mode.encode()));
        Ok(())
    }

    /// Writes the end marker and fills the rest of the buffer with 0xFF. Returns the bytes up to the end of the end
    /// marker.
    pub fn finish(self) -> Result<usize, SiiWriteError> {
        let end = self.at + 2;
        let full = SiiWriteError::Full { expected: end, got: self.buffer.len() };
        let marker = self.buffer.get_mut(self.at..end).ok_or(full)?;
        marker.copy_from_slice(&CategoryKind::End.code().to_le_bytes());
        self.buffer[end..].fill(ERASED);
        Ok(end)
    }

    /// Writes a category header and returns the zeroed space after it.
    fn open(&mut self, kind: CategoryKind, length: usize) -> Result<CategoryData<'_>, SiiWriteError> {
        if kind == CategoryKind::End {
            return Err(SiiWriteError::EndMarker);
        }
        let words = u16::try_from(length.div_ceil(2)).map_err(|_| SiiWriteError::TooLong { kind, bytes: length })?;
        let header = CategoryHeader { kind, words };
        let start = self.at + CategoryHeader::LEN;
        let end = start + header.data_len();
        let full = SiiWriteError::Full { expected: end, got: self.buffer.len() };
        let bytes = self.buffer.get_mut(self.at..end).ok_or(full)?;
        let (head, data) = bytes.split_at_mut(CategoryHeader::LEN);
        head.copy_from_slice(&header.encode());
        data.fill(0);
        self.at = end;
        Ok(CategoryData { data, at: 0 })
    }
}

/// The data of a category during writing; its size was determined before.
struct CategoryData<'b> {
    data: &'b mut [u8],
    at: usize,
}

impl CategoryData<'_> {
    fn put(&mut self, bytes: &[u8]) {
        let end = self.at + bytes.len();
        self.data[self.at..end].copy_from_slice(bytes);
        self.at = end;
    }
}
