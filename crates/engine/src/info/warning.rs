//! Faults of an SII, and their place (protocol 4; all of them occur in real devices).

use core::fmt;

use ringcat_wire::sii::{CategoryKind, MailboxLayout, SyncManagerKind};

/// A mailbox holds at least the header of a message (protocol 6.1).
pub(super) const MAILBOX_HEADER: u16 = 6;

/// A fault in the SII of a SubDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InfoWarning {
    /// Category; `None` for the fixed area.
    pub category: Option<CategoryKind>,
    /// Byte of the EEPROM at which the fault begins; `None` where it has no single place.
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
    /// A category is missing that every device has.
    Missing,
    /// A category goes on beyond the end of the EEPROM; it is left out.
    Beyond {
        /// Announced length in bytes.
        announced: usize,
        /// Bytes that are left.
        left: usize,
    },
    /// The categories extend beyond the size that the EEPROM announces; they are used.
    Size {
        /// Announced bytes.
        size: usize,
        /// Where the categories end.
        end: usize,
    },
    /// The end of a category is erased (0xFF): the image was cut short. Entries that are erased are left out.
    Erased {
        /// Erased bytes.
        bytes: usize,
    },
    /// The mailboxes cannot be at the place that the SII gives; they are not used.
    Mailbox {
        /// Place that the SII gives.
        layout: MailboxLayout,
        /// First byte behind the memory of the controller.
        memory_end: u32,
    },
    /// SyncManagers are needed, and the SII describes none.
    NoSyncManagers,
    /// Process data without a mailbox in which a dictionary could describe it, and without PDOs.
    NoPdos {
        /// The SyncManager.
        sync_manager: u8,
    },
    /// A SyncManager without a type; its type comes from its PDOs or its control byte.
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
    /// A category that may occur only once occurs again; the first one is used.
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
    /// An index beyond the strings of the SII.
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
    /// A PDO announces more entries than the category holds; those within it are used.
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
    /// The dictionary of the SubDevice has other PDOs for a SyncManager than the SII; the dictionary is used.
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
    /// The image is not as its vendor wrote it: it is damaged.
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
    /// The place in the EEPROM.
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
         not believed: expected at least {MAILBOX_HEADER} bytes each, apart from each other, between 0x1000 and \
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
            SiiProblem::Unreadable => f.write_str("the EEPROM cannot be read: nothing is known of this SubDevice"),
            SiiProblem::NoCategories => f.write_str("nothing follows the fixed area: the image is cut short"),
            SiiProblem::Missing => f.write_str("expected in every image, there is none: is the image cut short?"),
            SiiProblem::Beyond { announced, left } => {
                write!(f, "announces {announced} bytes, {left} are left: it is left out, no end marker follows")
            }
            SiiProblem::Size { size, end } => {
                write!(f, "the EEPROM says that it has {size} bytes, its categories end at byte {end:#06x}")
            }
            SiiProblem::Erased { bytes } => {
                write!(f, "its last {bytes} bytes are erased (0xff): the image is cut short")
            }
            SiiProblem::Mailbox { layout, memory_end } => fmt_mailboxes(f, &layout, memory_end),
            SiiProblem::NoSyncManagers => f.write_str("no SyncManager is described: is the image cut short?"),
            SiiProblem::NoPdos { sync_manager } => {
                write!(f, "SM {sync_manager} is for process data, and no PDO describes it")
            }
            SiiProblem::NoType { sync_manager, got, taken } => {
                write!(f, "SM {sync_manager} has type {got}, taken for {}", purpose(taken))
            }
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
                "SM {sync_manager}: {sii} bits of process data, the dictionary has other PDOs with {dictionary} \
                 bits, which count"
            ),
            SiiProblem::Control { sync_manager, control } => {
                write!(f, "SM {sync_manager}: control byte {control:#04x} is not one of its type, which counts")
            }
        }
    }
}
