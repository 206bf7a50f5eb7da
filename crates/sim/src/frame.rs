//! A frame on its path through the segment (protocol 1.1, 1.2, 1.3).
//!
//! Input: the bytes sent by a host. Output: [`SimFrame`], which contains the offsets of its datagrams, so that no
//! controller parses it again, and the state of its FCS. Controllers and network process it.

use ringcat_wire::datagram::{HEADER_LEN, OVERHEAD, WKC_LEN};
use ringcat_wire::frame::{
    BYTE_TIME_NS, ETHERCAT_HEADER_LEN, ETHERNET_HEADER_LEN, ETHERTYPE, ETHERTYPE_IPV4, ETHERTYPE_VLAN, MIN_FRAME,
    UDP_PORT, wire_time_ns,
};

/// Bytes of preamble, delimiter and FCS, transmitted in addition to the bytes of the frame.
const PREAMBLE_AND_FCS: u64 = 12;
/// Bytes of an IPv4 header of five words and a UDP header.
const UDP_HEADERS_LEN: usize = 28;
const LENGTH_MASK: u16 = 0x07FF;
const MORE: u8 = 0x80;

/// One of the four ports of a controller. The controller implements the order 0-3-1-2.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Port {
    /// Port 0, followed by the processing unit.
    A = 0,
    /// Port 1.
    B = 1,
    /// Port 2.
    C = 2,
    /// Port 3.
    D = 3,
}

impl Port {
    /// All ports by number.
    pub const ALL: [Port; 4] = [Port::A, Port::B, Port::C, Port::D];

    /// The port's number, 0..=3.
    pub const fn index(self) -> usize {
        self as usize
    }

    /// The port with a number.
    pub const fn from_index(index: usize) -> Option<Port> {
        if index < 4 { Some(Self::ALL[index]) } else { None }
    }
}

/// State of the FCS of a frame (protocol 2.5).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Fcs {
    /// Valid.
    #[default]
    Good,
    /// Damaged, not counted by a controller yet.
    Bad,
    /// Damaged; a controller has counted and marked it for the following ones.
    Marked,
}

/// Type of a frame for a controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FrameKind {
    /// EtherCAT with datagrams (type 1): plain, with a VLAN tag or in UDP.
    Datagrams,
    /// EtherCAT of another type: never processed, forwarded.
    OtherEthercat,
    /// Another protocol.
    Foreign,
}

/// Position of a datagram in the frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct DatagramPlace {
    /// Offset of the ten-byte header.
    pub header: u16,
    /// Bytes of data; the working counter follows them.
    pub length: u16,
}

/// A frame in the segment.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SimFrame {
    /// The frame without FCS.
    pub bytes: Vec<u8>,
    /// The datagrams, in order, up to the first one that exceeds the frame. Empty unless `kind` is `Datagrams`.
    pub datagrams: Vec<DatagramPlace>,
    /// Type for a controller.
    pub kind: FrameKind,
    /// Shorter than the minimum of Ethernet, or a datagram exceeds the frame: an error for every processing unit.
    pub malformed: bool,
    /// State of the FCS.
    pub fcs: Fcs,
    /// Whether it contains an invalid symbol that the receiving port has not counted yet.
    pub symbol_error: bool,
    /// Unique number: for logs, and to identify the frame when it returns to a controller.
    pub id: u64,
    /// Maximum number of processed datagrams; further ones are forwarded unchanged.
    pub most_datagrams: usize,
}

impl SimFrame {
    /// Creates a frame from any bytes and finds its datagrams.
    pub fn new(id: u64, bytes: Vec<u8>) -> SimFrame {
        let (kind, malformed, fcs, symbol_error) = (FrameKind::Foreign, false, Fcs::Good, false);
        let (datagrams, most_datagrams) = (Vec::new(), usize::MAX);
        let mut frame = SimFrame { bytes, datagrams, kind, malformed, fcs, symbol_error, id, most_datagrams };
        frame.parse();
        frame
    }

