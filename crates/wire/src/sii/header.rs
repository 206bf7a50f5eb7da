//! The fixed area of the SII, words 0x00..0x40 (protocol 4.1). All bytes are kept, including reserved ones.

use super::checksum::{CHECKSUM_DISABLED, checksum};

/// Identity of a SubDevice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Identity {
    /// Vendor id as assigned by ETG.
    pub vendor_id: u32,
    /// Product code of the vendor.
    pub product_code: u32,
    /// Revision number.
    pub revision: u32,
    /// Serial number; 0 if the vendor assigns none.
    pub serial: u32,
}

impl Identity {
    /// Whether it names a type of SubDevices: ETG assigns no vendor id 0, so SubDevices with it have nothing in common.
    pub const fn names_a_type(&self) -> bool {
        self.vendor_id != 0
    }
}

/// Addresses and sizes of the mailboxes of a SubDevice. "Receive" and "send" are from the view of the SubDevice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct MailboxLayout {
    /// Address of the mailbox that the MainDevice writes.
    pub receive_offset: u16,
    /// Bytes of the mailbox that the MainDevice writes.
    pub receive_size: u16,
    /// Address of the mailbox that the MainDevice reads.
    pub send_offset: u16,
    /// Bytes of the mailbox that the MainDevice reads.
    pub send_size: u16,
}

impl MailboxLayout {
    /// Bytes of the layout in the fixed area.
    pub const LEN: usize = 8;

    /// Decodes four words.
    pub const fn decode(b: &[u8; Self::LEN]) -> MailboxLayout {
        MailboxLayout {
            receive_offset: u16::from_le_bytes([b[0], b[1]]),
            receive_size: u16::from_le_bytes([b[2], b[3]]),
            send_offset: u16::from_le_bytes([b[4], b[5]]),
            send_size: u16::from_le_bytes([b[6], b[7]]),
        }
    }

    /// Encodes into four words.
    pub fn encode(&self) -> [u8; Self::LEN] {
        let mut out = [0; Self::LEN];
        for (to, word) in
            out.chunks_exact_mut(2).zip([self.receive_offset, self.receive_size, self.send_offset, self.send_size])
        {
            to.copy_from_slice(&word.to_le_bytes());
        }
        out
    }
}

/// Mailbox protocols of a SubDevice (word 0x1C).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct MailboxProtocols(pub u16);

impl MailboxProtocols {
    /// Bit of AoE.
    pub const AOE: u16 = 1 << 0;
    /// Bit of EoE.
    pub const EOE: u16 = 1 << 1;
    /// Bit of CoE.
    pub const COE: u16 = 1 << 2;
    /// Bit of FoE.
    pub const FOE: u16 = 1 << 3;
    /// Bit of SoE.
    pub const SOE: u16 = 1 << 4;
    /// Bit of VoE.
    pub const VOE: u16 = 1 << 5;

    /// ADS over EtherCAT.
    pub const fn aoe(self) -> bool {
        self.0 & Self::AOE != 0
    }

    /// Ethernet over EtherCAT.
    pub const fn eoe(self) -> bool {
        self.0 & Self::EOE != 0
    }

    /// CAN application protocol over EtherCAT.
    pub const fn coe(self) -> bool {
        self.0 & Self::COE != 0
    }

    /// File access over EtherCAT.
    pub const fn foe(self) -> bool {
        self.0 & Self::FOE != 0
    }

    /// Servo drive profile over EtherCAT.
    pub const fn soe(self) -> bool {
        self.0 & Self::SOE != 0
    }

    /// Vendor protocol over EtherCAT.
    pub const fn voe(self) -> bool {
        self.0 & Self::VOE != 0
    }
}

/// The first 64 words of the SII.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct SiiHeader {
    /// Word 0x00, loaded into registers 0x0140:0x0141.
    pub pdi_control: u16,
    /// Word 0x01, loaded into registers 0x0150:0x0151.
    pub pdi_configuration: u16,
    /// Word 0x02, length of the SYNC pulses in units of 10 ns, loaded into register 0x0982.
    pub sync_pulse_length: u16,
    /// Word 0x03, loaded into registers 0x0152:0x0153.
    pub extended_pdi_configuration: u16,
    /// Word 0x04, station alias, loaded into register 0x0012.
    pub alias: u16,
    /// Words 0x05 and 0x06: reserved, or further configuration of the controller.
    pub reserved_05: [u16; 2],
    /// Word 0x07, unchanged; the checksum is its low byte.
    pub checksum: u16,
    /// Words 0x08..0x10.
    pub identity: Identity,
    /// Words 0x10..0x13: execution delay, delay of port 0, delay of port 1, in nanoseconds.
    pub delays: [u16; 3],
    /// Word 0x13.
    pub reserved_13: u16,
    /// Words 0x14..0x18: mailboxes in the state BOOT.
    pub bootstrap_mailbox: MailboxLayout,
    /// Words 0x18..0x1C: mailboxes in PREOP, SAFEOP and OP.
    pub standard_mailbox: MailboxLayout,
    /// Word 0x1C.
    pub protocols: MailboxProtocols,
    /// Words 0x1D..0x3E.
    pub reserved_1d: [u16; 33],
    /// Word 0x3E: size of the EEPROM in KBit, minus one.
    pub size_kbit_minus_1: u16,
    /// Word 0x3F: 1.
    pub version: u16,
}

