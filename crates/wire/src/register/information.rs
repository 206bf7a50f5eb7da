//! Type and features of a controller, registers 0x0000..0x0009 (protocol 3.1).

use super::view::Field;

/// Physical layer of a port of the controller.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum PortKind {
    /// The controller has no such port.
    #[default]
    NotImplemented,
    /// Not configured (the SII decides).
    NotConfigured,
    /// EBUS.
    Ebus,
    /// MII, RMII or RGMII.
    Mii,
}

impl PortKind {
    /// From the two bits on the wire; the upper bits are ignored.
    pub const fn from_code(code: u8) -> PortKind {
        match code & 3 {
            0 => PortKind::NotImplemented,
            1 => PortKind::NotConfigured,
            2 => PortKind::Ebus,
            _ => PortKind::Mii,
        }
    }

    /// The two bits on the wire.
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// Whether a cable or neighbour can be connected.
    pub const fn is_usable(self) -> bool {
        matches!(self, PortKind::Ebus | PortKind::Mii)
    }
}

impl Field for [PortKind; 4] {
    fn from_field(raw: u32) -> [PortKind; 4] {
        [0, 2, 4, 6].map(|shift| PortKind::from_code((raw >> shift) as u8))
    }
    fn to_field(self) -> u32 {
        (0..4).fold(0, |bits, port| bits | u32::from(self[port].code()) << (2 * port))
    }
}

bit_register! {
    /// Register PORT_DESCRIPTOR (0x0007).
    PortDescriptor(u8, reset 0) {
        /// Kind of port 0..3.
        ports: [PortKind; 4] = 0, 8;
    }
}

bit_register! {
    /// Register FEATURES (0x0008).
    Features(u16, reset 0, reserved kept) {
        /// FMMUs map whole bytes only (0: bit by bit).
        fmmu_byte_oriented: bool = 0, 1;
        /// Unused register access.
        unused_register_access: bool = 1, 1;
        /// Distributed clocks.
        dc: bool = 2, 1;
        /// Distributed clocks are 64 bits wide (0: 32).
        dc_64bit: bool = 3, 1;
        /// Low-jitter EBUS.
        ebus_low_jitter: bool = 4, 1;
        /// Enhanced link detection at EBUS ports.
        enhanced_link_detection_ebus: bool = 5, 1;
        /// Enhanced link detection at MII ports.
        enhanced_link_detection_mii: bool = 6, 1;
        /// FCS errors are counted separately from other errors.
        separate_fcs_errors: bool = 7, 1;
        /// Enhanced activation of DC SYNC.
        enhanced_dc_sync_activation: bool = 8, 1;
        /// LRW is **not** supported.
        lrw_unsupported: bool = 9, 1;
        /// BRW, APRW and FPRW are **not** supported.
        brw_unsupported: bool = 10, 1;
        /// FMMUs and SyncManagers have a fixed configuration.
        fixed_fmmu_sync_manager: bool = 11, 1;
        /// SyncManagers have the sequential mode.
        sync_manager_sequential: bool = 12, 1;
    }
}

/// Registers 0x0000..0x0009 in one read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Information {
    /// TYPE: 0x11 ET1100, 0x12 ET1200, 0x04 IP core, others by vendor.
    pub controller_type: u8,
    /// REVISION.
    pub revision: u8,
    /// BUILD.
    pub build: u16,
    /// FMMU_COUNT.
    pub fmmu_count: u8,
    /// SYNC_MANAGER_COUNT.
    pub sync_manager_count: u8,
    /// RAM_SIZE.
    pub ram_kib: u8,
    /// PORT_DESCRIPTOR.
    pub port_descriptor: PortDescriptor,
    /// FEATURES.
    pub features: Features,
}

impl Information {
    /// Bytes of the registers.
    pub const LEN: usize = 10;

    /// From the registers' bytes.
    pub fn decode(bytes: &[u8; Self::LEN]) -> Information {
        Information {
            controller_type: bytes[0],
            revision: bytes[1],
            build: u16::from_le_bytes([bytes[2], bytes[3]]),
            fmmu_count: bytes[4],
            sync_manager_count: bytes[5],
            ram_kib: bytes[6],
            port_descriptor: PortDescriptor::from_bits(bytes[7]),
            features: Features::decode(&[bytes[8], bytes[9]]),
        }
    }

    /// To the registers' bytes.
    pub fn encode(&self) -> [u8; Self::LEN] {
        let build = self.build.to_le_bytes();
        let features = self.features.encode();
        [
            self.controller_type,
            self.revision,
            build[0],
            build[1],
            self.fmmu_count,
            self.sync_manager_count,
            self.ram_kib,
            self.port_descriptor.bits(),
            features[0],
            features[1],
        ]
    }
}
