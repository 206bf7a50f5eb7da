//! SyncManager: keeps accesses to process data and mailboxes consistent (protocol 3.11).

use super::view::Field;

/// Buffer type of a SyncManager.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum SyncManagerMode {
    /// Three buffers: the reader gets the last complete value, neither side waits.
    #[default]
    Buffered,
    /// One buffer with hand-shake.
    Mailbox,
    /// A reserved code (1, 3).
    Reserved(u8),
}

impl Field for SyncManagerMode {
    fn from_field(raw: u32) -> SyncManagerMode {
        match raw {
            0 => SyncManagerMode::Buffered,
            2 => SyncManagerMode::Mailbox,
            other => SyncManagerMode::Reserved(other as u8),
        }
    }
    fn to_field(self) -> u32 {
        match self {
            SyncManagerMode::Buffered => 0,
            SyncManagerMode::Mailbox => 2,
            SyncManagerMode::Reserved(code) => u32::from(code),
        }
    }
}

/// Direction of a SyncManager, seen from EtherCAT.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum SyncManagerDirection {
    /// EtherCAT reads, the PDI writes (inputs).
    #[default]
    Read,
    /// EtherCAT writes, the PDI reads (outputs).
    Write,
    /// A reserved code (2, 3).
    Reserved(u8),
}

impl Field for SyncManagerDirection {
    fn from_field(raw: u32) -> SyncManagerDirection {
        match raw {
            0 => SyncManagerDirection::Read,
            1 => SyncManagerDirection::Write,
            other => SyncManagerDirection::Reserved(other as u8),
        }
    }
    fn to_field(self) -> u32 {
        match self {
            SyncManagerDirection::Read => 0,
            SyncManagerDirection::Write => 1,
            SyncManagerDirection::Reserved(code) => u32::from(code),
        }
    }
}

bit_register! {
    /// Control byte of a SyncManager (+4).
    SyncManagerControl(u8, reset 0) {
        /// Buffer type.
        mode: SyncManagerMode = 0, 2;
        /// Direction.
        direction: SyncManagerDirection = 2, 2;
        /// Raises its ECAT event.
        ecat_event: bool = 4, 1;
        /// Raises its AL event.
        pdi_event: bool = 5, 1;
        /// A complete write retriggers the process data watchdog.
        watchdog: bool = 6, 1;
        /// Sequential mode.
        sequential: bool = 7, 1;
    }
}

bit_register! {
    /// Status byte of a SyncManager (+5), read only.
    SyncManagerStatus(u8, reset 0, reserved kept) {
        /// The buffer was written completely.
        write_event: bool = 0, 1;
        /// The buffer was read completely.
        read_event: bool = 1, 1;
        /// The mailbox is full.
        mailbox_full: bool = 3, 1;
        /// Buffer that was written last; 3: none.
        last_buffer: u8 = 4, 2;
        /// The read buffer is open.
        read_buffer_open: bool = 6, 1;
        /// The write buffer is open.
        write_buffer_open: bool = 7, 1;
    }
}

bit_register! {
    /// Activate byte of a SyncManager (+6).
    SyncManagerActivate(u8, reset 0, reserved kept) {
        /// Activated.
        enable: bool = 0, 1;
        /// Toggled by the MainDevice to request the last mail again.
        repeat_request: bool = 1, 1;
        /// Latch event on a buffer change by EtherCAT.
        latch_ecat: bool = 6, 1;
        /// Latch event on a buffer change by the PDI.
        latch_pdi: bool = 7, 1;
    }
}

bit_register! {
    /// PDI control byte of a SyncManager (+7), written by the PDI.
    SyncManagerPdiControl(u8, reset 0, reserved kept) {
        /// The PDI has deactivated the SyncManager.
        deactivate: bool = 0, 1;
        /// Set to the repeat request when the mail is available again.
        repeat_acknowledge: bool = 1, 1;
    }
}

/// One SyncManager, 8 bytes at [`super::map::sync_manager`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct SyncManager {
    /// First physical byte.
    pub start: u16,
    /// Bytes; 0 deactivates the SyncManager.
    pub length: u16,
    /// Control byte.
    pub control: SyncManagerControl,
    /// Status byte.
    pub status: SyncManagerStatus,
    /// Activate byte.
    pub activate: SyncManagerActivate,
    /// PDI control byte.
    pub pdi_control: SyncManagerPdiControl,
}

impl SyncManager {
    /// Bytes of the registers.
    pub const LEN: usize = 8;
    /// Offset of the control byte.
    pub const CONTROL: u16 = 4;
    /// Offset of the status byte.
    pub const STATUS: u16 = 5;
    /// Offset of the activate byte.
    pub const ACTIVATE: u16 = 6;
    /// Offset of the PDI control byte.
    pub const PDI_CONTROL: u16 = 7;

    /// From the registers' bytes.
    pub fn decode(bytes: &[u8; Self::LEN]) -> SyncManager {
        let b = bytes;
        SyncManager {
            start: u16::from_le_bytes([b[0], b[1]]),
            length: u16::from_le_bytes([b[2], b[3]]),
            control: SyncManagerControl::from_bits(b[4]),
            status: SyncManagerStatus::from_bits(b[5]),
            activate: SyncManagerActivate::from_bits(b[6]),
            pdi_control: SyncManagerPdiControl::from_bits(b[7]),
        }
    }

    /// To the registers' bytes.
    pub fn encode(&self) -> [u8; Self::LEN] {
        let start = self.start.to_le_bytes();
        let length = self.length.to_le_bytes();
        [
            start[0],
            start[1],
            length[0],
            length[1],
            self.control.bits(),
            self.status.bits(),
            self.activate.bits(),
            self.pdi_control.bits(),
        ]
    }
}
