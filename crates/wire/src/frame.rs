//! Ethernet frames that carry EtherCAT (protocol 1.1, 1.3).
//!
//! [`Frame::parse`] reads and borrows a frame in one pass; [`FrameBuilder`] writes a frame into a buffer of the caller.
//! Supported are plain Ethernet II, one VLAN tag and UDP. The bytes do not include the frame check sequence.

use core::fmt;

use crate::address::Wkc;
use crate::bytes::u16_at;
use crate::command::Command;
use crate::datagram::{Datagram, HEADER_LEN, Header, MORE, OVERHEAD, Target, WKC_LEN};

/// EtherType of EtherCAT.
pub const ETHERTYPE: u16 = 0x88A4;
/// EtherType of a VLAN tag.
pub const ETHERTYPE_VLAN: u16 = 0x8100;
/// EtherType of IPv4.
pub const ETHERTYPE_IPV4: u16 = 0x0800;
/// UDP destination port of EtherCAT.
pub const UDP_PORT: u16 = 0x88A4;
/// Bytes of an Ethernet II header.
pub const ETHERNET_HEADER_LEN: usize = 14;
/// Bytes of the EtherCAT header.
pub const ETHERCAT_HEADER_LEN: usize = 2;
/// Shortest frame without FCS.
pub const MIN_FRAME: usize = 60;
/// Longest untagged frame without FCS.
pub const MAX_FRAME: usize = 1514;
/// Longest frame with a VLAN tag, without FCS.
pub const MAX_FRAME_VLAN: usize = 1518;
/// Bytes on the wire in addition to the frame without FCS: preamble and delimiter 8, FCS 4, gap 12.
pub const WIRE_OVERHEAD: usize = 24;
/// Time of one byte at 100 Mbit/s in nanoseconds.
pub const BYTE_TIME_NS: u64 = 80;

/// An Ethernet address.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct MacAddress(pub [u8; 6]);

impl MacAddress {
    /// ff:ff:ff:ff:ff:ff.
    pub const BROADCAST: MacAddress = MacAddress([0xFF; 6]);
    /// 01:01:05:01:00:00, the group address of EtherCAT (protocol 1.1, X21).
    pub const ETHERCAT_GROUP: MacAddress = MacAddress([0x01, 0x01, 0x05, 0x01, 0x00, 0x00]);
}

impl fmt::Display for MacAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [a, b, c, d, e, g] = self.0;
        write!(f, "{a:02x}:{b:02x}:{c:02x}:{d:02x}:{e:02x}:{g:02x}")
    }
}

/// Encapsulation of the EtherCAT part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encapsulation {
    /// Directly in Ethernet II.
    Ethernet,
    /// After one 802.1Q tag; the tag control information is kept.
    Vlan {
        /// Priority, drop eligibility and VLAN id.
        tci: u16,
    },
    /// In UDP over IPv4; the 28 bytes of both headers are kept.
    Udp {
        /// IPv4 header (20) and UDP header (8).
        headers: [u8; 28],
    },
}

impl Encapsulation {
    /// Bytes before the EtherCAT header.
    pub const fn header_len(&self) -> usize {
        match self {
            Encapsulation::Ethernet => ETHERNET_HEADER_LEN,
            Encapsulation::Vlan { .. } => ETHERNET_HEADER_LEN + 4,
            Encapsulation::Udp { .. } => ETHERNET_HEADER_LEN + 28,
        }
    }
}

/// Type in the EtherCAT header (protocol 1.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EthercatType {
    /// Type 1: datagrams, the only type that controllers process.
    Datagrams,
    /// Any other type: 2 ADS, 3 RAW-IO, 4 network variables, 5 mailbox gateway.
    Other(u8),
}

impl EthercatType {
    /// From bits 15:12 of the header.
    pub const fn from_code(code: u8) -> EthercatType {
        if code == 1 { EthercatType::Datagrams } else { EthercatType::Other(code) }
    }

    /// Bits 15:12 of the header.
    pub const fn code(self) -> u8 {
        match self {
            EthercatType::Datagrams => 1,
            EthercatType::Other(code) => code & 0x0F,
        }
    }
}

