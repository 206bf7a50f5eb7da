//! Category GENERAL: names, mailbox details, ports (protocol 4.3).

/// CoE features of a SubDevice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct CoeDetails(pub u8);

impl CoeDetails {
    /// Bit: SDO services.
    pub const SDO: u8 = 1 << 0;
    /// Bit: SDO information services.
    pub const SDO_INFORMATION: u8 = 1 << 1;
    /// Bit: PDO assignment can be changed.
    pub const PDO_ASSIGN: u8 = 1 << 2;
    /// Bit: PDO mapping can be changed.
    pub const PDO_CONFIGURATION: u8 = 1 << 3;
    /// Bit: PDO description is to be uploaded at start-up.
    pub const UPLOAD_AT_STARTUP: u8 = 1 << 4;
    /// Bit: SDO complete access.
    pub const COMPLETE_ACCESS: u8 = 1 << 5;

    /// SDO services.
    pub const fn sdo(self) -> bool {
        self.0 & Self::SDO != 0
    }

    /// SDO information services.
    pub const fn sdo_information(self) -> bool {
        self.0 & Self::SDO_INFORMATION != 0
    }

    /// The PDO assignment can be changed.
    pub const fn pdo_assign(self) -> bool {
        self.0 & Self::PDO_ASSIGN != 0
    }

    /// The PDO mapping can be changed.
    pub const fn pdo_configuration(self) -> bool {
        self.0 & Self::PDO_CONFIGURATION != 0
    }

    /// The PDO description is to be uploaded at start-up.
    pub const fn upload_at_startup(self) -> bool {
        self.0 & Self::UPLOAD_AT_STARTUP != 0
    }

    /// SDO complete access.
    pub const fn complete_access(self) -> bool {
        self.0 & Self::COMPLETE_ACCESS != 0
    }
}

/// Flags of the general category (byte 0x0B).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct GeneralFlags(pub u8);

impl GeneralFlags {
    /// Bit: SAFEOP is to be enabled.
    pub const ENABLE_SAFEOP: u8 = 1 << 0;
    /// Bit: LRW is not supported.
    pub const NOT_LRW: u8 = 1 << 1;
    /// Bit: the mailbox data link layer is supported.
    pub const MAILBOX_DATA_LINK_LAYER: u8 = 1 << 2;
    /// Bit: identification through the AL status code.
    pub const IDENTIFICATION_AL_STATUS_CODE: u8 = 1 << 3;
    /// Bit: identification through a memory address.
    pub const IDENTIFICATION_MEMORY: u8 = 1 << 4;

    /// SAFEOP is to be enabled.
    pub const fn enable_safeop(self) -> bool {
        self.0 & Self::ENABLE_SAFEOP != 0
    }

    /// LRW is not supported.
    pub const fn not_lrw(self) -> bool {
        self.0 & Self::NOT_LRW != 0
    }

    /// The mailbox data link layer (repeat of lost reads) is supported.
    pub const fn mailbox_data_link_layer(self) -> bool {
        self.0 & Self::MAILBOX_DATA_LINK_LAYER != 0
    }

    /// The SubDevice can be identified through the AL status code.
    pub const fn identification_al_status_code(self) -> bool {
        self.0 & Self::IDENTIFICATION_AL_STATUS_CODE != 0
    }

    /// The SubDevice can be identified through [`General::id_switch_address`].
    pub const fn identification_memory(self) -> bool {
        self.0 & Self::IDENTIFICATION_MEMORY != 0
    }
}

/// Physical layer of a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PhysicalPort {
    /// 0: not used.
    Unused,
    /// 1: MII.
    Mii,
    /// 3: EBUS.
    Ebus,
    /// 4: MII with fast hot connect.
    FastHotConnect,
    /// Any other code; 2 is reserved.
    Other(u8),
}

impl PhysicalPort {
    /// From a nibble.
    pub const fn from_code(code: u8) -> PhysicalPort {
        match code {
            0 => PhysicalPort::Unused,
            1 => PhysicalPort::Mii,
            3 => PhysicalPort::Ebus,
            4 => PhysicalPort::FastHotConnect,
            code => PhysicalPort::Other(code),
        }
    }

    /// The nibble.
    pub const fn code(self) -> u8 {
        match self {
            PhysicalPort::Unused => 0,
            PhysicalPort::Mii => 1,
            PhysicalPort::Ebus => 3,
            PhysicalPort::FastHotConnect => 4,
            PhysicalPort::Other(code) => code & 0x0F,
        }
    }
}

/// The general category. Indices refer to [`super::Strings`], 0 for none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct General {
    /// String index of the group.
    pub group: u8,
    /// String index of the image.
    pub image: u8,
    /// String index of the order code.
    pub order: u8,
    /// String index of the name.
    pub name: u8,
    /// Byte 0x04: reserved, in old images the physical layer of the ports.
    pub reserved_04: u8,
    /// CoE features.
    pub coe: CoeDetails,
    /// Byte 0x06; bit 0: FoE.
    pub foe: u8,
    /// Byte 0x07; bit 0: EoE.
    pub eoe: u8,
    /// Number of SoE channels.
    pub soe_channels: u8,
    /// Number of DS402 channels.
    pub ds402_channels: u8,
    /// Byte 0x0A, reserved today.
    pub sysman_class: u8,
    /// Flags.
    pub flags: GeneralFlags,
    /// Current consumption from the EBUS in milliamperes; negative if the SubDevice supplies current.
    pub ebus_current_ma: i16,
    /// Byte 0x0E: the group index again.
    pub group_again: u8,
    /// Byte 0x0F.
    pub reserved_0f: u8,
    /// A nibble per port, port 0 lowest; see [`General::ports`].
    pub physical_ports: u16,
    /// Physical address of the ID switch.
    pub id_switch_address: u16,
    /// Bytes 0x14..0x20.
    pub reserved_14: [u8; 12],
}

