//! What is odd in an SII, and where (facts 4; users meet all of it in the field).

use core::fmt;

use ringcat_wire::sii::CategoryKind;

/// Something odd in the SII of a SubDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InfoWarning {
    /// Category; `None` for the fixed area.
    pub category: Option<CategoryKind>,
    /// Byte offset in the category's data or in the fixed area.
    pub offset: usize,
    /// What is odd.
    pub problem: SiiProblem,
}

/// What is odd.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SiiProblem {
    /// The fixed area is all 0xFF or all zero: nobody has written the EEPROM.
    Blank,
    /// The low byte of word 7 does not fit the first seven words.
    Checksum {
        /// The checksum that belongs to the first seven words.
        expected: u8,
        /// Word 7.
        got: u16,
    },
    /// The chain of categories has no end marker.
    NoEndMarker,
    /// The category announces more bytes than are there, or is shorter than what it holds.
    Short {
        /// Bytes expected.
        expected: usize,
        /// Bytes there.
        got: usize,
    },
    /// A category that should be there once comes again; the first one counts.
    Repeated,
    /// One mailbox of a pair has no size; both are left unused.
    HalfMailbox {
        /// Bytes of the mailbox that the MainDevice writes.
        receive_size: u16,
        /// Bytes of the mailbox that the MainDevice reads.
        send_size: u16,
    },
    /// Mailbox protocols are announced, but no mailbox.
    NoMailbox {
        /// The protocols word.
        protocols: u16,
    },
    /// A string index that the strings do not have.
    NoString {
        /// The index.
        index: u8,
    },
    /// The SII describes more SyncManagers than the controller has; the rest is left out.
    SyncManagers {
        /// SyncManagers of the controller.
        expected: usize,
        /// Entries in the SII.
        got: usize,
    },
    /// A PDO announces more entries than the category holds; those there are used.
    PdoEntries {
        /// Index of the PDO.
        pdo: u16,
        /// Entries announced.
        expected: usize,
        /// Entries there.
        got: usize,
    },
    /// A PDO is assigned to a SyncManager that the SII does not describe.
    PdoSyncManager {
        /// Index of the PDO.
        pdo: u16,
        /// The SyncManager.
        sync_manager: u8,
    },
    /// A PDO is assigned to a SyncManager of the other direction, or to one that is not for process data.
    PdoDirection {
        /// Index of the PDO.
        pdo: u16,
        /// The SyncManager.
        sync_manager: u8,
    },
    /// The dictionary of the SubDevice has other PDOs for a SyncManager than the SII; the dictionary counts.
    Dictionary {
        /// The SyncManager.
        sync_manager: u8,
        /// Bits of process data that the SII describes.
        sii: u32,
        /// Bits of process data in the dictionary.
        dictionary: u32,
    },
    /// The direction in the control byte of a SyncManager is not that of its type; the type counts.
    ControlDirection {
        /// The SyncManager.
        sync_manager: u8,
        /// Its control byte.
        control: u8,
    },
}

impl fmt::Display for InfoWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.category {
            Some(category) => write!(f, "SII category {category} at byte {}: ", self.offset)?,
            None => write!(f, "SII at byte {}: ", self.offset)?,
        }
        match self.problem {
            SiiProblem::Blank => f.write_str("the EEPROM is blank"),
            SiiProblem::Checksum { expected, got } => {
                write!(f, "checksum: expected {expected:#04x}, word 7 is {got:#06x}")
            }
            SiiProblem::NoEndMarker => f.write_str("no end marker"),
            SiiProblem::Short { expected, got } => write!(f, "expected {expected} bytes, got {got}"),
            SiiProblem::Repeated => f.write_str("comes again, the first one counts"),
            SiiProblem::HalfMailbox { receive_size, send_size } => {
                write!(f, "mailbox sizes are {receive_size} and {send_size}, expected both or none")
            }
            SiiProblem::NoMailbox { protocols } => {
                write!(f, "mailbox protocols {protocols:#06x} without a mailbox")
            }
            SiiProblem::NoString { index } => write!(f, "string {index} does not exist"),
            SiiProblem::SyncManagers { expected, got } => {
                write!(f, "{got} SyncManagers, the controller has {expected}")
            }
            SiiProblem::PdoEntries { pdo, expected, got } => {
                write!(f, "PDO {pdo:#06x} announces {expected} entries, {got} are there")
            }
            SiiProblem::PdoSyncManager { pdo, sync_manager } => {
                write!(f, "PDO {pdo:#06x} is assigned to SM {sync_manager}, which the SII does not describe")
            }
            SiiProblem::PdoDirection { pdo, sync_manager } => {
                write!(f, "PDO {pdo:#06x} is assigned to SM {sync_manager}, which is of another type")
            }
            SiiProblem::Dictionary { sync_manager, sii, dictionary } => write!(
                f,
                "SM {sync_manager}: {sii} bits of process data, the dictionary has other PDOs with {dictionary} bits, which count"
            ),
            SiiProblem::ControlDirection { sync_manager, control } => {
                write!(f, "SM {sync_manager}: direction in control byte {control:#04x} is not that of its type")
            }
        }
    }
}
