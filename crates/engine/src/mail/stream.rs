//! Sources and sinks of transfer data in pieces, so that no transfer needs memory for all data.

use alloc::vec::Vec;

/// Data to send.
pub trait Source {
    /// Total length in bytes, if known in advance.
    fn total(&self) -> Option<u64>;

    /// Copies the next bytes into `buffer` and returns their number; fewer than fit only at the end.
    fn fill(&mut self, buffer: &mut [u8]) -> usize;
}

/// The receiver's limit is exceeded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Overflow {
    /// Bytes needed.
    pub bytes: u64,
    /// Limit in bytes.
    pub limit: u64,
}

/// Receiver of transfer data.
pub trait Sink {
    /// The transfer begins, or begins again after a repeated request; `total` is the announced number of bytes, if any.
    fn begin(&mut self, total: Option<u64>) -> Result<(), Overflow>;

    /// Takes the next bytes.
    fn take(&mut self, bytes: &[u8]) -> Result<(), Overflow>;
}

/// Bytes in memory as a source.
#[derive(Clone, Copy, Debug)]
pub struct Bytes<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Bytes<'a> {
    /// A source of these bytes.
    pub const fn new(bytes: &'a [u8]) -> Bytes<'a> {
        Bytes { bytes, at: 0 }
    }
}

impl Source for Bytes<'_> {
    fn total(&self) -> Option<u64> {
        Some(self.bytes.len() as u64)
    }

    fn fill(&mut self, buffer: &mut [u8]) -> usize {
        let rest = &self.bytes[self.at..];
        let count = rest.len().min(buffer.len());
        buffer[..count].copy_from_slice(&rest[..count]);
        self.at += count;
        count
    }
}

/// A vector with a limit as a sink.
#[derive(Clone, Debug)]
pub struct Bounded {
    bytes: Vec<u8>,
    limit: usize,
}

impl Bounded {
    /// Accepts up to `limit` bytes.
    pub const fn new(limit: usize) -> Bounded {
        Bounded { bytes: Vec::new(), limit }
    }

    /// The received bytes.
    pub fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }
}

impl Sink for Bounded {
    fn begin(&mut self, total: Option<u64>) -> Result<(), Overflow> {
        self.bytes.clear();
        let limit = self.limit as u64;
        // Memory is allocated as bytes arrive: an announced size alone allocates nothing.
        match total {
            Some(bytes) if bytes > limit => Err(Overflow { bytes, limit }),
            Some(_) | None => Ok(()),
        }
    }

    fn take(&mut self, bytes: &[u8]) -> Result<(), Overflow> {
        let length = self.bytes.len() + bytes.len();
        if length > self.limit {
            return Err(Overflow { bytes: length as u64, limit: self.limit as u64 });
        }
        self.bytes.extend_from_slice(bytes);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_source_fills_buffers_of_any_size_and_a_sink_keeps_its_limit() {
        let mut source = Bytes::new(b"abcdefg");
        let mut sink = Bounded::new(7);
        assert_eq!(sink.begin(source.total()), Ok(()));
        let mut buffer = [0; 3];
        loop {
            let count = source.fill(&mut buffer);
            sink.take(&buffer[..count]).unwrap();
            if count < buffer.len() {
                break;
            }
        }
        assert_eq!(sink.take(b"h"), Err(Overflow { bytes: 8, limit: 7 }));
        assert_eq!(sink.into_bytes(), b"abcdefg");
    }

    #[test]
    fn an_announced_size_beyond_the_limit_is_refused_at_once() {
        assert_eq!(Bounded::new(7).begin(Some(1 << 32)), Err(Overflow { bytes: 1 << 32, limit: 7 }));
    }
}
