//! Category DC: 24 bytes per operation mode of the distributed clock (protocol 4.6).

/// One operation mode.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct DcMode {
    /// Cycle of SYNC0 in nanoseconds; 0 if the factor defines it.
    pub sync0_cycle_ns: u32,
    /// Shift of SYNC0 in nanoseconds.
    pub sync0_shift_ns: u32,
    /// Shift of SYNC1 in nanoseconds.
    pub sync1_shift_ns: u32,
    /// Cycle of SYNC1 in cycles of SYNC0.
    pub sync1_cycle_factor: i16,
    /// Value for the registers 0x0980:0x0981.
    pub assign_activate: u16,
    /// Cycle of SYNC0 in cycles of the MainDevice.
    pub sync0_cycle_factor: i16,
    /// String index of the name, 0 for none.
    pub name: u8,
    /// String index of the description, 0 for none.
    pub description: u8,
    /// Reserved bytes.
    pub reserved: [u8; 4],
}

impl DcMode {
    /// Bytes of a mode.
    pub const LEN: usize = 24;

    /// Decodes a mode; every pattern is valid.
    pub const fn decode(b: &[u8; Self::LEN]) -> DcMode {
        DcMode {
            sync0_cycle_ns: u32::from_le_bytes([b[0], b[1], b[2], b[3]]),
            sync0_shift_ns: u32::from_le_bytes([b[4], b[5], b[6], b[7]]),
            sync1_shift_ns: u32::from_le_bytes([b[8], b[9], b[10], b[11]]),
            sync1_cycle_factor: i16::from_le_bytes([b[12], b[13]]),
            assign_activate: u16::from_le_bytes([b[14], b[15]]),
            sync0_cycle_factor: i16::from_le_bytes([b[16], b[17]]),
            name: b[18],
            description: b[19],
            reserved: [b[20], b[21], b[22], b[23]],
        }
    }

    /// Encodes a mode.
    pub fn encode(&self) -> [u8; Self::LEN] {
        let mut out = [0; Self::LEN];
        out[0..4].copy_from_slice(&self.sync0_cycle_ns.to_le_bytes());
        out[4..8].copy_from_slice(&self.sync0_shift_ns.to_le_bytes());
        out[8..12].copy_from_slice(&self.sync1_shift_ns.to_le_bytes());
        out[12..14].copy_from_slice(&self.sync1_cycle_factor.to_le_bytes());
        out[14..16].copy_from_slice(&self.assign_activate.to_le_bytes());
        out[16..18].copy_from_slice(&self.sync0_cycle_factor.to_le_bytes());
        out[18] = self.name;
        out[19] = self.description;
        out[20..].copy_from_slice(&self.reserved);
        out
    }
}

/// Iterator over the modes of a category. An incomplete mode at the end is ignored.
#[derive(Clone, Debug)]
pub struct DcModes<'a> {
    data: &'a [u8],
}

impl<'a> DcModes<'a> {
    /// Reads the data of a category.
    pub const fn new(data: &'a [u8]) -> DcModes<'a> {
        DcModes { data }
    }
}

impl Iterator for DcModes<'_> {
    type Item = DcMode;

    fn next(&mut self) -> Option<DcMode> {
        let (mode, rest) = self.data.split_first_chunk()?;
        self.data = rest;
        Some(DcMode::decode(mode))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    // covers: codec-sii
    #[test]
    fn a_mode_with_sync0_and_sync1_has_the_expected_bytes() {
        let bytes = [
            0x40, 0x42, 0x0F, 0x00, // SYNC0 cycle 1 ms
            0x10, 0x27, 0x00, 0x00, // SYNC0 shift 10 us
            0x20, 0x4E, 0x00, 0x00, // SYNC1 shift 20 us
            0xFE, 0xFF, 0x00, 0x07, 0x01, 0x00, 0x03, 0x04, 0, 0, 0, 0,
        ];
        let mode = DcMode {
            sync0_cycle_ns: 1_000_000,
            sync0_shift_ns: 10_000,
            sync1_shift_ns: 20_000,
            sync1_cycle_factor: -2,
            assign_activate: 0x0700,
            sync0_cycle_factor: 1,
            name: 3,
            description: 4,
            reserved: [0; 4],
        };
        assert_eq!(DcModes::new(&bytes).collect::<Vec<_>>(), [mode]);
        assert_eq!(mode.encode(), bytes);
    }

    proptest! {
        #[test]
        fn any_24_bytes_round_trip(bytes in any::<[u8; DcMode::LEN]>()) {
            prop_assert_eq!(DcMode::decode(&bytes).encode(), bytes);
        }
    }
}