/// Why bytes are not an EtherCAT frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum FrameError {
    /// Too short for `part`.
    Short {
        /// The part of the frame.
        part: &'static str,
        /// Bytes needed up to the end of the part.
        expected: usize,
        /// Bytes available.
        got: usize,
    },
    /// Another protocol.
    NotEthercat {
        /// EtherType found (after a VLAN tag if there is one).
        ethertype: u16,
    },
    /// IPv4, but not UDP to port 0x88A4 with a header of five words.
    NotEthercatUdp,
    /// The length in the EtherCAT header exceeds the available bytes.
    Length {
        /// Length in the EtherCAT header.
        announced: usize,
        /// Bytes after the header.
        got: usize,
    },
    /// A datagram extends beyond the length in the EtherCAT header.
    Datagram {
        /// Offset of the datagram in the frame.
        offset: usize,
        /// Bytes of the datagram.
        expected: usize,
        /// Bytes available for it.
        got: usize,
    },
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            FrameError::Short { part, expected, got } => {
                write!(f, "frame too short for {part}: expected {expected} bytes, got {got}")
            }
            FrameError::NotEthercat { ethertype } => {
                write!(f, "not EtherCAT: expected EtherType 0x88a4, got {ethertype:#06x}")
            }
            FrameError::NotEthercatUdp => f.write_str("IPv4, but not UDP to port 34980 with a 20-byte header"),
            FrameError::Length { announced, got } => {
                write!(f, "EtherCAT header announces {announced} bytes, got {got}")
            }
            FrameError::Datagram { offset, expected, got } => {
                write!(f, "datagram at byte {offset} needs {expected} bytes, {got} are left")
            }
        }
    }
}

impl core::error::Error for FrameError {}

/// A parsed frame that borrows its bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame<'a> {
    /// Destination address; controllers do not evaluate it.
    pub destination: MacAddress,
    /// Source address, with the marks of [`crate::source_address`].
    pub source: MacAddress,
    /// Encapsulation of the EtherCAT part.
    pub encapsulation: Encapsulation,
    /// Reserved bit 11 of the EtherCAT header.
    pub reserved: bool,
    /// Type of the EtherCAT part.
    pub ethercat_type: EthercatType,
    /// The EtherCAT part without header and padding.
    pub payload: &'a [u8],
    /// Bytes after the last datagram within the length in the EtherCAT header. Controllers evaluate the datagrams
    /// (protocol 1.1), and some MainDevices include the padding in the length.
    pub surplus: &'a [u8],
    /// Bytes after the EtherCAT part, normally zeros.
    pub padding: &'a [u8],
}

impl<'a> Frame<'a> {
    /// Parses the encapsulation and checks that all datagrams of a type 1 frame lie within the length in the EtherCAT
    /// header.
    pub fn parse(bytes: &'a [u8]) -> Result<Frame<'a>, FrameError> {
        let (encapsulation, start) = encapsulation(bytes)?;
        let short =
            FrameError::Short { part: "the EtherCAT header", expected: start + ETHERCAT_HEADER_LEN, got: bytes.len() };
        let header = u16_at(bytes, start).ok_or(short)?;
        let rest = &bytes[start + ETHERCAT_HEADER_LEN..];
        let announced = usize::from(header & 0x07FF);
        if announced > rest.len() {
            return Err(FrameError::Length { announced, got: rest.len() });
        }
        let (payload, padding) = rest.split_at(announced);
        let mut frame = Frame {
            destination: MacAddress(bytes[..6].try_into().unwrap_or_default()),
            source: MacAddress(bytes[6..12].try_into().unwrap_or_default()),
            encapsulation,
            reserved: header & 0x0800 != 0,
            ethercat_type: EthercatType::from_code((header >> 12) as u8),
            payload,
            surplus: &[],
            padding,
        };
        if frame.ethercat_type == EthercatType::Datagrams {
            let used = frame.check_datagrams(start + ETHERCAT_HEADER_LEN)?;
            (frame.payload, frame.surplus) = payload.split_at(used);
        }
        Ok(frame)
    }

    /// Returns the total length of all datagrams.
    fn check_datagrams(&self, start: usize) -> Result<usize, FrameError> {
        let mut at = 0;
        loop {
            let left = self.payload.len() - at;
            let length = u16_at(self.payload, at + 6).unwrap_or(0);
            let expected = OVERHEAD + usize::from(length & 0x07FF);
            if left < expected {
                return Err(FrameError::Datagram { offset: start + at, expected, got: left });
            }
            at += expected;
            if length & MORE == 0 {
                return Ok(at);
            }
        }
    }

    /// The datagrams in order; none if the EtherCAT part has another type.
    pub fn datagrams(&self) -> Datagrams<'a> {
        match self.ethercat_type {
            EthercatType::Datagrams => Datagrams { rest: self.payload, done: false },
            EthercatType::Other(_) => Datagrams { rest: &[], done: true },
        }
    }

    /// Offset of the EtherCAT payload (the first datagram) in the frame.
    pub const fn payload_offset(&self) -> usize {
        self.encapsulation.header_len() + ETHERCAT_HEADER_LEN
    }

