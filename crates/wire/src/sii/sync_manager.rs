//! Category SYNCM: eight bytes per SyncManager (protocol 4.4).

/// Type of a SyncManager.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum SyncManagerKind {
    /// 0: unused, or not stated.
    #[default]
    Unused,
    /// 1: mailbox from MainDevice to SubDevice.
    MailboxOut,
    /// 2: mailbox from SubDevice to MainDevice.
    MailboxIn,
    /// 3: process data from MainDevice to SubDevice.
    Outputs,
    /// 4: process data from SubDevice to MainDevice.
    Inputs,
    /// Any other code.
    Other(u8),
}

impl SyncManagerKind {
    /// From the type byte.
    pub const fn from_code(code: u8) -> SyncManagerKind {
        match code {
            0 => SyncManagerKind::Unused,
            1 => SyncManagerKind::MailboxOut,
            2 => SyncManagerKind::MailboxIn,
            3 => SyncManagerKind::Outputs,
            4 => SyncManagerKind::Inputs,
            code => SyncManagerKind::Other(code),
        }
    }

    /// The type byte.
    pub const fn code(self) -> u8 {
        match self {
            SyncManagerKind::Unused => 0,
            SyncManagerKind::MailboxOut => 1,
            SyncManagerKind::MailboxIn => 2,
            SyncManagerKind::Outputs => 3,
            SyncManagerKind::Inputs => 4,
            SyncManagerKind::Other(code) => code,
        }
    }
}

/// Settings of a SyncManager.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct SiiSyncManager {
    /// Physical start address.
    pub start: u16,
    /// Default length in bytes.
    pub length: u16,
    /// Control byte of register 0x0804.
    pub control: u8,
    /// Status byte, not used.
    pub status: u8,
    /// Enable byte; see the constants.
    pub enable: u8,
    /// Type.
    pub kind: SyncManagerKind,
}

impl SiiSyncManager {
    /// Bytes of one entry.
    pub const LEN: usize = 8;
    /// Bit of [`SiiSyncManager::enable`]: activate the SyncManager.
    pub const ENABLE: u8 = 1 << 0;
    /// Bit of [`SiiSyncManager::enable`]: the content is fixed.
    pub const FIXED_CONTENT: u8 = 1 << 1;
    /// Bit of [`SiiSyncManager::enable`]: virtual, without hardware.
    pub const VIRTUAL: u8 = 1 << 2;
    /// Bit of [`SiiSyncManager::enable`]: activate the SyncManager in OP only.
    pub const OP_ONLY: u8 = 1 << 3;

    /// Decodes one entry; every pattern is valid.
    pub const fn decode(b: &[u8; Self::LEN]) -> SiiSyncManager {
        SiiSyncManager {
            start: u16::from_le_bytes([b[0], b[1]]),
            length: u16::from_le_bytes([b[2], b[3]]),
            control: b[4],
            status: b[5],
            enable: b[6],
            kind: SyncManagerKind::from_code(b[7]),
        }
    }

    /// Encodes one entry.
    pub const fn encode(&self) -> [u8; Self::LEN] {
        let start = self.start.to_le_bytes();
        let length = self.length.to_le_bytes();
        [start[0], start[1], length[0], length[1], self.control, self.status, self.enable, self.kind.code()]
    }

    /// Whether the SyncManager has to be activated.
    pub const fn is_enabled(&self) -> bool {
        self.enable & Self::ENABLE != 0
    }

    /// The type derived from the control byte alone: a mailbox or process data, by its direction (protocol 3.11). Some
    /// images contain no type. [`SyncManagerKind::Unused`] if mode or direction are reserved.
    pub const fn kind_of_control(&self) -> SyncManagerKind {
        match (self.control & 0x03, self.control & 0x0C) {
            (0b10, 0x04) => SyncManagerKind::MailboxOut,
            (0b10, 0x00) => SyncManagerKind::MailboxIn,
            (0b00, 0x04) => SyncManagerKind::Outputs,
            (0b00, 0x00) => SyncManagerKind::Inputs,
            _ => SyncManagerKind::Unused,
        }
    }

    /// Whether its bytes are those of an erased EEPROM.
    pub fn is_erased(&self) -> bool {
        self.encode() == [0xFF; Self::LEN]
    }
}

/// Iterator over the entries of a category, SM 0 first. An incomplete entry at the end is ignored.
#[derive(Clone, Debug)]
pub struct SiiSyncManagers<'a> {
    data: &'a [u8],
}

impl<'a> SiiSyncManagers<'a> {
    /// Reads the data of a category.
    pub const fn new(data: &'a [u8]) -> SiiSyncManagers<'a> {
        SiiSyncManagers { data }
    }
}

impl Iterator for SiiSyncManagers<'_> {
    type Item = SiiSyncManager;

    fn next(&mut self) -> Option<SiiSyncManager> {
        let (entry, rest) = self.data.split_first_chunk()?;
        self.data = rest;
        Some(SiiSyncManager::decode(entry))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    // covers: codec-sii
    #[test]
    fn a_write_mailbox_and_an_input_have_the_expected_bytes() {
        let data = [
            0x00, 0x10, 0x80, 0x00, 0x26, 0x00, 0x01, 0x01, // SM 0
            0x00, 0x11, 0x02, 0x00, 0x20, 0x00, 0x0B, 0x04, // SM 1
            0xFF, 0xFF, // no whole entry
        ];
        let mailbox = SiiSyncManager {
            start: 0x1000,
            length: 128,
            control: 0x26,
            status: 0,
            enable: SiiSyncManager::ENABLE,
            kind: SyncManagerKind::MailboxOut,
        };
        let inputs = SiiSyncManager {
            start: 0x1100,
            length: 2,
            control: 0x20,
            status: 0,
            enable: SiiSyncManager::ENABLE | SiiSyncManager::FIXED_CONTENT | SiiSyncManager::OP_ONLY,
            kind: SyncManagerKind::Inputs,
        };
        assert_eq!(SiiSyncManagers::new(&data).collect::<Vec<_>>(), [mailbox, inputs]);
        assert_eq!([mailbox.encode(), inputs.encode()].as_flattened(), &data[..16]);
        assert!(mailbox.is_enabled() && !mailbox.is_erased());
        assert!(SiiSyncManager::decode(&[0xFF; 8]).is_erased());
    }

    #[test]
    fn a_control_byte_gives_the_type_of_a_sync_manager_without_a_type() {
        use SyncManagerKind::{Inputs, MailboxIn, MailboxOut, Outputs, Unused};
        let controls = [0x26, 0x22, 0x64, 0x24, 0x44, 0x20, 0x00, 0x01, 0x28];
        let kinds = [MailboxOut, MailboxIn, Outputs, Outputs, Outputs, Inputs, Inputs, Unused, Unused];
        let kind = |control| SiiSyncManager { control, ..SiiSyncManager::default() }.kind_of_control();
        assert_eq!(controls.map(kind), kinds);
    }

    proptest! {
        #[test]
        fn any_eight_bytes_round_trip(bytes in any::<[u8; SiiSyncManager::LEN]>()) {
            prop_assert_eq!(SiiSyncManager::decode(&bytes).encode(), bytes);
        }
    }
}
