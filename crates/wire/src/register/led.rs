//! LED overrides, registers 0x0138 and 0x0139 (protocol 3.4; bits from the data sheet's register description).

bit_register! {
    /// Registers RUN_LED (0x0138) and ERR_LED (0x0139).
    LedOverride(u8, reset 0, reserved kept) {
        /// Pattern: 0 off, 1..=12 flashes, 13 blinking, 14 flickering, 15 on.
        code: u8 = 0, 4;
        /// The pattern replaces that of the controller.
        enable: bool = 4, 1;
    }
}
