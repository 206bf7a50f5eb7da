//! Faults of an SII, and their offset (protocol 4; all of them occur in real devices).

use core::fmt;

use ringcat_wire::sii::{CategoryKind, MailboxLayout, SyncManagerKind};

/// A mailbox holds at least the header of a message (protocol 6.1).
pub(super) const MAILBOX_HEADER: u16 = 6;

/// A fault in the SII of a SubDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct InfoWarning {
    /// Category; `None` for the fixed area.
    pub category: Option<CategoryKind>,
    /// Byte of the EEPROM at which the fault begins; `None` if it has no single offset.
    pub offset: Option<usize>,
    /// The fault.
    pub problem: SiiProblem,
}

/// The kind of fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SiiProblem {
    /// The fixed area is all 0xFF or all zero: the EEPROM was never written.
    Blank,
    /// The EEPROM cannot be read.
    Unreadable,
    /// No category follows the fixed area.
    NoCategories,
    /// A category is missing that is required in every image.
    Missing,
    /// A category extends beyond the end of the EEPROM; it is ignored.
    Beyond {
        /// Announced length in bytes.
        announced: usize,
        /// Remaining bytes of the EEPROM.
        left: usize,
    },
    /// The categories extend beyond the size that the EEPROM announces; they are used.
    Size {
        /// Announced bytes.
        size: usize,
        /// First byte behind the categories.
        end: usize,
    },
    /// The end of a category is erased (0xFF): the image is truncated. Erased entries are ignored.
    Erased {
        /// Erased bytes.
        bytes: usize,
    },
    /// The SII contains impossible addresses or sizes of the mailboxes; they are not used.
    Mailbox {
        /// Addresses and sizes in the SII.
        layout: MailboxLayout,
        /// First byte behind the memory of the controller.
        memory_end: u32,
    },
    /// SyncManagers are needed, but the SII describes none.
    NoSyncManagers,
    /// Process data without PDOs in the SII, and without a mailbox to read them from a dictionary.
    NoPdos {
        /// The SyncManager.
        sync_manager: u8,
    },
    /// A SyncManager without a type; its type follows from its PDOs or its control byte.
    NoType {
        /// The SyncManager.
        sync_manager: u8,
        /// The type in the SII.
        got: u8,
        /// Assumed type.
        taken: SyncManagerKind,
    },
    /// The low byte of word 7 is not the checksum of the first seven words.
    Checksum {
        /// Checksum of the first seven words.
        expected: u8,
        /// Word 7.
        got: u16,
    },
    /// The chain of categories has no end marker.
    NoEndMarker,
    /// The category announces more bytes than are present, or is shorter than its content.
    Short {
        /// Bytes expected.
        expected: usize,
        /// Bytes present.
        got: usize,
    },
    /// A category occurs more than once; the first one is used.
    Repeated,
    /// One mailbox of a pair has no size; both are ignored.
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
    /// An index beyond the strings of the SII.
    NoString {
        /// The index.
        index: u8,
    },
    /// The SII describes more SyncManagers than the controller has; the rest is ignored.
    SyncManagers {
        /// SyncManagers of the controller.
        expected: usize,
        /// Entries in the SII.
        got: usize,
    },
    /// A PDO announces more entries than the category contains; those within it are used.
    PdoEntries {
        /// Index of the PDO.
        pdo: u16,
        /// Entries announced.
        expected: usize,
        /// Entries present.
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
    /// The object dictionary contains other PDOs for a SyncManager than the SII; the dictionary is used.
    Dictionary {
        /// The SyncManager.
        sync_manager: u8,
        /// Bits of process data that the SII describes.
        sii: u32,
        /// Bits of process data in the dictionary.
        dictionary: u32,
    },
    /// Mode or direction in the control byte of a SyncManager differ from its type; the type is used.
    Control {
        /// The SyncManager.
        sync_manager: u8,
        /// Its control byte.
        control: u8,
    },
}

impl SiiProblem {
    /// Whether the fault shows that the image is damaged.
    pub(super) const fn is_grave(&self) -> bool {
        match self {
            SiiProblem::Blank
            | SiiProblem::Unreadable
            | SiiProblem::NoCategories
            | SiiProblem::Missing
            | SiiProblem::Beyond { .. }
            | SiiProblem::Erased { .. }
            | SiiProblem::Checksum { .. }
            | SiiProblem::NoEndMarker
            | SiiProblem::NoSyncManagers => true,
            SiiProblem::Short { .. }
            | SiiProblem::Size { .. }
            | SiiProblem::Mailbox { .. }
            | SiiProblem::NoPdos { .. }
            | SiiProblem::NoType { .. }
            | SiiProblem::Repeated
            | SiiProblem::HalfMailbox { .. }
            | SiiProblem::NoMailbox { .. }
            | SiiProblem::NoString { .. }
            | SiiProblem::SyncManagers { .. }
            | SiiProblem::PdoEntries { .. }
            | SiiProblem::PdoSyncManager { .. }
            | SiiProblem::PdoDirection { .. }
            | SiiProblem::Dictionary { .. }
            | SiiProblem::Control { .. } => false,
        }
    }
}

