//! One EtherCAT datagram: ten bytes of header, data, two bytes of working counter (protocol 1.2).

use crate::address::{LogicalAddress, Position, RegisterAddress, StationAddress, Wkc};
use crate::command::Command;

/// Bytes of a datagram before its data.
pub const HEADER_LEN: usize = 10;
/// Bytes of the working counter after the data.
pub const WKC_LEN: usize = 2;
/// Bytes of a datagram in addition to its data.
pub const OVERHEAD: usize = HEADER_LEN + WKC_LEN;
/// Maximum number of data bytes of the only datagram in a frame (protocol 1.3; not 1484).
pub const MAX_DATA: usize = 1486;

const LENGTH_MASK: u16 = 0x07FF;
const RESERVED_MASK: u16 = 0x3800;
const RESERVED_SHIFT: u32 = 11;
/// Bit "circulating" in the length field: the frame has passed a SubDevice with auto-closed port 0 (protocol 2.4).
pub const CIRCULATING: u16 = 0x4000;
/// Bit "more datagrams follow" in the length field.
pub const MORE: u16 = 0x8000;

/// The addressed SubDevices and their register or memory address.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Target {
    /// No SubDevice (NOP).
    None,
    /// The SubDevice at a position; processing units increment the address field.
    Position(Position, RegisterAddress),
    /// The SubDevice with this station address or enabled alias.
    Station(StationAddress, RegisterAddress),
    /// Every SubDevice.
    Broadcast(RegisterAddress),
    /// Every SubDevice that maps this logical address.
    Logical(LogicalAddress),
}

impl Target {
    /// The four address bytes of the header as one little-endian number: ADP in the low half and ADO in the high half,
    /// or the logical address.
    pub const fn raw(self) -> u32 {
        const fn physical(adp: u16, ado: RegisterAddress) -> u32 {
            adp as u32 | (ado.0 as u32) << 16
        }
        match self {
            Target::None => 0,
            Target::Position(position, ado) => physical(position.auto_increment(), ado),
            Target::Station(station, ado) => physical(station.0, ado),
            Target::Broadcast(ado) => physical(0, ado),
            Target::Logical(address) => address.0,
        }
    }
}

/// The header of a datagram with all bits on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Command.
    pub command: Command,
    /// Index (Idx), set by the MainDevice; SubDevices never change it.
    pub index: u8,
    /// ADP (low half) and ADO (high half), or the logical address.
    pub address: u32,
    /// Bytes of data, 0..=2047 on the wire.
    pub length: u16,
    /// Reserved bits 13:11 of the length field, 0..=7.
    pub reserved: u8,
    /// C bit (protocol 2.4).
    pub circulating: bool,
    /// M bit.
    pub more: bool,
    /// ECAT event request, OR of all SubDevices (protocol 1.2).
    pub irq: u16,
}

impl Header {
    /// A header as sent by a MainDevice: C clear, no event.
    pub const fn new(command: Command, index: u8, target: Target, length: u16) -> Header {
        Header { command, index, address: target.raw(), length, reserved: 0, circulating: false, more: false, irq: 0 }
    }

    /// Decodes ten bytes; every pattern is valid.
    pub const fn decode(bytes: &[u8; HEADER_LEN]) -> Header {
        let length = u16::from_le_bytes([bytes[6], bytes[7]]);
        Header {
            command: Command::from_code(bytes[0]),
            index: bytes[1],
            address: u32::from_le_bytes([bytes[2], bytes[3], bytes[4], bytes[5]]),
            length: length & LENGTH_MASK,
            reserved: ((length & RESERVED_MASK) >> RESERVED_SHIFT) as u8,
            circulating: length & CIRCULATING != 0,
            more: length & MORE != 0,
            irq: u16::from_le_bytes([bytes[8], bytes[9]]),
        }
    }

    /// Encodes into ten bytes. Lengths above 2047 and reserved values above 7 lose their upper bits.
    pub const fn encode(&self) -> [u8; HEADER_LEN] {
        let mut length = self.length & LENGTH_MASK;
        length |= ((self.reserved as u16) << RESERVED_SHIFT) & RESERVED_MASK;
        if self.circulating {
            length |= CIRCULATING;
        }
        if self.more {
            length |= MORE;
        }
        let a = self.address.to_le_bytes();
        let l = length.to_le_bytes();
        let i = self.irq.to_le_bytes();
        [self.command.code(), self.index, a[0], a[1], a[2], a[3], l[0], l[1], i[0], i[1]]
    }

