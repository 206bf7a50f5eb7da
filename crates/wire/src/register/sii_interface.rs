//! Access to the EEPROM with the SubDevice information, registers 0x0500..0x050F (protocol 3.8).

use super::view::Field;

/// Command field of SII_CONTROL.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum SiiCommand {
    /// None; clears the error bits.
    #[default]
    Idle,
    /// Read 4 or 8 bytes.
    Read,
    /// Write one word.
    Write,
    /// Load the configuration from the EEPROM again (code 4, not 3).
    Reload,
    /// A reserved code.
    Reserved(u8),
}

impl Field for SiiCommand {
    fn from_field(raw: u32) -> SiiCommand {
        match raw {
            0 => SiiCommand::Idle,
            1 => SiiCommand::Read,
            2 => SiiCommand::Write,
            4 => SiiCommand::Reload,
            other => SiiCommand::Reserved(other as u8),
        }
    }
    fn to_field(self) -> u32 {
        match self {
            SiiCommand::Idle => 0,
            SiiCommand::Read => 1,
            SiiCommand::Write => 2,
            SiiCommand::Reload => 4,
            SiiCommand::Reserved(code) => u32::from(code),
        }
    }
}

bit_register! {
    /// Register SII_CONFIGURATION (0x0500).
    SiiConfiguration(u8, reset 0, reserved kept) {
        /// The EEPROM is offered to the PDI.
        offer_pdi: bool = 0, 1;
        /// Takes the EEPROM back from the PDI.
        force_ecat: bool = 1, 1;
    }
}

bit_register! {
    /// Register SII_PDI_ACCESS (0x0501).
    SiiPdiAccess(u8, reset 0, reserved kept) {
        /// The PDI has the EEPROM.
        pdi_access: bool = 0, 1;
    }
}

bit_register! {
    /// Register SII_CONTROL (0x0502).
    SiiControl(u16, reset 0, reserved kept) {
        /// Allows the write command of the same frame.
        write_enable: bool = 0, 1;
        /// The PDI emulates the EEPROM.
        emulated: bool = 5, 1;
        /// A read yields 8 bytes (0: 4).
        eight_byte_reads: bool = 6, 1;
        /// The EEPROM has two address bytes (0: one).
        two_address_bytes: bool = 7, 1;
        /// Command.
        command: SiiCommand = 8, 3;
        /// The checksum of the configuration area is wrong.
        checksum_error: bool = 11, 1;
        /// The device information has not been loaded.
        device_info_not_loaded: bool = 12, 1;
        /// The EEPROM did not acknowledge, or the command is invalid.
        command_error: bool = 13, 1;
        /// A write without write enable.
        write_enable_error: bool = 14, 1;
        /// A command is being executed.
        busy: bool = 15, 1;
    }
}

impl SiiControl {
    /// The value that a MainDevice writes for a command: write enable is set for a write only.
    pub fn request(command: SiiCommand) -> SiiControl {
        SiiControl { command, write_enable: command == SiiCommand::Write, ..SiiControl::default() }
    }
}

number_register! {
    /// Register SII_ADDRESS (0x0504): word address in the EEPROM.
    SiiAddress(u32, reset 0)
}

number_register! {
    /// Register SII_DATA (0x0508): data of the EEPROM; the upper half is used only by 8-byte reads.
    SiiData(u64, reset 0)
}
