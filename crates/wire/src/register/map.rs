//! Addresses of all registers of a SubDevice controller, with the data sheet's names (protocol 3).
//!
//! Sizes, access rights and reset values are in [`super::table()`]; typed views in [`super`].

use crate::address::RegisterAddress;

macro_rules! registers {
    ($($(#[$doc:meta])* $name:ident = $address:literal;)*) => {
        $($(#[$doc])* pub const $name: RegisterAddress = RegisterAddress($address);)*

        /// Every address of this map, in the order it is declared.
        #[cfg(test)]
        pub(super) const ALL: &[(&str, RegisterAddress)] = &[$((stringify!($name), $name)),*];
    };
}

registers! {
    /// Type of controller.
    TYPE = 0x0000;
    /// Revision of the controller.
    REVISION = 0x0001;
    /// Build of the controller.
    BUILD = 0x0002;
    /// Number of FMMUs.
    FMMU_COUNT = 0x0004;
    /// Number of SyncManagers.
    SYNC_MANAGER_COUNT = 0x0005;
    /// Process data RAM in KiB.
    RAM_SIZE = 0x0006;
    /// Kind of each port.
    PORT_DESCRIPTOR = 0x0007;
    /// Features of the controller.
    FEATURES = 0x0008;

    /// Configured station address.
    STATION_ADDRESS = 0x0010;
    /// Configured station alias.
    STATION_ALIAS = 0x0012;
    /// Opens the protected registers for the frame it is written in.
    REGISTER_WRITE_ENABLE = 0x0020;
    /// Protects the registers 0x0000..0x0F7F.
    REGISTER_WRITE_PROTECTION = 0x0021;
    /// Opens the protected controller for the frame it is written in.
    ESC_WRITE_ENABLE = 0x0030;
    /// Protects the whole memory.
    ESC_WRITE_PROTECTION = 0x0031;
    /// Reset sequence, EtherCAT side.
    ESC_RESET_ECAT = 0x0040;
    /// Reset sequence, PDI side.
    ESC_RESET_PDI = 0x0041;

    /// Forwarding rule, loops, alias enable.
    DL_CONTROL = 0x0100;
    /// Offset of physical read/write commands.
    PHYSICAL_OFFSET = 0x0108;
    /// Links, loops, PDI state.
    DL_STATUS = 0x0110;

    /// State requested by the MainDevice.
    AL_CONTROL = 0x0120;
    /// State of the SubDevice.
    AL_STATUS = 0x0130;
    /// Why a request was refused or a state left.
    AL_STATUS_CODE = 0x0134;
    /// Override of the RUN LED.
    RUN_LED = 0x0138;
    /// Override of the ERR LED.
    ERR_LED = 0x0139;

    /// Type of process data interface.
    PDI_CONTROL = 0x0140;
    /// Device emulation, enhanced link detection, SYNC and LATCH units.
    ESC_CONFIGURATION = 0x0141;
    /// Information on the process data interface.
    PDI_INFORMATION = 0x014E;
    /// Configuration of the process data interface.
    PDI_CONFIGURATION = 0x0150;
    /// Configuration of the SYNC and LATCH pins.
    SYNC_LATCH_CONFIGURATION = 0x0151;
    /// Extended configuration of the process data interface.
    EXTENDED_PDI_CONFIGURATION = 0x0152;
    /// Which ECAT events go into the datagrams.
    ECAT_EVENT_MASK = 0x0200;
    /// Which AL events raise the PDI interrupt.
    AL_EVENT_MASK = 0x0204;
    /// ECAT event request.
    ECAT_EVENT = 0x0210;
    /// AL event request.
    AL_EVENT = 0x0220;

    /// Invalid frames and RX errors, two bytes per port.
    RX_ERROR_COUNTER = 0x0300;
    /// Forwarded errors, one byte per port.
    FORWARDED_RX_ERROR_COUNTER = 0x0308;
    /// Errors of the EtherCAT processing unit.
    EPU_ERROR_COUNTER = 0x030C;
    /// Errors of the process data interface.
    PDI_ERROR_COUNTER = 0x030D;
    /// Kind of the last PDI error.
    PDI_ERROR_CODE = 0x030E;
    /// Lost links, one byte per port.
    LOST_LINK_COUNTER = 0x0310;

    /// Divider of the watchdog clock.
    WATCHDOG_DIVIDER = 0x0400;
    /// PDI watchdog time in units.
    WATCHDOG_TIME_PDI = 0x0410;
    /// Process data watchdog time in units.
    WATCHDOG_TIME_PROCESS_DATA = 0x0420;
    /// State of the process data watchdog.
    WATCHDOG_STATUS = 0x0440;
    /// Expirations of the process data watchdog.
    WATCHDOG_COUNTER_PROCESS_DATA = 0x0442;
    /// Expirations of the PDI watchdog.
    WATCHDOG_COUNTER_PDI = 0x0443;

    /// Owner of the EEPROM interface.
    SII_CONFIGURATION = 0x0500;
    /// Whether the PDI uses the EEPROM.
    SII_PDI_ACCESS = 0x0501;
    /// Command and state of the EEPROM interface.
    SII_CONTROL = 0x0502;
    /// Word address in the EEPROM.
    SII_ADDRESS = 0x0504;
    /// Data from or for the EEPROM.
    SII_DATA = 0x0508;

    /// Command and state of the MII management.
    MII_CONTROL = 0x0510;
    /// Address of the PHY.
    MII_PHY_ADDRESS = 0x0512;
    /// Register of the PHY.
    MII_PHY_REGISTER = 0x0513;
    /// Data from or for the PHY.
    MII_PHY_DATA = 0x0514;
    /// Access of the EtherCAT side to the MII management.
    MII_ECAT_ACCESS = 0x0516;
    /// Access of the PDI side to the MII management.
    MII_PDI_ACCESS = 0x0517;
    /// State of the PHY of each port, one byte per port.
    MII_PHY_PORT_STATUS = 0x0518;

    /// FMMU 0; see [`fmmu`].
    FMMU_BASE = 0x0600;
    /// SyncManager 0; see [`sync_manager`].
    SYNC_MANAGER_BASE = 0x0800;

    /// Receive times of the ports, four bytes per port; see [`dc_receive_time`].
    DC_RECEIVE_TIME = 0x0900;
    /// System time.
    DC_SYSTEM_TIME = 0x0910;
    /// Receive time at the processing unit.
    DC_RECEIVE_TIME_EPU = 0x0918;
    /// Offset from local to system time.
    DC_SYSTEM_TIME_OFFSET = 0x0920;
    /// Delay from the reference clock.
    DC_SYSTEM_TIME_DELAY = 0x0928;
    /// Mean difference between local copy and received system time.
    DC_SYSTEM_TIME_DIFFERENCE = 0x092C;
    /// Bandwidth of the control loop; a write resets the filters.
    DC_SPEED_COUNTER_START = 0x0930;
    /// Deviation of the local clock's speed.
    DC_SPEED_COUNTER_DIFFERENCE = 0x0932;
    /// Filter depth of the time difference.
    DC_FILTER_DIFFERENCE = 0x0934;
    /// Filter depth of the speed counter.
    DC_FILTER_SPEED = 0x0935;
    /// Direction of travel in which frames latch the receive times.
    DC_LATCH_MODE = 0x0936;
    /// Which side controls SYNC and LATCH units.
    DC_CYCLIC_UNIT_CONTROL = 0x0980;
    /// Activation of the SYNC units.
    DC_ACTIVATION = 0x0981;
    /// Length of the SYNC pulses.
    DC_PULSE_LENGTH = 0x0982;
    /// State of the SYNC units' activation.
    DC_ACTIVATION_STATUS = 0x0984;
    /// State of SYNC0 in acknowledge mode.
    DC_SYNC0_STATUS = 0x098E;
    /// State of SYNC1 in acknowledge mode.
    DC_SYNC1_STATUS = 0x098F;
    /// Start time of cyclic operation; reads the next SYNC0 pulse.
    DC_START_TIME = 0x0990;
    /// Next SYNC1 pulse.
    DC_NEXT_SYNC1 = 0x0998;
    /// Cycle time of SYNC0.
    DC_SYNC0_CYCLE = 0x09A0;
    /// Time from SYNC0 to SYNC1.
    DC_SYNC1_CYCLE = 0x09A4;
    /// Edges of latch 0.
    DC_LATCH0_CONTROL = 0x09A8;
    /// Edges of latch 1.
    DC_LATCH1_CONTROL = 0x09A9;
    /// Events and pin of latch 0.
    DC_LATCH0_STATUS = 0x09AE;
    /// Events and pin of latch 1.
    DC_LATCH1_STATUS = 0x09AF;
    /// Time of the positive edge of latch 0.
    DC_LATCH0_POSITIVE_EDGE = 0x09B0;
    /// Time of the negative edge of latch 0.
    DC_LATCH0_NEGATIVE_EDGE = 0x09B8;
    /// Time of the positive edge of latch 1.
    DC_LATCH1_POSITIVE_EDGE = 0x09C0;
    /// Time of the negative edge of latch 1.
    DC_LATCH1_NEGATIVE_EDGE = 0x09C8;
    /// Time of a SyncManager buffer change by EtherCAT.
    DC_ECAT_BUFFER_CHANGE = 0x09F0;
    /// Time at which the PDI began a SyncManager buffer.
    DC_PDI_BUFFER_START = 0x09F8;
    /// Time of a SyncManager buffer change by the PDI.
    DC_PDI_BUFFER_CHANGE = 0x09FC;

    /// Product id and power-on values.
    PRODUCT_ID = 0x0E00;
    /// Digital outputs.
    DIGITAL_OUTPUTS = 0x0F00;
    /// General purpose outputs.
    GPO = 0x0F10;
    /// General purpose inputs.
    GPI = 0x0F18;
    /// User RAM, 128 bytes.
    USER_RAM = 0x0F80;
    /// Process data RAM, up to the end of the address space.
    PROCESS_RAM = 0x1000;
}

/// Address of FMMU `n`.
pub const fn fmmu(n: u8) -> RegisterAddress {
    FMMU_BASE.offset(16 * n as u16)
}

/// Address of SyncManager `n`.
pub const fn sync_manager(n: u8) -> RegisterAddress {
    SYNC_MANAGER_BASE.offset(8 * n as u16)
}

/// Address of the receive time of port `port` (0..=3).
pub const fn dc_receive_time(port: u8) -> RegisterAddress {
    DC_RECEIVE_TIME.offset(4 * port as u16)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn repeated_registers_are_a_stride_apart() {
        assert_eq!(fmmu(3), RegisterAddress(0x0630));
        assert_eq!(sync_manager(15), RegisterAddress(0x0878));
        assert_eq!(dc_receive_time(3), RegisterAddress(0x090C));
    }
}
