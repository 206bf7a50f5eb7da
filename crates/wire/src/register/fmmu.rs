//! FMMU: maps logical bits to physical ones (protocol 3.10).

use crate::address::LogicalAddress;

/// One FMMU, 16 bytes at [`super::map::fmmu`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Fmmu {
    /// First logical byte.
    pub logical_start: LogicalAddress,
    /// Logical bytes, including partly mapped bytes.
    pub length: u16,
    /// First bit in the first byte, 0..=7.
    pub logical_start_bit: u8,
    /// Last bit in the last byte, 0..=7.
    pub logical_stop_bit: u8,
    /// First physical byte.
    pub physical_start: u16,
    /// First bit in the first physical byte, 0..=7.
    pub physical_start_bit: u8,
    /// Enabled for reads.
    pub read: bool,
    /// Enabled for writes.
    pub write: bool,
    /// Activated.
    pub active: bool,
    /// The other bits of bytes +6, +7, +A, +B, +C and the bytes +D, +E, +F, not shifted.
    pub reserved: [u8; 8],
}

const BIT_MASK: u8 = 0x07;
const TYPE_MASK: u8 = 0x03;
const ACTIVE_MASK: u8 = 0x01;

impl Fmmu {
    /// Bytes of the registers.
    pub const LEN: usize = 16;

    /// From the registers' bytes.
    pub const fn decode(bytes: &[u8; Self::LEN]) -> Fmmu {
        let b = bytes;
        Fmmu {
            logical_start: LogicalAddress(u32::from_le_bytes([b[0], b[1], b[2], b[3]])),
            length: u16::from_le_bytes([b[4], b[5]]),
            logical_start_bit: b[6] & BIT_MASK,
            logical_stop_bit: b[7] & BIT_MASK,
            physical_start: u16::from_le_bytes([b[8], b[9]]),
            physical_start_bit: b[10] & BIT_MASK,
            read: b[11] & 1 != 0,
            write: b[11] & 2 != 0,
            active: b[12] & ACTIVE_MASK != 0,
            reserved: [
                b[6] & !BIT_MASK,
                b[7] & !BIT_MASK,
                b[10] & !BIT_MASK,
                b[11] & !TYPE_MASK,
                b[12] & !ACTIVE_MASK,
                b[13],
                b[14],
                b[15],
            ],
        }
    }

    /// To the registers' bytes. Bit numbers above 7 lose their upper bits.
    pub const fn encode(&self) -> [u8; Self::LEN] {
        let logical = self.logical_start.0.to_le_bytes();
        let length = self.length.to_le_bytes();
        let physical = self.physical_start.to_le_bytes();
        let r = &self.reserved;
        [
            logical[0],
            logical[1],
            logical[2],
            logical[3],
            length[0],
            length[1],
            self.logical_start_bit & BIT_MASK | r[0] & !BIT_MASK,
            self.logical_stop_bit & BIT_MASK | r[1] & !BIT_MASK,
            physical[0],
            physical[1],
            self.physical_start_bit & BIT_MASK | r[2] & !BIT_MASK,
            self.read as u8 | (self.write as u8) << 1 | r[3] & !TYPE_MASK,
            self.active as u8 | r[4] & !ACTIVE_MASK,
            r[5],
            r[6],
            r[7],
        ]
    }

    /// Number of mapped bits; 0 if the settings describe none.
    pub const fn bit_length(&self) -> u32 {
        let end = self.length as u32 * 8 + (self.logical_stop_bit & BIT_MASK) as u32 + 1;
        end.saturating_sub(8 + (self.logical_start_bit & BIT_MASK) as u32)
    }
}