    /// Replaces the frame by these bytes and keeps the buffers: for pools.
    pub fn refill(&mut self, id: u64, bytes: &[u8]) {
        self.id = id;
        self.most_datagrams = usize::MAX;
        (self.fcs, self.symbol_error) = (Fcs::Good, false);
        self.bytes.clear();
        self.bytes.extend_from_slice(bytes);
        self.parse();
    }

    /// Replaces the frame by a copy of another one and keeps the buffers: for pools.
    pub fn copy_from(&mut self, other: &SimFrame) {
        self.bytes.clear();
        self.bytes.extend_from_slice(&other.bytes);
        self.datagrams.clear();
        self.datagrams.extend_from_slice(&other.datagrams);
        (self.kind, self.malformed, self.fcs, self.id) = (other.kind, other.malformed, other.fcs, other.id);
        (self.symbol_error, self.most_datagrams) = (other.symbol_error, other.most_datagrams);
    }

    /// Keeps only the first `len` bytes: the rest is lost when a cable is cut while the frame passes.
    pub fn truncate(&mut self, len: usize) {
        if len < self.bytes.len() {
            self.bytes.truncate(len);
            self.fcs = Fcs::Bad;
            self.parse();
        }
    }

    /// Limits the number of processed datagrams; further ones are forwarded unchanged.
    pub fn process_at_most(&mut self, most: usize) {
        self.most_datagrams = most;
        self.datagrams.truncate(most);
    }

    /// Time from the first bit of the preamble to the last bit of the FCS at 100 Mbit/s.
    pub const fn first_to_last_bit_ns(&self) -> u64 {
        (self.bytes.len() as u64 + PREAMBLE_AND_FCS) * BYTE_TIME_NS
    }

    /// Time for which the frame occupies a link at 100 Mbit/s, including the gap.
    pub const fn occupies_ns(&self) -> u64 {
        wire_time_ns(self.bytes.len())
    }

    /// Finds kind and datagrams. Controllers use the lengths of the datagrams, not the length in the EtherCAT header
    /// (protocol 1.1).
    fn parse(&mut self) {
        self.datagrams.clear();
        let (kind, payload) = classify(&self.bytes);
        self.kind = kind;
        self.malformed = self.bytes.len() < MIN_FRAME;
        if kind != FrameKind::Datagrams {
            return;
        }
        let mut at = payload;
        loop {
            let Some(field) = self.bytes.get(at + 6..at + 8) else {
                self.malformed = true;
                return;
            };
            let length = u16::from_le_bytes([field[0], field[1]]) & LENGTH_MASK;
            let more = field[1] & MORE != 0;
            let end = at + OVERHEAD + usize::from(length);
            match u16::try_from(at) {
                Ok(header) if end <= self.bytes.len() => self.datagrams.push(DatagramPlace { header, length }),
                _ => {
                    self.malformed = true;
                    return;
                }
            }
            if !more || self.datagrams.len() >= self.most_datagrams {
                return;
            }
            at = end;
        }
    }
}

impl DatagramPlace {
    /// Offset of the data.
    pub const fn data(&self) -> usize {
        self.header as usize + HEADER_LEN
    }

    /// Offset of the working counter.
    pub const fn wkc(&self) -> usize {
        self.data() + self.length as usize
    }

    /// Offset after the working counter.
    pub const fn end(&self) -> usize {
        self.wkc() + WKC_LEN
    }
}

/// Offset of the UDP checksum in an EtherCAT frame over UDP, which a processing unit clears (protocol 1.3).
pub(crate) const UDP_CHECKSUM: usize = ETHERNET_HEADER_LEN + UDP_HEADERS_LEN - 2;

/// Whether the EtherCAT part of the frame is in UDP.
pub(crate) fn is_udp(bytes: &[u8]) -> bool {
    bytes.get(12..14).is_some_and(|ethertype| ethertype == ETHERTYPE_IPV4.to_be_bytes())
}

