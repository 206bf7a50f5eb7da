//! Access to the PHYs, registers 0x0510..0x051B (protocol 3.9; bits from the data sheet's register description).

use super::view::Field;

/// Command field of MII_CONTROL.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum MiiCommand {
    /// None; clears the error bits.
    #[default]
    Idle,
    /// Read a register of a PHY.
    Read,
    /// Write a register of a PHY.
    Write,
    /// A reserved code.
    Reserved(u8),
}

impl Field for MiiCommand {
    fn from_field(raw: u32) -> MiiCommand {
        match raw {
            0 => MiiCommand::Idle,
            1 => MiiCommand::Read,
            2 => MiiCommand::Write,
            other => MiiCommand::Reserved(other as u8),
        }
    }
    fn to_field(self) -> u32 {
        match self {
            MiiCommand::Idle => 0,
            MiiCommand::Read => 1,
            MiiCommand::Write => 2,
            MiiCommand::Reserved(code) => u32::from(code),
        }
    }
}

bit_register! {
    /// Register MII_CONTROL (0x0510).
    MiiControl(u16, reset 0, reserved kept) {
        /// Allows the write command of the same frame.
        write_enable: bool = 0, 1;
        /// The PDI may take over the interface.
        pdi_control_possible: bool = 1, 1;
        /// Links are detected through the interface.
        link_detection: bool = 2, 1;
        /// Offset of the PHY addresses.
        phy_address_offset: u8 = 3, 5;
        /// Command.
        command: MiiCommand = 8, 2;
        /// The read failed.
        read_error: bool = 13, 1;
        /// The command was invalid, or a write without write enable.
        command_error: bool = 14, 1;
        /// A command is being executed.
        busy: bool = 15, 1;
    }
}

bit_register! {
    /// Register MII_PHY_ADDRESS (0x0512).
    MiiPhyAddress(u8, reset 0, reserved kept) {
        /// Address of the PHY.
        address: u8 = 0, 5;
    }
}

bit_register! {
    /// Register MII_PHY_REGISTER (0x0513).
    MiiPhyRegister(u8, reset 0, reserved kept) {
        /// Register of the PHY.
        register: u8 = 0, 5;
    }
}

number_register! {
    /// Register MII_PHY_DATA (0x0514).
    MiiPhyData(u16, reset 0)
}

bit_register! {
    /// Register MII_ECAT_ACCESS (0x0516).
    MiiEcatAccess(u8, reset 0, reserved kept) {
        /// The PDI may not take over the interface.
        exclusive: bool = 0, 1;
    }
}

bit_register! {
    /// Register MII_PDI_ACCESS (0x0517).
    MiiPdiAccess(u8, reset 0, reserved kept) {
        /// The PDI has the interface.
        pdi_access: bool = 0, 1;
        /// EtherCAT takes the interface back.
        force_reset: bool = 1, 1;
    }
}

bit_register! {
    /// Register MII_PHY_PORT_STATUS (0x0518 + port).
    MiiPhyPortStatus(u8, reset 0, reserved kept) {
        /// The PHY reports a link.
        physical_link: bool = 0, 1;
        /// The link has the right speed and mode.
        link: bool = 1, 1;
        /// Link status error.
        link_error: bool = 2, 1;
        /// The PHY could not be read.
        read_error: bool = 3, 1;
        /// Link partner error.
        link_partner_error: bool = 4, 1;
        /// The configuration of the PHY was updated.
        configuration_updated: bool = 5, 1;
    }
}
