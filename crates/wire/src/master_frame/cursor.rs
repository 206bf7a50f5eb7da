//! Little-endian fields one after the other, read and written.

use super::MasterFrameError;

/// Reads fields.
pub(super) struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Reader<'a> {
    /// Over bytes that hold at least `expected` ones.
    pub fn new(bytes: &'a [u8], what: &'static str, expected: usize) -> Result<Reader<'a>, MasterFrameError> {
        if bytes.len() < expected {
            return Err(MasterFrameError::Short { what, expected, got: bytes.len() });
        }
        Ok(Reader { bytes, at: 0 })
    }

    /// The next bytes; zeros behind the end, which [`Reader::new`] excludes.
    pub fn take<const N: usize>(&mut self) -> [u8; N] {
        let found = self.bytes.get(self.at..).and_then(|rest| rest.first_chunk()).copied().unwrap_or([0; N]);
        self.at += N;
        found
    }

    pub fn u8(&mut self) -> u8 {
        let [byte] = self.take();
        byte
    }

    pub fn u16(&mut self) -> u16 {
        u16::from_le_bytes(self.take())
    }

    pub fn u32(&mut self) -> u32 {
        u32::from_le_bytes(self.take())
    }

    pub fn u64(&mut self) -> u64 {
        u64::from_le_bytes(self.take())
    }
}

/// Writes fields.
pub(super) struct Writer<'a> {
    out: &'a mut [u8],
    at: usize,
}

impl<'a> Writer<'a> {
    /// Into a buffer with room for `length` bytes; `None` if it is shorter.
    pub fn new(out: &'a mut [u8], length: usize) -> Option<Writer<'a>> {
        Some(Writer { out: out.get_mut(..length)?, at: 0 })
    }

    /// Writes the next bytes; what is behind the end is dropped, which the length given to [`Writer::new`] excludes.
    pub fn put(&mut self, bytes: &[u8]) {
        if let Some(place) = self.out.get_mut(self.at..self.at + bytes.len()) {
            place.copy_from_slice(bytes);
        }
        self.at += bytes.len();
    }

    pub fn u8(&mut self, value: u8) {
        self.put(&[value]);
    }

    pub fn u16(&mut self, value: u16) {
        self.put(&value.to_le_bytes());
    }

    pub fn u32(&mut self, value: u32) {
        self.put(&value.to_le_bytes());
    }

    pub fn u64(&mut self, value: u64) {
        self.put(&value.to_le_bytes());
    }

    /// Bytes written.
    pub const fn length(&self) -> usize {
        self.at
    }
}
