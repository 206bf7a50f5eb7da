//! Station address and alias, write protection, reset: registers 0x0010..0x0041 (protocol 3.2).

use crate::address::StationAddress;

// STATION_ADDRESS (0x0010) and STATION_ALIAS (0x0012).
number_bytes!(StationAddress(u16));

number_register! {
    /// Registers REGISTER_WRITE_ENABLE (0x0020) and ESC_WRITE_ENABLE (0x0030): a write permits writes to protected
    /// registers for the rest of the frame.
    WriteEnable(u8, reset 0)
}

bit_register! {
    /// Registers REGISTER_WRITE_PROTECTION (0x0021, blocks 0x0000..0x0F7F) and ESC_WRITE_PROTECTION (0x0031, blocks
    /// the whole memory).
    WriteProtection(u8, reset 0, reserved kept) {
        /// Writes are blocked unless the frame wrote the enable register before.
        protected: bool = 0, 1;
    }
}

number_register! {
    /// Registers ESC_RESET_ECAT (0x0040) and ESC_RESET_PDI (0x0041). Writing [`EscReset::SEQUENCE`] in three
    /// consecutive frames resets the controller; reading returns the number of accepted steps.
    EscReset(u8, reset 0)
}

impl EscReset {
    /// The values to write: 'R', 'E', 'S'.
    pub const SEQUENCE: [EscReset; 3] = [EscReset(b'R'), EscReset(b'E'), EscReset(b'S')];
}
