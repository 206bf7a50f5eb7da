//! Writes captures of several interfaces into one file for Wireshark (pcapng, draft-ietf-opsawg-pcapng).
//!
//! Input: frames with interface, direction and time. Output: bytes: one section header, one description per interface
//! with its name and nanosecond time stamps, one enhanced packet block per frame, and the statistics of an interface
//! when they are known. Little-endian throughout.

use std::io::{self, Write};

const SECTION_HEADER: u32 = 0x0A0D_0D0A;
const INTERFACE_DESCRIPTION: u32 = 1;
const INTERFACE_STATISTICS: u32 = 5;
const ENHANCED_PACKET: u32 = 6;
const BYTE_ORDER_MAGIC: u32 = 0x1A2B_3C4D;
const LINK_TYPE_ETHERNET: u16 = 1;

const OPTION_END: u16 = 0;
const SECTION_APPLICATION: u16 = 4;
const INTERFACE_NAME: u16 = 2;
const INTERFACE_TEXT: u16 = 3;
const INTERFACE_RESOLUTION: u16 = 9;
const PACKET_FLAGS: u16 = 2;
const STATISTICS_RECEIVED: u16 = 4;
const STATISTICS_DROPPED: u16 = 5;
const STATISTICS_DROPPED_BY_KERNEL: u16 = 7;

/// Time stamps count 10^-9 s.
const NANOSECONDS: u8 = 9;

/// Direction of a frame, seen from this host.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Direction {
    /// Received.
    In,
    /// Sent.
    Out,
}

impl Direction {
    fn flags(self) -> u32 {
        match self {
            Direction::In => 1,
            Direction::Out => 2,
        }
    }
}

/// Totals of an interface at the end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    /// Frames seen, captured or not (`isb_ifrecv`).
    pub seen: u64,
    /// Frames that the capturing program had no room for (`isb_ifdrop`).
    pub dropped: u64,
    /// Frames that the kernel had no room for (`isb_osdrop`).
    pub dropped_by_kernel: u64,
}

/// Writes one capture. Each call writes whole blocks and goes straight to `W`: wrap a file in a `BufWriter`.
#[derive(Debug)]
pub struct Writer<W: Write> {
    out: W,
    interfaces: usize,
    block: Vec<u8>,
}

impl<W: Write> Writer<W> {
    /// Begins a capture of interfaces with these names and descriptions.
    pub fn new(out: W, interfaces: &[(&str, &str)]) -> io::Result<Writer<W>> {
        let mut writer = Writer { out, interfaces: interfaces.len(), block: Vec::with_capacity(2048) };
        writer.begin(SECTION_HEADER);
        writer.put(&BYTE_ORDER_MAGIC.to_le_bytes());
        writer.put(&[1, 0, 0, 0]);
        // The section's length is not known in advance.
        writer.put(&u64::MAX.to_le_bytes());
        writer.option(SECTION_APPLICATION, b"RingCAT");
        writer.option(OPTION_END, &[]);
        writer.end()?;
        for (name, description) in interfaces {
            writer.begin(INTERFACE_DESCRIPTION);
            writer.put(&LINK_TYPE_ETHERNET.to_le_bytes());
            writer.put(&[0; 2]);
            // No limit to the captured length.
            writer.put(&[0; 4]);
            writer.option(INTERFACE_NAME, name.as_bytes());
            if !description.is_empty() {
                writer.option(INTERFACE_TEXT, description.as_bytes());
            }
            writer.option(INTERFACE_RESOLUTION, &[NANOSECONDS]);
            writer.option(OPTION_END, &[]);
            writer.end()?;
        }
        Ok(writer)
    }

    /// Adds a frame of the interface at this position in the list passed to [`Writer::new`], with the time since 1970.
    pub fn frame(&mut self, interface: usize, direction: Direction, unix_time_ns: u64, frame: &[u8]) -> io::Result<()> {
        self.beginning(interface, direction, unix_time_ns, frame, frame.len())
    }

    /// As [`Writer::frame`], for a frame of which only the beginning is available; `length` is that of the whole frame.
    pub fn beginning(
        &mut self,
        interface: usize,
        direction: Direction,
        unix_time_ns: u64,
        beginning: &[u8],
        length: usize,
    ) -> io::Result<()> {
        let too_long = |_| io::Error::from(io::ErrorKind::InvalidInput);
        let captured = u32::try_from(beginning.len()).map_err(too_long)?;
        let length = u32::try_from(length).map_err(too_long)?;
        self.begin_for(ENHANCED_PACKET, interface, unix_time_ns)?;
        self.put(&captured.to_le_bytes());
        self.put(&length.max(captured).to_le_bytes());
        self.put(beginning);
        self.pad();
        self.option(PACKET_FLAGS, &direction.flags().to_le_bytes());
        self.option(OPTION_END, &[]);
        self.end()
    }

    /// Adds the totals of an interface.
    pub fn statistics(&mut self, interface: usize, unix_time_ns: u64, statistics: Statistics) -> io::Result<()> {
        self.begin_for(INTERFACE_STATISTICS, interface, unix_time_ns)?;
        self.option(STATISTICS_RECEIVED, &statistics.seen.to_le_bytes());
        self.option(STATISTICS_DROPPED, &statistics.dropped.to_le_bytes());
        self.option(STATISTICS_DROPPED_BY_KERNEL, &statistics.dropped_by_kernel.to_le_bytes());
        self.option(OPTION_END, &[]);
        self.end()
    }

    /// Flushes the output.
    pub fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }

    /// Returns the output.
    pub fn into_inner(self) -> W {
        self.out
    }

    fn begin(&mut self, kind: u32) {
        self.block.clear();
        self.put(&kind.to_le_bytes());
        // The length, filled in at the end.
        self.put(&[0; 4]);
    }

    /// Begins a block for an interface and a time.
    fn begin_for(&mut self, kind: u32, interface: usize, unix_time_ns: u64) -> io::Result<()> {
        if interface >= self.interfaces {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, "the capture has no such interface"));
        }
        self.begin(kind);
        self.put(&(interface as u32).to_le_bytes());
        self.put(&((unix_time_ns >> 32) as u32).to_le_bytes());
        self.put(&(unix_time_ns as u32).to_le_bytes());
        Ok(())
    }

    fn put(&mut self, bytes: &[u8]) {
        self.block.extend_from_slice(bytes);
    }

    fn pad(&mut self) {
        self.block.resize(self.block.len().next_multiple_of(4), 0);
    }

    /// Adds an option. Texts longer than an option can hold are truncated.
    fn option(&mut self, code: u16, value: &[u8]) {
        let length = value.len().min(usize::from(u16::MAX));
        self.put(&code.to_le_bytes());
        self.put(&(length as u16).to_le_bytes());
        self.put(&value[..length]);
        self.pad();
    }

    fn end(&mut self) -> io::Result<()> {
        let length = (self.block.len() as u32 + 4).to_le_bytes();
        self.block[4..8].copy_from_slice(&length);
        self.put(&length);
        self.out.write_all(&self.block)
    }
}

#[cfg(test)]
mod tests;