    /// Writes the frame into `out`, byte-identical to the parsed frame, and returns its length; `None` if it does not
    /// fit.
    pub fn encode(&self, out: &mut [u8]) -> Option<usize> {
        let start = self.encapsulation.header_len();
        let announced = self.payload.len() + self.surplus.len();
        let length = start + ETHERCAT_HEADER_LEN + announced + self.padding.len();
        let out = out.get_mut(..length)?;
        write_headers(out, self.destination, self.source, &self.encapsulation)?;
        let header =
            (announced as u16 & 0x07FF) | u16::from(self.reserved) << 11 | u16::from(self.ethercat_type.code()) << 12;
        let (head, rest) = out[start..].split_at_mut(ETHERCAT_HEADER_LEN + self.payload.len());
        let (surplus, padding) = rest.split_at_mut(self.surplus.len());
        head[..2].copy_from_slice(&header.to_le_bytes());
        let mut at = ETHERCAT_HEADER_LEN;
        match self.ethercat_type {
            EthercatType::Other(_) => head[at..].copy_from_slice(self.payload),
            EthercatType::Datagrams => {
                for datagram in self.datagrams() {
                    let data_end = at + HEADER_LEN + datagram.data.len();
                    head[at..at + HEADER_LEN].copy_from_slice(&datagram.header.encode());
                    head[at + HEADER_LEN..data_end].copy_from_slice(datagram.data);
                    head[data_end..data_end + WKC_LEN].copy_from_slice(&datagram.wkc.0.to_le_bytes());
                    at = data_end + WKC_LEN;
                }
            }
        }
        surplus.copy_from_slice(self.surplus);
        padding.copy_from_slice(self.padding);
        Some(length)
    }
}

fn encapsulation(bytes: &[u8]) -> Result<(Encapsulation, usize), FrameError> {
    let short = |part, expected| FrameError::Short { part, expected, got: bytes.len() };
    let ethertype = |at: usize| bytes.get(at..at + 2).map(|b| u16::from_be_bytes([b[0], b[1]]));
    let outer = ethertype(12).ok_or(short("the Ethernet header", ETHERNET_HEADER_LEN))?;
    match outer {
        ETHERTYPE => Ok((Encapsulation::Ethernet, ETHERNET_HEADER_LEN)),
        ETHERTYPE_VLAN => {
            let tci = ethertype(14).ok_or(short("the VLAN tag", 18))?;
            let inner = ethertype(16).ok_or(short("the VLAN tag", 18))?;
            if inner == ETHERTYPE {
                Ok((Encapsulation::Vlan { tci }, ETHERNET_HEADER_LEN + 4))
            } else {
                Err(FrameError::NotEthercat { ethertype: inner })
            }
        }
        ETHERTYPE_IPV4 => {
            let end = ETHERNET_HEADER_LEN + 28;
            let headers = bytes.get(ETHERNET_HEADER_LEN..end).and_then(|b| <[u8; 28]>::try_from(b).ok());
            let headers = headers.ok_or(short("the IPv4 and UDP headers", end))?;
            let port = u16::from_be_bytes([headers[22], headers[23]]);
            if headers[0] == 0x45 && headers[9] == 17 && port == UDP_PORT {
                Ok((Encapsulation::Udp { headers }, end))
            } else {
                Err(FrameError::NotEthercatUdp)
            }
        }
        ethertype => Err(FrameError::NotEthercat { ethertype }),
    }
}

fn write_headers(
    out: &mut [u8],
    destination: MacAddress,
    source: MacAddress,
    encapsulation: &Encapsulation,
) -> Option<()> {
    out.get_mut(..encapsulation.header_len())?;
    out[..6].copy_from_slice(&destination.0);
    out[6..12].copy_from_slice(&source.0);
    match encapsulation {
        Encapsulation::Ethernet => out[12..14].copy_from_slice(&ETHERTYPE.to_be_bytes()),
        Encapsulation::Vlan { tci } => {
            out[12..14].copy_from_slice(&ETHERTYPE_VLAN.to_be_bytes());
            out[14..16].copy_from_slice(&tci.to_be_bytes());
            out[16..18].copy_from_slice(&ETHERTYPE.to_be_bytes());
        }
        Encapsulation::Udp { headers } => {
            out[12..14].copy_from_slice(&ETHERTYPE_IPV4.to_be_bytes());
            out[14..42].copy_from_slice(headers);
        }
    }
    Some(())
}

/// Iterator over the datagrams of a frame.
#[derive(Clone, Debug)]
pub struct Datagrams<'a> {
    rest: &'a [u8],
    done: bool,
}

impl<'a> Iterator for Datagrams<'a> {
    type Item = Datagram<'a>;

