//! The data link layer of a controller: loops, links, forwarding (protocol 2.2, 2.3, 2.6, 3.3).

use super::view::Field;

/// Loop setting of a port (protocol 2.2).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum LoopControl {
    /// Open while there is a link.
    #[default]
    Auto,
    /// Closes when the link is lost, opens again only by a command.
    AutoClose,
    /// Always open; frames are lost while there is no link.
    Open,
    /// Always closed.
    Closed,
}

impl LoopControl {
    /// From the two bits on the wire; the upper bits are ignored.
    pub const fn from_code(code: u8) -> LoopControl {
        match code & 3 {
            0 => LoopControl::Auto,
            1 => LoopControl::AutoClose,
            2 => LoopControl::Open,
            _ => LoopControl::Closed,
        }
    }

    /// The two bits on the wire.
    pub const fn code(self) -> u8 {
        self as u8
    }
}

impl Field for [LoopControl; 4] {
    fn from_field(raw: u32) -> [LoopControl; 4] {
        [0, 2, 4, 6].map(|shift| LoopControl::from_code((raw >> shift) as u8))
    }
    fn to_field(self) -> u32 {
        (0..4).fold(0, |bits, port| bits | u32::from(self[port].code()) << (2 * port))
    }
}

bit_register! {
    /// Register DL_CONTROL (0x0100).
    DlControl(u32, reset 0x0007_0001, reserved kept) {
        /// Destroys frames that are not EtherCAT and marks the source address of EtherCAT frames (protocol 2.6).
        forwarding_rule: bool = 0, 1;
        /// The loop settings apply for about one second.
        temporary: bool = 1, 1;
        /// Loop of port 0..3.
        loops: [LoopControl; 4] = 8, 8;
        /// RX FIFO size, 0..=7.
        rx_fifo: u8 = 16, 3;
        /// Low-jitter EBUS.
        ebus_low_jitter: bool = 19, 1;
        /// EBUS remote link down signalling time.
        ebus_remote_link_down: bool = 22, 1;
        /// The alias is used as a station address.
        alias_enable: bool = 24, 1;
    }
}

number_register! {
    /// Register PHYSICAL_OFFSET (0x0108): offset of physical read/write commands.
    PhysicalOffset(u16, reset 0)
}

/// State of one port in DL_STATUS.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct PortStatus {
    /// Physical link.
    pub link: bool,
    /// The loop is closed.
    pub loop_closed: bool,
    /// Communication established: the link is also good according to enhanced link detection.
    pub communication: bool,
}

impl Field for [PortStatus; 4] {
    /// Bits 15:4 of the register: four link bits, then pairs of loop and communication.
    fn from_field(raw: u32) -> [PortStatus; 4] {
        [0, 1, 2, 3].map(|port| PortStatus {
            link: raw >> port & 1 != 0,
            loop_closed: raw >> (4 + 2 * port) & 1 != 0,
            communication: raw >> (5 + 2 * port) & 1 != 0,
        })
    }
    fn to_field(self) -> u32 {
        (0..4).fold(0, |bits, port| {
            let PortStatus { link, loop_closed, communication } = self[port];
            bits | u32::from(link) << port
                | u32::from(loop_closed) << (4 + 2 * port)
                | u32::from(communication) << (5 + 2 * port)
        })
    }
}

bit_register! {
    /// Register DL_STATUS (0x0110).
    DlStatus(u16, reset 0, reserved kept) {
        /// The PDI is operational: the EEPROM is loaded.
        pdi_operational: bool = 0, 1;
        /// The PDI watchdog has not expired.
        pdi_watchdog_ok: bool = 1, 1;
        /// Enhanced link detection is active on at least one port.
        enhanced_link_detection: bool = 2, 1;
        /// Port 0..3.
        ports: [PortStatus; 4] = 4, 12;
    }
}