impl General {
    /// Bytes of the category.
    pub const LEN: usize = 32;

    /// Decodes the data of a category; `None` if it has less than [`General::LEN`] bytes.
    pub fn decode(data: &[u8]) -> Option<General> {
        let b: &[u8; Self::LEN] = data.first_chunk()?;
        let mut reserved_14 = [0; 12];
        reserved_14.copy_from_slice(&b[0x14..]);
        Some(General {
            group: b[0x00],
            image: b[0x01],
            order: b[0x02],
            name: b[0x03],
            reserved_04: b[0x04],
            coe: CoeDetails(b[0x05]),
            foe: b[0x06],
            eoe: b[0x07],
            soe_channels: b[0x08],
            ds402_channels: b[0x09],
            sysman_class: b[0x0A],
            flags: GeneralFlags(b[0x0B]),
            ebus_current_ma: i16::from_le_bytes([b[0x0C], b[0x0D]]),
            group_again: b[0x0E],
            reserved_0f: b[0x0F],
            physical_ports: u16::from_le_bytes([b[0x10], b[0x11]]),
            id_switch_address: u16::from_le_bytes([b[0x12], b[0x13]]),
            reserved_14,
        })
    }

    /// Encodes the data of the category.
    pub fn encode(&self) -> [u8; Self::LEN] {
        let mut out = [0; Self::LEN];
        out[..0x0C].copy_from_slice(&[
            self.group,
            self.image,
            self.order,
            self.name,
            self.reserved_04,
            self.coe.0,
            self.foe,
            self.eoe,
            self.soe_channels,
            self.ds402_channels,
            self.sysman_class,
            self.flags.0,
        ]);
        out[0x0C..0x0E].copy_from_slice(&self.ebus_current_ma.to_le_bytes());
        out[0x0E] = self.group_again;
        out[0x0F] = self.reserved_0f;
        out[0x10..0x12].copy_from_slice(&self.physical_ports.to_le_bytes());
        out[0x12..0x14].copy_from_slice(&self.id_switch_address.to_le_bytes());
        out[0x14..].copy_from_slice(&self.reserved_14);
        out
    }

    /// The physical layers of the four ports, port 0 first.
    pub const fn ports(&self) -> [PhysicalPort; 4] {
        let p = self.physical_ports;
        [
            PhysicalPort::from_code(p as u8 & 0x0F),
            PhysicalPort::from_code((p >> 4) as u8 & 0x0F),
            PhysicalPort::from_code((p >> 8) as u8 & 0x0F),
            PhysicalPort::from_code((p >> 12) as u8),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    // covers: 4.3, codec-sii
    #[test]
    fn every_field_of_general_is_at_its_offset() {
        let bytes = [
            0x02, 0x03, 0x01, 0x04, 0x00, 0x2F, 0x01, 0x01, 0x00, 0x02, 0x00, 0x1A, // up to the flags
            0x18, 0xFC, 0x02, 0x00, 0x31, 0x00, 0x80, 0x0F, // current, group, ports, ID switch
            0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,
        ];
        let general = General::decode(&bytes).unwrap();
        let expected = General {
            group: 2,
            image: 3,
            order: 1,
            name: 4,
            coe: CoeDetails(0x2F),
            foe: 1,
            eoe: 1,
            ds402_channels: 2,
            flags: GeneralFlags(0x1A),
            ebus_current_ma: -1000,
            group_again: 2,
            physical_ports: 0x0031,
            id_switch_address: 0x0F80,
            ..General::default()
        };
        assert_eq!(general, expected);
        assert_eq!(general.encode(), bytes);
        assert_eq!(
            general.ports(),
            [PhysicalPort::Mii, PhysicalPort::Ebus, PhysicalPort::Unused, PhysicalPort::Unused]
        );
        let coe = general.coe;
        assert!(coe.sdo() && coe.sdo_information() && coe.pdo_assign() && coe.pdo_configuration());
        assert!(!coe.upload_at_startup() && coe.complete_access());
        let flags = general.flags;
        assert!(!flags.enable_safeop() && flags.not_lrw() && !flags.mailbox_data_link_layer());
        assert!(flags.identification_al_status_code() && flags.identification_memory());
    }

    #[test]
    fn a_category_of_less_than_32_bytes_is_none() {
        assert_eq!(General::decode(&[0; 31]), None);
        assert_eq!(General::decode(&[0; 34]), Some(General::default()));
    }

    #[test]
    fn every_port_nibble_round_trips() {
        for code in 0..16 {
            assert_eq!(PhysicalPort::from_code(code).code(), code);
        }
    }

    proptest! {
        #[test]
        fn any_32_bytes_round_trip(bytes in any::<[u8; General::LEN]>()) {
            prop_assert_eq!(General::decode(&bytes).unwrap().encode(), bytes);
        }
    }
}
