//! Fragments of areas: their heads, and the walk over those of a received frame.

use super::header::Header as CycleHeader;
use super::{ADDRESS, Area, is_master_frame};
use crate::command::Command;
use crate::datagram::{self, HEADER_LEN, Header, MAX_DATA, WKC_LEN};
use crate::frame::{ETHERCAT_HEADER_LEN, ETHERNET_HEADER_LEN};

/// Most bytes of an area in one fragment.
pub const MAX_FRAGMENT: usize = MAX_DATA - FragmentHead::LEN;

/// First bytes of each datagram of a master frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FragmentHead {
    /// The area.
    pub area: Area,
    /// Version of the sender.
    pub version: u8,
    /// Number of the fragment in its cycle, from 0 on.
    pub number: u16,
    /// The cycle, counted by the ACTIVE.
    pub cycle: u32,
    /// First byte in the area.
    pub offset: u32,
}

impl FragmentHead {
    /// Bytes.
    pub const LEN: usize = 12;

    /// Decodes a head.
    pub const fn decode(bytes: &[u8; Self::LEN]) -> FragmentHead {
        let [area, version, a, b, c, d, e, f, g, h, i, j] = *bytes;
        FragmentHead {
            area: Area::from_code(area),
            version,
            number: u16::from_le_bytes([a, b]),
            cycle: u32::from_le_bytes([c, d, e, f]),
            offset: u32::from_le_bytes([g, h, i, j]),
        }
    }

    /// Encodes it.
    pub const fn encode(&self) -> [u8; Self::LEN] {
        let ([a, b], [c, d, e, f]) = (self.number.to_le_bytes(), self.cycle.to_le_bytes());
        let [g, h, i, j] = self.offset.to_le_bytes();
        [self.area.code(), self.version, a, b, c, d, e, f, g, h, i, j]
    }
}

/// A fragment in a received frame.
#[derive(Debug)]
pub struct Fragment<'a> {
    /// Its head.
    pub head: FragmentHead,
    /// Its bytes of the area.
    pub data: &'a mut [u8],
    wkc: &'a mut [u8; WKC_LEN],
}

impl Fragment<'_> {
    /// The working counter of its datagram.
    pub const fn wkc(&self) -> u16 {
        u16::from_le_bytes(*self.wkc)
    }

    /// Adds the weight of its area to the working counter.
    pub const fn count(&mut self) {
        *self.wkc = self.wkc().wrapping_add(self.head.area.weight()).to_le_bytes();
    }
}

/// The fragments of a master frame, in their order.
#[derive(Debug, Default)]
pub struct FragmentsMut<'a> {
    rest: &'a mut [u8],
}

/// The fragments of a received frame; none if it is no master frame. Other datagrams in it are left out. Any bytes are
/// allowed: the walk ends where a datagram does not fit.
pub fn fragments_mut(frame: &mut [u8]) -> FragmentsMut<'_> {
    if !is_master_frame(frame) {
        return FragmentsMut::default();
    }
    let announced = usize::from(u16::from_le_bytes([frame[ETHERNET_HEADER_LEN], frame[ETHERNET_HEADER_LEN + 1]]));
    let rest = frame.get_mut(ETHERNET_HEADER_LEN + ETHERCAT_HEADER_LEN..).unwrap_or_default();
    let length = (announced & 0x07FF).min(rest.len());
    FragmentsMut { rest: rest.get_mut(..length).unwrap_or_default() }
}

/// The header of a cycle in a received frame, if that is the first master frame of a cycle: its first datagram has it.
/// Any bytes are allowed.
pub fn header_of_frame(frame: &[u8]) -> Option<CycleHeader> {
    if !is_master_frame(frame) {
        return None;
    }
    let rest = frame.get(ETHERNET_HEADER_LEN + ETHERCAT_HEADER_LEN..)?;
    let header = Header::decode(rest.first_chunk()?);
    let content = rest.get(HEADER_LEN..HEADER_LEN + usize::from(header.length))?;
    let (head, data) = content.split_first_chunk()?;
    let head = FragmentHead::decode(head);
    if head.area == Area::Header && head.offset == 0 { CycleHeader::decode(data).ok() } else { None }
}

impl<'a> Iterator for FragmentsMut<'a> {
    type Item = Fragment<'a>;

    fn next(&mut self) -> Option<Fragment<'a>> {
        loop {
            let rest = core::mem::take(&mut self.rest);
            let header = Header::decode(rest.first_chunk()?);
            let whole = datagram::OVERHEAD + usize::from(header.length);
            let (this, others) = rest.split_at_mut_checked(whole)?;
            if header.more {
                self.rest = others;
            }
            let (_, content) = this.split_at_mut(HEADER_LEN);
            if header.command == Command::Nop
                && header.address == ADDRESS
                && let Some((head, content)) = content.split_first_chunk_mut()
                && let Some((data, wkc)) = content.split_last_chunk_mut()
            {
                return Some(Fragment { head: FragmentHead::decode(head), data, wkc });
            }
        }
    }
}