impl InfoWarning {
    /// Writes the offset and the category.
    fn fmt_place(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.category, self.offset) {
            (Some(category), Some(offset)) => write!(f, "byte {offset:#06x}, category {category}: "),
            (Some(category), None) => write!(f, "category {category}: "),
            (None, Some(offset)) => write!(f, "byte {offset:#06x}: "),
            (None, None) => Ok(()),
        }
    }
}

fn fmt_mailboxes(f: &mut fmt::Formatter<'_>, layout: &MailboxLayout, memory_end: u32) -> fmt::Result {
    let MailboxLayout { receive_size, receive_offset, send_size, send_offset } = layout;
    write!(
        f,
        "mailboxes of {receive_size} bytes at {receive_offset:#06x} and {send_size} bytes at {send_offset:#06x} are \
          ignored: expected at least {MAILBOX_HEADER} bytes each, apart from each other, between 0x1000 and \
         {memory_end:#06x}"
    )
}

/// Purpose of a SyncManager of a type.
const fn purpose(kind: SyncManagerKind) -> &'static str {
    match kind {
        SyncManagerKind::MailboxOut => "the mailbox to the SubDevice",
        SyncManagerKind::MailboxIn => "the mailbox from the SubDevice",
        SyncManagerKind::Outputs => "outputs",
        SyncManagerKind::Inputs => "inputs",
        SyncManagerKind::Unused | SyncManagerKind::Other(_) => "nothing",
    }
}

impl fmt::Display for InfoWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.fmt_place(f)?;
        match self.problem {
            SiiProblem::Blank => f.write_str("the EEPROM is blank"),
            SiiProblem::Unreadable => f.write_str("the EEPROM cannot be read: nothing is known about this SubDevice"),
            SiiProblem::NoCategories => f.write_str("no category follows the fixed area: the image is truncated"),
            SiiProblem::Missing => f.write_str("required in every image, but missing: is the image truncated?"),
            SiiProblem::Beyond { announced, left } => {
                write!(f, "announces {announced} bytes, but only {left} remain: it is ignored, no end marker follows")
            }
            SiiProblem::Size { size, end } => {
                write!(f, "the EEPROM announces a size of {size} bytes, but its categories end at byte {end:#06x}")
            }
            SiiProblem::Erased { bytes } => {
                write!(f, "its last {bytes} bytes are erased (0xff): the image is truncated")
            }
            SiiProblem::Mailbox { layout, memory_end } => fmt_mailboxes(f, &layout, memory_end),
            SiiProblem::NoSyncManagers => f.write_str("no SyncManager is described: is the image truncated?"),
            SiiProblem::NoPdos { sync_manager } => {
                write!(f, "SM {sync_manager} is for process data, but no PDO describes it")
            }
            SiiProblem::NoType { sync_manager, got, taken } => {
                write!(f, "SM {sync_manager} has type {got}, assumed to be for {}", purpose(taken))
            }
            SiiProblem::Checksum { expected, got } => {
                write!(f, "checksum: expected {expected:#04x}, word 7 is {got:#06x}")
            }
            SiiProblem::NoEndMarker => f.write_str("no end marker"),
            SiiProblem::Short { expected, got } => write!(f, "expected {expected} bytes, got {got}"),
            SiiProblem::Repeated => f.write_str("occurs more than once, the first one is used"),
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
                write!(f, "PDO {pdo:#06x} announces {expected} entries, but contains {got}")
            }
            SiiProblem::PdoSyncManager { pdo, sync_manager } => {
                write!(f, "PDO {pdo:#06x} is assigned to SM {sync_manager}, which the SII does not describe")
            }
            SiiProblem::PdoDirection { pdo, sync_manager } => {
                write!(f, "PDO {pdo:#06x} is assigned to SM {sync_manager}, which is of another type")
            }
            SiiProblem::Dictionary { sync_manager, sii, dictionary } => write!(
                f,
                "SM {sync_manager}: {sii} bits of process data in the SII, but {dictionary} bits in other PDOs of the \
                 dictionary, which is used"
            ),
            SiiProblem::Control { sync_manager, control } => {
                write!(f, "SM {sync_manager}: control byte {control:#04x} does not match its type, which is used")
            }
        }
    }
}