/// The kind of a frame and the offset after the EtherCAT header.
fn classify(bytes: &[u8]) -> (FrameKind, usize) {
    let word = |at: usize| bytes.get(at..at + 2).map(|b| u16::from_be_bytes([b[0], b[1]]));
    let start = match word(12) {
        Some(ETHERTYPE) => ETHERNET_HEADER_LEN,
        Some(ETHERTYPE_VLAN) if word(16) == Some(ETHERTYPE) => ETHERNET_HEADER_LEN + 4,
        Some(ETHERTYPE_IPV4)
            if bytes.get(14) == Some(&0x45) && bytes.get(23) == Some(&17) && word(36) == Some(UDP_PORT) =>
        {
            ETHERNET_HEADER_LEN + UDP_HEADERS_LEN
        }
        _ => return (FrameKind::Foreign, 0),
    };
    match bytes.get(start + 1).map(|high| high >> 4) {
        Some(1) => (FrameKind::Datagrams, start + ETHERCAT_HEADER_LEN),
        Some(_) => (FrameKind::OtherEthercat, start + ETHERCAT_HEADER_LEN),
        None => (FrameKind::Foreign, 0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use ringcat_wire::address::RegisterAddress;
    use ringcat_wire::command::Command;
    use ringcat_wire::datagram::Target;
    use ringcat_wire::frame::{FrameBuilder, MacAddress};

    fn two_datagrams() -> Vec<u8> {
        let mut buffer = vec![0; 1514];
        let mut builder =
            FrameBuilder::ethernet(&mut buffer, MacAddress::BROADCAST, MacAddress([2, 0, 0, 0, 0, 1])).unwrap();
        builder.datagram(Command::Brd, 1, Target::Broadcast(RegisterAddress(0x0130)), 2).unwrap();
        builder.datagram(Command::Nop, 1, Target::None, 5).unwrap();
        let len = builder.finish();
        buffer.truncate(len);
        buffer
    }

    #[test]
    fn datagrams_are_found_once() {
        let frame = SimFrame::new(7, two_datagrams());
        assert!(matches!(frame.kind, FrameKind::Datagrams) && !frame.malformed);
        let places = [DatagramPlace { header: 16, length: 2 }, DatagramPlace { header: 30, length: 5 }];
        assert_eq!(frame.datagrams, places);
        assert_eq!((places[1].data(), places[1].wkc(), places[1].end()), (40, 45, 47));
    }

    #[test]
    fn a_truncated_frame_keeps_its_complete_datagrams() {
        let mut frame = SimFrame::new(7, two_datagrams());
        frame.truncate(44);
        assert_eq!((frame.datagrams.len(), frame.malformed, frame.fcs), (1, true, Fcs::Bad));
    }

    // covers: sim-faults
    #[test]
    fn datagrams_beyond_the_limit_are_ignored_also_after_a_cut() {
        let mut frame = SimFrame::new(7, two_datagrams());
        frame.process_at_most(1);
        assert_eq!((frame.datagrams.len(), frame.malformed), (1, false));
        frame.truncate(50);
        assert_eq!(frame.datagrams.len(), 1);
    }

    #[test]
    fn network_variables_and_other_protocols_are_distinguished() {
        let mut bytes = two_datagrams();
        bytes[15] = 0x40;
        assert_eq!(SimFrame::new(0, bytes.clone()).kind, FrameKind::OtherEthercat);
        bytes[12] = 0x08;
        assert_eq!(SimFrame::new(0, bytes).kind, FrameKind::Foreign);
    }

    #[test]
    fn a_shortest_frame_takes_5760_ns_and_occupies_6720_ns() {
        let frame = SimFrame::new(0, two_datagrams());
        assert_eq!((frame.first_to_last_bit_ns(), frame.occupies_ns()), (5_760, 6_720));
    }

    proptest! {
        #[test]
        fn any_bytes_become_a_frame_with_datagrams_inside_it(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            let mut ethercat = bytes.clone();
            if ethercat.len() > 16 {
                ethercat[12..14].copy_from_slice(&[0x88, 0xA4]);
                ethercat[15] = 0x10;
            }
            for bytes in [bytes, ethercat] {
                let frame = SimFrame::new(0, bytes);
                prop_assert!(frame.datagrams.iter().all(|place| place.end() <= frame.bytes.len()));
            }
        }
    }
}
