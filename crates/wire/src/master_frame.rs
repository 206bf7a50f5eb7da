//! Master frames: what the two MainDevices of a ring send each other, in each cycle (protocol 9.8), and Ethernet frames
//! between both (protocol 9.12).
//!
//! A master frame holds NOP datagrams at ADP 0 and ADO 0x4155 only, so that SubDevices pass it unchanged. Each datagram
//! is a fragment of one area ([`Area`]): a head ([`FragmentHead`]), then bytes of the area. One direction per area
//! makes the weight of its working counter unambiguous: the INACTIVE adds 2 where it has taken bytes of the ACTIVE, 1
//! where it has put in bytes for the ACTIVE.
//!
//! [`fragments_mut`] walks over the fragments of a received frame. The contents of the areas that have a fixed form are
//! [`Header`], [`SubDeviceRecord`], [`Diagnosis`] and [`Answer`]; the others are bytes of the application. Acyclic
//! master frames have areas of their own, with an [`EthernetHead`] each.
//!
//! Versions (decision 0130): a later version appends fields and areas, and changes nothing. A reader ignores bytes
//! behind the fields and areas that it supports; each sender names the oldest version whose readers understand it.

mod answer;
mod cursor;
mod diagnosis;
mod ethernet;
mod fragment;
mod header;
mod item;
mod subdevice;

use core::fmt;

use crate::address::RegisterAddress;
use crate::command::Command;
use crate::datagram;
use crate::frame::{ETHERCAT_HEADER_LEN, ETHERNET_HEADER_LEN, ETHERTYPE};

pub use answer::{Answer, NotReady, Stage};
pub use diagnosis::{Diagnosis, DomainRecord};
pub use ethernet::{ETHERNET_AREA, ETHERNET_MTU, EthernetHead, MAX_ETHERNET, MIN_ETHERNET};
pub use fragment::{Fragment, FragmentHead, FragmentsMut, MAX_FRAGMENT, fragments_mut, header_of_frame};
pub use header::{Header, Lengths, Phase};
pub use item::Item;
pub use subdevice::SubDeviceRecord;

/// ADO of the NOP datagrams of a master frame; their ADP is 0.
pub const ADO: RegisterAddress = RegisterAddress(0x4155);
/// Address word of these datagrams.
const ADDRESS: u32 = (ADO.0 as u32) << 16;
/// Version of the layout that this library writes.
pub const VERSION: u8 = 1;
/// Oldest version whose readers understand what this library writes.
pub const LEAST_READER: u8 = 1;
/// First bytes of the header.
const MAGIC: [u8; 4] = *b"RCmr";
/// First bytes of the answer.
const ANSWER_MAGIC: [u8; 4] = *b"RCma";
/// Bit of an area's code: the INACTIVE writes it.
const TO_ACTIVE: u8 = 0x80;

/// What a fragment is a part of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Area {
    /// The header of the cycle; one fragment, the first one.
    Header,
    /// One byte per declared SubDevice ([`SubDeviceRecord`]).
    SubDevices,
    /// The merged inputs of the last cycle, of all domains.
    Inputs,
    /// Diagnosis ([`Diagnosis`]).
    Diagnosis,
    /// Process data of the ACTIVE for the INACTIVE.
    ToInactive,
    /// A part of the knowledge of the segment, another one in each cycle.
    Knowledge,
    /// An Ethernet frame of the ACTIVE for the INACTIVE, or none; in acyclic master frames.
    EthernetToInactive,
    /// The answer of the INACTIVE ([`Answer`]); one fragment.
    Answer,
    /// Process data of the INACTIVE for the ACTIVE.
    ToActive,
    /// Room for an Ethernet frame of the INACTIVE for the ACTIVE; in acyclic master frames.
    EthernetToActive,
    /// An area of a later version.
    Other(u8),
}

impl Area {
    /// From its code.
    pub const fn from_code(code: u8) -> Area {
        match code {
            0x01 => Area::Header,
            0x02 => Area::SubDevices,
            0x03 => Area::Inputs,
            0x04 => Area::Diagnosis,
            0x05 => Area::ToInactive,
            0x06 => Area::Knowledge,
            0x07 => Area::EthernetToInactive,
            0x81 => Area::Answer,
            0x82 => Area::ToActive,
            0x83 => Area::EthernetToActive,
            other => Area::Other(other),
        }
    }

    /// Its code.
    pub const fn code(self) -> u8 {
        match self {
            Area::Header => 0x01,
            Area::SubDevices => 0x02,
            Area::Inputs => 0x03,
            Area::Diagnosis => 0x04,
            Area::ToInactive => 0x05,
            Area::Knowledge => 0x06,
            Area::EthernetToInactive => 0x07,
            Area::Answer => 0x81,
            Area::ToActive => 0x82,
            Area::EthernetToActive => 0x83,
            Area::Other(code) => code,
        }
    }

    /// Whether the INACTIVE writes it, for the ACTIVE.
    pub const fn is_to_active(self) -> bool {
        self.code() & TO_ACTIVE != 0
    }

    /// What the INACTIVE adds to the working counter when it has taken or filled a fragment (protocol FR-10).
    pub const fn weight(self) -> u16 {
        if self.is_to_active() { 1 } else { 2 }
    }
}

/// Why bytes are not what they should be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum MasterFrameError {
    /// Too short.
    Short {
        /// The expected part.
        what: &'static str,
        /// Minimum number of bytes.
        expected: usize,
        /// Bytes available.
        got: usize,
    },
    /// Other first bytes: of another stack.
    Magic([u8; 4]),
    /// The sender writes a layout that this library does not understand.
    Version {
        /// The oldest version whose readers understand the sender.
        least: u8,
        /// The version of the sender.
        got: u8,
    },
}

impl fmt::Display for MasterFrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            MasterFrameError::Short { what, expected, got } => {
                write!(f, "{what} too short: expected at least {expected} bytes, got {got}")
            }
            MasterFrameError::Magic(got) => write!(f, "a master frame of another stack: it begins with {got:02x?}"),
            MasterFrameError::Version { least, got } => {
                write!(f, "master frames of version {got}, readable from version {least} on: here is version {VERSION}")
            }
        }
    }
}

impl core::error::Error for MasterFrameError {}

/// Whether a received frame is a master frame, by its first datagram. Any bytes are allowed.
pub fn is_master_frame(bytes: &[u8]) -> bool {
    const AT: usize = ETHERNET_HEADER_LEN + ETHERCAT_HEADER_LEN;
    let Some(head) = bytes.first_chunk::<{ AT + datagram::OVERHEAD }>() else { return false };
    let [high, low] = ETHERTYPE.to_be_bytes();
    let address = u32::from_le_bytes([head[AT + 2], head[AT + 3], head[AT + 4], head[AT + 5]]);
    head[12] == high
        && head[13] == low
        && head[ETHERNET_HEADER_LEN + 1] >> 4 == 1
        && head[AT] == Command::Nop.code()
        && address == ADDRESS
}

#[cfg(test)]
mod tests;