    /// The lower half of the address: position or station address.
    pub const fn adp(&self) -> u16 {
        self.address as u16
    }

    /// The upper half of the address: register or memory address in the SubDevice.
    pub const fn ado(&self) -> RegisterAddress {
        RegisterAddress((self.address >> 16) as u16)
    }

    /// The address as a logical address.
    pub const fn logical(&self) -> LogicalAddress {
        LogicalAddress(self.address)
    }
}

/// A datagram inside a received frame, borrowed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Datagram<'a> {
    /// The header.
    pub header: Header,
    /// The data.
    pub data: &'a [u8],
    /// The working counter.
    pub wkc: Wkc,
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_read_of_al_status_has_the_expected_bytes() {
        // protocol 1.2: FPRD 0x1001:0x0130, two bytes, more to follow.
        let target = Target::Station(StationAddress(0x1001), RegisterAddress(0x0130));
        let header = Header { more: true, ..Header::new(Command::Fprd, 0x2A, target, 2) };
        assert_eq!(header.encode(), [0x04, 0x2A, 0x01, 0x10, 0x30, 0x01, 0x02, 0x80, 0x00, 0x00]);
    }

    // covers: codec-frames
    #[test]
    fn one_vector_for_every_command() {
        let ado = RegisterAddress(0x0120);
        let station = Target::Station(StationAddress(0x1002), ado);
        let position = Target::Position(Position(1), ado);
        let vectors = [
            (Command::Nop, Target::None, [0, 7, 0, 0, 0, 0, 2, 0, 0, 0]),
            (Command::Aprd, position, [1, 7, 0xFF, 0xFF, 0x20, 1, 2, 0, 0, 0]),
            (Command::Apwr, position, [2, 7, 0xFF, 0xFF, 0x20, 1, 2, 0, 0, 0]),
            (Command::Aprw, position, [3, 7, 0xFF, 0xFF, 0x20, 1, 2, 0, 0, 0]),
            (Command::Fprd, station, [4, 7, 2, 0x10, 0x20, 1, 2, 0, 0, 0]),
            (Command::Fpwr, station, [5, 7, 2, 0x10, 0x20, 1, 2, 0, 0, 0]),
            (Command::Fprw, station, [6, 7, 2, 0x10, 0x20, 1, 2, 0, 0, 0]),
            (Command::Brd, Target::Broadcast(ado), [7, 7, 0, 0, 0x20, 1, 2, 0, 0, 0]),
            (Command::Bwr, Target::Broadcast(ado), [8, 7, 0, 0, 0x20, 1, 2, 0, 0, 0]),
            (Command::Brw, Target::Broadcast(ado), [9, 7, 0, 0, 0x20, 1, 2, 0, 0, 0]),
            (Command::Lrd, Target::Logical(LogicalAddress(0x0001_0203)), [10, 7, 3, 2, 1, 0, 2, 0, 0, 0]),
            (Command::Lwr, Target::Logical(LogicalAddress(0x0001_0203)), [11, 7, 3, 2, 1, 0, 2, 0, 0, 0]),
            (Command::Lrw, Target::Logical(LogicalAddress(0x0001_0203)), [12, 7, 3, 2, 1, 0, 2, 0, 0, 0]),
            (Command::Armw, position, [13, 7, 0xFF, 0xFF, 0x20, 1, 2, 0, 0, 0]),
            (Command::Frmw, station, [14, 7, 2, 0x10, 0x20, 1, 2, 0, 0, 0]),
        ];
        for (command, target, bytes) in vectors {
            let header = Header::new(command, 7, target, 2);
            assert_eq!(header.encode(), bytes, "{command}");
            assert_eq!(Header::decode(&bytes), header, "{command}");
        }
    }

    proptest! {
        // covers: codec-frames
        #[test]
        fn any_ten_bytes_round_trip(bytes in any::<[u8; HEADER_LEN]>()) {
            prop_assert_eq!(Header::decode(&bytes).encode(), bytes);
        }
    }
}
