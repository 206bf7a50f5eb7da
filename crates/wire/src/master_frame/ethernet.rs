//! Ethernet frames between both MainDevices, in acyclic master frames: the head before each one (protocol 9.12).
//!
//! An acyclic master frame has two fragments: [`Area::EthernetToInactive`], which the ACTIVE writes, and
//! [`Area::EthernetToActive`], whose room the INACTIVE fills. Both begin with this head; the number of the frame is in
//! the place of the cycle.
//!
//! [`Area::EthernetToInactive`]: super::Area::EthernetToInactive
//! [`Area::EthernetToActive`]: super::Area::EthernetToActive

use super::{FragmentHead, MasterFrameError};
use crate::datagram::{MAX_DATA, OVERHEAD};

/// Bytes of an area without an Ethernet frame, with its datagram.
pub const ETHERNET_AREA: usize = OVERHEAD + FragmentHead::LEN + EthernetHead::LEN;
/// Longest Ethernet frame: both areas have their places in one EtherCAT frame.
pub const MAX_ETHERNET: usize = MAX_DATA + OVERHEAD - 2 * ETHERNET_AREA;
/// Shortest Ethernet frame: its header.
pub const MIN_ETHERNET: usize = 14;
/// MTU of an interface whose frames fit, with a VLAN tag.
pub const ETHERNET_MTU: usize = MAX_ETHERNET - 18;
/// First bytes.
const MAGIC: [u8; 4] = *b"RCet";

/// The head of an area with an Ethernet frame, or with none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EthernetHead {
    /// Another number for each start of the sender: its frames are counted anew.
    pub stream: u32,
    /// Number of the sender's last Ethernet frame: the one in this area, or one before.
    pub number: u32,
    /// Bytes of the Ethernet frame in this area; 0 without one.
    pub length: u16,
    /// Bytes of the Ethernet frame that the sender has next; 0 without one.
    pub next: u16,
}

impl EthernetHead {
    /// Bytes.
    pub const LEN: usize = 16;

    /// Decodes a head. Bytes behind it are left out.
    ///
    /// # Errors
    /// Too short, or of another stack.
    pub fn decode(bytes: &[u8]) -> Result<EthernetHead, MasterFrameError> {
        let short = MasterFrameError::Short {
            what: "head of an Ethernet frame in a master frame",
            expected: Self::LEN,
            got: bytes.len(),
        };
        let head = bytes.first_chunk::<{ Self::LEN }>().ok_or(short)?;
        let [m0, m1, m2, m3, s0, s1, s2, s3, n0, n1, n2, n3, l0, l1, x0, x1] = *head;
        let magic = [m0, m1, m2, m3];
        if magic != MAGIC {
            return Err(MasterFrameError::Magic(magic));
        }
        Ok(EthernetHead {
            stream: u32::from_le_bytes([s0, s1, s2, s3]),
            number: u32::from_le_bytes([n0, n1, n2, n3]),
            length: u16::from_le_bytes([l0, l1]),
            next: u16::from_le_bytes([x0, x1]),
        })
    }

    /// Encodes it.
    pub fn encode(&self) -> [u8; Self::LEN] {
        let mut bytes = [0; Self::LEN];
        bytes[..4].copy_from_slice(&MAGIC);
        bytes[4..8].copy_from_slice(&self.stream.to_le_bytes());
        bytes[8..12].copy_from_slice(&self.number.to_le_bytes());
        bytes[12..14].copy_from_slice(&self.length.to_le_bytes());
        bytes[14..].copy_from_slice(&self.next.to_le_bytes());
        bytes
    }

    /// The head of an area, and its Ethernet frame; `None` if there is none, or if the bytes are not those of an area.
    pub fn split(area: &[u8]) -> Option<(EthernetHead, Option<&[u8]>)> {
        let head = EthernetHead::decode(area).ok()?;
        let length = usize::from(head.length);
        if length == 0 {
            return Some((head, None));
        }
        let frame = area.get(Self::LEN..Self::LEN + length)?;
        (length >= MIN_ETHERNET).then_some((head, Some(frame)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: 9.12, AC-04, standby
    #[test]
    fn a_head_of_an_ethernet_frame_has_the_expected_bytes() {
        let head = EthernetHead { stream: 0x0102_0304, number: 0x1112_1314, length: 0x0576, next: 60 };
        let bytes = [b'R', b'C', b'e', b't', 4, 3, 2, 1, 0x14, 0x13, 0x12, 0x11, 0x76, 0x05, 60, 0];
        assert_eq!((head.encode(), EthernetHead::decode(&bytes)), (bytes, Ok(head)));
        assert_eq!(EthernetHead::decode(b"RCmr............"), Err(MasterFrameError::Magic(*b"RCmr")));
        let short = EthernetHead::decode(&bytes[..15]).expect_err("a byte is missing");
        let words = "head of an Ethernet frame in a master frame too short: expected at least 16 bytes, got 15";
        assert_eq!(std::string::ToString::to_string(&short), words);
    }

    // covers: 9.12, AC-04, REQ039, standby
    #[test]
    fn the_longest_ethernet_frame_leaves_room_for_the_head_of_the_other_direction() {
        assert_eq!((MAX_ETHERNET, ETHERNET_MTU), (1418, 1400));
        assert_eq!(crate::frame::MAX_FRAME, 14 + 2 + 2 * ETHERNET_AREA + MAX_ETHERNET);
    }

    // covers: 9.12, standby
    #[test]
    fn an_area_is_split_only_if_its_frame_is_in_it() {
        let area = |length: u16, bytes: usize| {
            let head = EthernetHead { length, ..EthernetHead::default() };
            let mut area = head.encode().to_vec();
            area.resize(EthernetHead::LEN + bytes, 7);
            EthernetHead::split(&area).map(|(_, frame)| frame.map(<[u8]>::len))
        };
        assert_eq!((area(0, 0), area(0, 100)), (Some(None), Some(None)));
        assert_eq!((area(14, 14), area(60, 100)), (Some(Some(14)), Some(Some(60))));
        assert_eq!((area(13, 100), area(61, 60), area(u16::MAX, 60)), (None, None, None));
        assert_eq!(EthernetHead::split(b"RCet"), None);
    }
}