impl Default for SiiHeader {
    /// All zero, except 2 KByte (16 KBit) and version 1. The checksum is not valid yet.
    fn default() -> SiiHeader {
        let zero = SiiHeader::decode(&[0; SiiHeader::LEN]);
        SiiHeader { size_kbit_minus_1: 15, version: 1, ..zero }
    }
}

impl SiiHeader {
    /// Bytes of the fixed area.
    pub const LEN: usize = 128;
    /// Bytes of the largest EEPROM that word 0x3E can express: 8 MiB.
    pub const MAX_EEPROM_BYTES: usize = (u16::MAX as usize + 1) * 128;

    /// Decodes the fixed area; every pattern is valid.
    pub fn decode(bytes: &[u8; Self::LEN]) -> SiiHeader {
        let word = |at: usize| u16::from_le_bytes([bytes[2 * at], bytes[2 * at + 1]]);
        let double = |at: usize| u32::from(word(at)) | u32::from(word(at + 1)) << 16;
        let mailbox = |at: usize| MailboxLayout::decode(&core::array::from_fn(|n| bytes[2 * at + n]));
        SiiHeader {
            pdi_control: word(0x00),
            pdi_configuration: word(0x01),
            sync_pulse_length: word(0x02),
            extended_pdi_configuration: word(0x03),
            alias: word(0x04),
            reserved_05: [word(0x05), word(0x06)],
            checksum: word(0x07),
            identity: Identity {
                vendor_id: double(0x08),
                product_code: double(0x0A),
                revision: double(0x0C),
                serial: double(0x0E),
            },
            delays: [word(0x10), word(0x11), word(0x12)],
            reserved_13: word(0x13),
            bootstrap_mailbox: mailbox(0x14),
            standard_mailbox: mailbox(0x18),
            protocols: MailboxProtocols(word(0x1C)),
            reserved_1d: core::array::from_fn(|n| word(0x1D + n)),
            size_kbit_minus_1: word(0x3E),
            version: word(0x3F),
        }
    }

    /// Encodes the fixed area with the checksum of the field ([`SiiHeader::with_checksum`] computes it).
    pub fn encode(&self) -> [u8; Self::LEN] {
        let mut out = [0; Self::LEN];
        let mut put = |at: usize, word: u16| out[2 * at..2 * at + 2].copy_from_slice(&word.to_le_bytes());
        put(0x00, self.pdi_control);
        put(0x01, self.pdi_configuration);
        put(0x02, self.sync_pulse_length);
        put(0x03, self.extended_pdi_configuration);
        put(0x04, self.alias);
        put(0x05, self.reserved_05[0]);
        put(0x06, self.reserved_05[1]);
        put(0x07, self.checksum);
        let Identity { vendor_id, product_code, revision, serial } = self.identity;
        for (n, double) in [vendor_id, product_code, revision, serial].into_iter().enumerate() {
            put(0x08 + 2 * n, double as u16);
            put(0x09 + 2 * n, (double >> 16) as u16);
        }
        for (n, delay) in self.delays.into_iter().enumerate() {
            put(0x10 + n, delay);
        }
        put(0x13, self.reserved_13);
        put(0x1C, self.protocols.0);
        for (n, word) in self.reserved_1d.into_iter().enumerate() {
            put(0x1D + n, word);
        }
        put(0x3E, self.size_kbit_minus_1);
        put(0x3F, self.version);
        out[0x28..0x30].copy_from_slice(&self.bootstrap_mailbox.encode());
        out[0x30..0x38].copy_from_slice(&self.standard_mailbox.encode());
        out
    }

    /// The checksum of the first seven words.
    pub fn computed_checksum(&self) -> u8 {
        let bytes = self.encode();
        checksum(&core::array::from_fn(|n| bytes[n]))
    }

