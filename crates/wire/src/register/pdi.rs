//! The process data interface, registers 0x0140..0x0153 (protocol 3.5; bits of PDI_INFORMATION and the pin bits of
//! SYNC_LATCH_CONFIGURATION from the data sheet's register description).

use super::view::Field;

/// Register PDI_CONTROL (0x0140): type of the interface to the application of the SubDevice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum PdiControl {
    /// None.
    #[default]
    None,
    /// Digital I/O.
    DigitalIo,
    /// SPI.
    Spi,
    /// Bridge to another controller.
    Bridge,
    /// Asynchronous 16-bit microcontroller.
    Async16,
    /// Asynchronous 8-bit microcontroller.
    Async8,
    /// Synchronous 16-bit microcontroller.
    Sync16,
    /// Synchronous 8-bit microcontroller.
    Sync8,
    /// On-chip bus.
    OnChipBus,
    /// Another code.
    Other(u8),
}

impl PdiControl {
    /// Bytes of the register.
    pub const LEN: usize = 1;

    /// From the code on the wire.
    pub const fn from_bits(code: u8) -> PdiControl {
        match code {
            0x00 => PdiControl::None,
            0x04 => PdiControl::DigitalIo,
            0x05 => PdiControl::Spi,
            0x07 => PdiControl::Bridge,
            0x08 => PdiControl::Async16,
            0x09 => PdiControl::Async8,
            0x0A => PdiControl::Sync16,
            0x0B => PdiControl::Sync8,
            0x80 => PdiControl::OnChipBus,
            other => PdiControl::Other(other),
        }
    }

    /// The code on the wire.
    pub const fn bits(self) -> u8 {
        match self {
            PdiControl::None => 0x00,
            PdiControl::DigitalIo => 0x04,
            PdiControl::Spi => 0x05,
            PdiControl::Bridge => 0x07,
            PdiControl::Async16 => 0x08,
            PdiControl::Async8 => 0x09,
            PdiControl::Sync16 => 0x0A,
            PdiControl::Sync8 => 0x0B,
            PdiControl::OnChipBus => 0x80,
            PdiControl::Other(code) => code,
        }
    }

    /// From the register's byte.
    pub const fn decode(bytes: &[u8; Self::LEN]) -> PdiControl {
        Self::from_bits(bytes[0])
    }

    /// To the register's byte.
    pub const fn encode(&self) -> [u8; Self::LEN] {
        [self.bits()]
    }
}

impl Field for [bool; 4] {
    fn from_field(raw: u32) -> [bool; 4] {
        [0, 1, 2, 3].map(|bit| raw >> bit & 1 != 0)
    }
    fn to_field(self) -> u32 {
        (0..4).fold(0, |bits, bit| bits | u32::from(self[bit]) << bit)
    }
}

bit_register! {
    /// Register ESC_CONFIGURATION (0x0141).
    EscConfiguration(u8, reset 0) {
        /// AL control is copied to AL status by hardware.
        device_emulation: bool = 0, 1;
        /// Enhanced link detection at all ports.
        enhanced_link_detection: bool = 1, 1;
        /// The SYNC unit exists.
        sync_unit: bool = 2, 1;
        /// The LATCH unit exists.
        latch_unit: bool = 3, 1;
        /// Enhanced link detection at port 0..3.
        enhanced_link_detection_ports: [bool; 4] = 4, 4;
    }
}

bit_register! {
    /// Register PDI_INFORMATION (0x014E).
    PdiInformation(u16, reset 0, reserved kept) {
        /// Events are acknowledged by writing.
        acknowledge_by_write: bool = 0, 1;
        /// The interface is configured.
        configured: bool = 1, 1;
        /// The interface is active.
        active: bool = 2, 1;
        /// The configuration is invalid.
        configuration_invalid: bool = 3, 1;
    }
}

number_register! {
    /// Register PDI_CONFIGURATION (0x0150); its meaning depends on [`PdiControl`].
    PdiConfiguration(u8, reset 0)
}

bit_register! {
    /// Register SYNC_LATCH_CONFIGURATION (0x0151).
    SyncLatchConfiguration(u8, reset 0) {
        /// Driver and polarity of pin 0.
        sync0_driver: u8 = 0, 2;
        /// Pin 0 is SYNC0 (0: LATCH0).
        sync0_output: bool = 2, 1;
        /// SYNC0 raises an AL event.
        sync0_al_event: bool = 3, 1;
        /// Driver and polarity of pin 1.
        sync1_driver: u8 = 4, 2;
        /// Pin 1 is SYNC1 (0: LATCH1).
        sync1_output: bool = 6, 1;
        /// SYNC1 raises an AL event.
        sync1_al_event: bool = 7, 1;
    }
}

number_register! {
    /// Register EXTENDED_PDI_CONFIGURATION (0x0152); its meaning depends on [`PdiControl`].
    ExtendedPdiConfiguration(u16, reset 0)
}