    fn next(&mut self) -> Option<Datagram<'a>> {
        if self.done {
            return None;
        }
        let header = Header::decode(self.rest.get(..HEADER_LEN)?.try_into().ok()?);
        let end = HEADER_LEN + usize::from(header.length);
        let data = self.rest.get(HEADER_LEN..end)?;
        let wkc = Wkc(u16_at(self.rest, end)?);
        self.rest = &self.rest[end + WKC_LEN..];
        self.done = !header.more;
        Some(Datagram { header, data, wkc })
    }
}

/// Length without FCS of the plain Ethernet frame with datagrams of these data lengths (protocol 1.3).
pub fn frame_len(data_lengths: impl IntoIterator<Item = usize>) -> usize {
    let datagrams: usize = data_lengths.into_iter().map(|length| OVERHEAD + length).sum();
    (ETHERNET_HEADER_LEN + ETHERCAT_HEADER_LEN + datagrams).max(MIN_FRAME)
}

/// Time that a frame of `len` bytes (without FCS) occupies at 100 Mbit/s, including preamble, FCS and gap.
pub const fn wire_time_ns(len: usize) -> u64 {
    (len + WIRE_OVERHEAD) as u64 * BYTE_TIME_NS
}

/// Writes a frame of datagrams into a buffer of the caller.
#[derive(Debug)]
pub struct FrameBuilder<'a> {
    buffer: &'a mut [u8],
    limit: usize,
    start: usize,
    at: usize,
    last: Option<usize>,
}

impl<'a> FrameBuilder<'a> {
    /// Starts a plain Ethernet II frame; `None` if the buffer is shorter than [`MIN_FRAME`].
    pub fn ethernet(buffer: &'a mut [u8], destination: MacAddress, source: MacAddress) -> Option<FrameBuilder<'a>> {
        Self::new(buffer, destination, source, &Encapsulation::Ethernet)
    }

    /// Starts a frame with the given encapsulation; `None` if the buffer is shorter than [`MIN_FRAME`].
    pub fn new(
        buffer: &'a mut [u8],
        destination: MacAddress,
        source: MacAddress,
        encapsulation: &Encapsulation,
    ) -> Option<FrameBuilder<'a>> {
        if buffer.len() < MIN_FRAME {
            return None;
        }
        write_headers(buffer, destination, source, encapsulation)?;
        let limit = match encapsulation {
            Encapsulation::Vlan { .. } => MAX_FRAME_VLAN,
            _ => MAX_FRAME,
        };
        let start = encapsulation.header_len();
        let limit = limit.min(buffer.len());
        Some(FrameBuilder { buffer, limit, start, at: start + ETHERCAT_HEADER_LEN, last: None })
    }

    /// Maximum number of data bytes of one more datagram; `None` if not even an empty datagram fits.
    pub const fn room(&self) -> Option<usize> {
        self.limit.checked_sub(self.at + OVERHEAD)
    }

    /// Appends a datagram with zeroed data and working counter. Returns the offset of its data in the frame, or `None`
    /// if it does not fit.
    pub fn datagram(&mut self, command: Command, index: u8, target: Target, length: usize) -> Option<usize> {
        let header = Header::new(command, index, target, u16::try_from(length).ok()?);
        self.header(header)
    }

    /// Appends a datagram with this header, zeroed data and working counter. The builder sets the M bit.
    pub fn header(&mut self, header: Header) -> Option<usize> {
        let length = usize::from(header.length);
        if self.room()? < length {
            return None;
        }
        if let Some(last) = self.last {
            self.buffer[last + 7] |= (MORE >> 8) as u8;
        }
        let data = self.at + HEADER_LEN;
        self.buffer[self.at..data].copy_from_slice(&Header { more: false, ..header }.encode());
        self.buffer[data..data + length + WKC_LEN].fill(0);
        self.last = Some(self.at);
        self.at = data + length + WKC_LEN;
        Some(data)
    }

    /// Data of a datagram at the offset that [`FrameBuilder::datagram`] returned.
    pub fn data_mut(&mut self, offset: usize, length: usize) -> Option<&mut [u8]> {
        self.buffer.get_mut(offset..offset.checked_add(length)?)
    }

    /// Writes the EtherCAT header and the padding; returns the length of the frame, at least [`MIN_FRAME`].
    pub fn finish(self) -> usize {
        let length = (self.at - self.start - ETHERCAT_HEADER_LEN) as u16;
        let header = length | u16::from(EthercatType::Datagrams.code()) << 12;
        self.buffer[self.start..self.start + 2].copy_from_slice(&header.to_le_bytes());
        let end = self.at.max(MIN_FRAME);
        self.buffer[self.at..end].fill(0);
        end
    }
}

#[cfg(test)]
mod tests;