    /// The same header with its computed checksum.
    #[must_use]
    pub fn with_checksum(self) -> SiiHeader {
        SiiHeader { checksum: u16::from(self.computed_checksum()), ..self }
    }

    /// Whether a controller accepts this area: the low byte of word 7 is valid, or the check is disabled.
    pub fn checksum_ok(&self) -> bool {
        self.checksum == CHECKSUM_DISABLED || self.checksum & 0xFF == u16::from(self.computed_checksum())
    }

    /// Size of the EEPROM in bytes.
    pub const fn size_bytes(&self) -> usize {
        (self.size_kbit_minus_1 as usize + 1) * 128
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A device with CoE and FoE, its mailboxes at 0x1000 and 0x1080, the checksum of protocol 4.1 (80 06 81 06: CD).
    fn literal() -> [u8; SiiHeader::LEN] {
        let mut bytes = [0; SiiHeader::LEN];
        let start: [u8; 58] = [
            0x80, 0x06, 0x81, 0x06, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xCD, 0, // words 0x00..0x08
            0x02, 0, 0, 0, 0x52, 0x2C, 0x4C, 0x04, 0x00, 0x00, 0x12, 0x00, 0x78, 0x56, 0x34, 0x12, // ..0x10
            0x10, 0x00, 0x20, 0x00, 0x30, 0x00, 0, 0, 0x00, 0x10, 0xF4, 0x00, 0x00, 0x14, 0xF6, 0x00, // ..0x18
            0x00, 0x10, 0x80, 0x00, 0x80, 0x10, 0x40, 0x00, 0x0C, 0x00, // ..0x1D
        ];
        bytes[..58].copy_from_slice(&start);
        bytes[124..].copy_from_slice(&[0x0F, 0x00, 0x01, 0x00]);
        bytes
    }

    // covers: 4.1, codec-sii
    #[test]
    fn every_field_of_the_fixed_area_is_at_its_offset() {
        let header = SiiHeader::decode(&literal());
        let expected = SiiHeader {
            pdi_control: 0x0680,
            pdi_configuration: 0x0681,
            checksum: 0x00CD,
            identity: Identity { vendor_id: 2, product_code: 0x044C_2C52, revision: 0x0012_0000, serial: 0x1234_5678 },
            delays: [0x10, 0x20, 0x30],
            bootstrap_mailbox: MailboxLayout {
                receive_offset: 0x1000,
                receive_size: 244,
                send_offset: 0x1400,
                send_size: 246,
            },
            standard_mailbox: MailboxLayout {
                receive_offset: 0x1000,
                receive_size: 128,
                send_offset: 0x1080,
                send_size: 64,
            },
            protocols: MailboxProtocols(0x000C),
            ..SiiHeader::default()
        };
        assert_eq!(header, expected);
        assert_eq!(header.encode(), literal());
        assert!(header.checksum_ok());
        assert_eq!(header.size_bytes(), 2048);
    }

    #[test]
    fn each_protocol_has_its_bit() {
        let all = |p: MailboxProtocols| [p.aoe(), p.eoe(), p.coe(), p.foe(), p.soe(), p.voe()];
        for bit in 0..6 {
            let mut expected = [false; 6];
            expected[bit] = true;
            assert_eq!(all(MailboxProtocols(1 << bit)), expected);
        }
    }

    #[test]
    fn word_7_disables_the_check_with_88a4_and_its_high_byte_is_not_compared() {
        let header = SiiHeader::decode(&literal());
        assert!(!SiiHeader { checksum: 0x00CC, ..header }.checksum_ok());
        assert!(SiiHeader { checksum: 0x88A4, ..header }.checksum_ok());
        assert!(SiiHeader { checksum: 0x12CD, ..header }.checksum_ok());
        assert!(SiiHeader { alias: 7, ..header }.with_checksum().checksum_ok());
    }

    proptest! {
        // covers: codec-sii
        #[test]
        fn any_fixed_area_round_trips(bytes in proptest::collection::vec(any::<u8>(), SiiHeader::LEN)) {
            let bytes: [u8; SiiHeader::LEN] = bytes.try_into().unwrap();
            prop_assert_eq!(SiiHeader::decode(&bytes).encode(), bytes);
        }

        #[test]
        fn any_mailbox_layout_round_trips(bytes in any::<[u8; MailboxLayout::LEN]>()) {
            prop_assert_eq!(MailboxLayout::decode(&bytes).encode(), bytes);
        }
    }
}
