//! Why a SubDevice cannot be set up as declared: mostly a wrong declaration, sometimes a wrong SII.

use alloc::format;
use alloc::string::String;
use core::fmt;
use core::ops::Range;

use ringcat_wire::address::{Position, RegisterAddress, StationAddress};
use ringcat_wire::datagram::MAX_DATA;
use ringcat_wire::mailbox::soe::Idn;

use crate::info::Direction;

/// A problem and the SubDevice that has it.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct PlanError {
    /// Position of the SubDevice.
    pub position: Position,
    /// Its station address.
    pub station: StationAddress,
    /// The problem.
    pub problem: PlanProblem,
    /// Part that must be corrected.
    pub fault: PlanFault,
}

/// Part that must be corrected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum PlanFault {
    /// The declaration.
    Declaration,
    /// The SII: it is damaged, or the SubDevice cannot be set up without a declaration either.
    Sii,
}

/// The problem.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum PlanProblem {
    /// Nothing is declared, and the EEPROM is empty.
    NoSii,
    /// A SyncManager that the controller does not have.
    NoSuchSyncManager {
        /// Its number.
        sync_manager: u8,
        /// SyncManagers of the controller.
        available: u8,
    },
    /// Process data for a SyncManager that the SII does not describe.
    UnknownSyncManager {
        /// Its number.
        sync_manager: u8,
        /// SyncManagers that the SII describes.
        described: usize,
    },
    /// Process data for a SyncManager that belongs to the mailbox.
    MailboxSyncManager {
        /// Its number.
        sync_manager: u8,
    },
    /// Two declarations for one SyncManager differ in its direction.
    Directions {
        /// Its number.
        sync_manager: u8,
        /// Direction of the declaration of the SyncManager.
        expected: Direction,
        /// Direction of its PDO assignment.
        got: Direction,
    },
    /// A PDO without declared entries, and without entries in the SII.
    UnknownPdo {
        /// The SyncManager to which it is assigned.
        sync_manager: u8,
        /// Its index.
        pdo: u16,
    },
    /// A PDO that is assigned to a SyncManager of the other direction.
    PdoDirection {
        /// The SyncManager.
        sync_manager: u8,
        /// Index of the PDO.
        pdo: u16,
        /// Direction of the SyncManager.
        expected: Direction,
        /// Direction of the PDO in the SII.
        got: Direction,
    },
    /// A PDO that is assigned twice.
    PdoTwice {
        /// Index of the PDO.
        pdo: u16,
        /// The SyncManager of the first assignment.
        first: u8,
        /// The SyncManager of the second assignment.
        second: u8,
    },
    /// More PDOs in an assignment, or entries in a PDO, than the object can contain.
    TooMany {
        /// The object: 0x1C10 + n for the assignment of SM n, or the PDO.
        object: u16,
        /// Largest number of entries.
        expected: usize,
        /// Requested entries.
        got: usize,
    },
    /// More process data than fits a SyncManager.
    TooLong {
        /// The SyncManager.
        sync_manager: u8,
        /// Requested bits.
        bits: u64,
    },
    /// More process data of a SyncManager than a datagram carries.
    BeyondDatagram {
        /// The SyncManager.
        sync_manager: u8,
        /// Its bytes.
        length: u16,
    },
    /// An area outside the memory of the controller.
    OutsideMemory {
        /// The SyncManager.
        sync_manager: u8,
        /// First byte.
        start: u16,
        /// Bytes including all buffers.
        bytes: u32,
        /// First byte behind the memory.
        memory_end: u32,
    },
    /// An area in the register space, without memory for its direction.
    NoMemory {
        /// The SyncManager.
        sync_manager: u8,
        /// First byte.
        start: u16,
    },
    /// Two areas overlap; one with three buffers takes three times its length.
    Overlap {
        /// The SyncManager of the first area.
        first: u8,
        /// Bytes of the first area, all buffers included.
        first_bytes: Range<u32>,
        /// The SyncManager of the second area.
        second: u8,
        /// Bytes of the second area.
        second_bytes: Range<u32>,
    },
    /// More areas than the controller has FMMUs.
    TooFewFmmus {
        /// FMMUs needed.
        expected: usize,
        /// FMMUs of the controller.
        got: u8,
    },
    /// An SDO download for a SubDevice without CoE.
    NoCoe {
        /// Index of the object.
        index: u16,
        /// Subindex of the object.
        sub_index: u8,
    },
    /// An IDN for a SubDevice without SoE.
    NoSoe {
        /// The drive.
        drive: u8,
        /// The IDN.
        idn: Idn,
    },
    /// IP parameters for a SubDevice without EoE.
    NoEoe,
    /// A message for a SubDevice without its protocol.
    NoProtocol(&'static str),
    /// A message without the header of its protocol, or an answer.
    Message,
    /// A message of a start-up command that its mailbox cannot hold; the headers of mailbox and protocol count too.
    MailTooLong {
        /// Bytes of the message.
        bytes: usize,
        /// Bytes of the mailbox that the SubDevice reads.
        mailbox: u16,
    },
    /// A mailbox command at the transition from INIT to INIT.
    NoMailInInit,
    /// A configuration file declares a SyncManager twice.
    DeclaredTwice {
        /// Its number.
        sync_manager: u8,
    },
    /// A configuration file declares mailboxes, but not one of each direction.
    DeclaredMailboxes {
        /// Mailboxes that the MainDevice writes.
        out: usize,
        /// Mailboxes that the MainDevice reads.
        inward: usize,
    },
    /// A configuration file declares a SyncManager for one direction, with a control byte for the other.
    DeclaredControl {
        /// Its number.
        sync_manager: u8,
        /// The direction for which it is declared.
        expected: Direction,
        /// The direction of its control byte.
        got: Direction,
    },
    /// A configuration file declares more PDO entries than the length of their SyncManager has bits.
    DeclaredTooShort {
        /// Its number.
        sync_manager: u8,
        /// Bits of its PDO entries.
        expected: u64,
        /// Bits of its length.
        got: u64,
    },
    /// A register command has no data, more than a datagram carries, data beyond the last register, or a mask of
    /// another length.
    RegisterCommand {
        /// The register.
        register: RegisterAddress,
        /// Bytes of data.
        data: usize,
        /// Bytes of the mask.
        mask: Option<usize>,
    },
}

/// A declaration that the SII does not permit, or that it completes. The process data is planned as declared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum PlanWarning {
    /// The declared PDOs differ from the SII, and the SubDevice has no CoE: they are not written.
    NoCoe {
        /// The SyncManager.
        sync_manager: u8,
    },
    /// The declared PDO assignment differs from the SII, which marks it as fixed. It is not written.
    FixedAssignment {
        /// The SyncManager.
        sync_manager: u8,
    },
    /// The declared mapping differs from that of the SubDevice, and the SII or the declaration marks it as fixed. It is
    /// not written.
    FixedMapping {
        /// Index of the PDO.
        pdo: u16,
    },
    /// A configuration file has no mailboxes, but the SII has some: the mailboxes of the SII are used.
    MailboxOfSii,
    /// A configuration file has a mailbox at another place or of another length than the SII. It is written as in the
    /// file.
    OtherMailbox {
        /// The SyncManager.
        sync_manager: u8,
        /// Start and length in the file.
        declared: (u16, u16),
        /// Start and length in the SII.
        sii: (u16, u16),
    },
    /// A configuration file has process data at another address than the SII. It is written as in the file.
    OtherAddress {
        /// The SyncManager.
        sync_manager: u8,
        /// Start in the file.
        declared: u16,
        /// Start in the SII.
        sii: u16,
    },
}

impl fmt::Display for PlanError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "SubDevice {} ({}): ", self.position, self.station)?;
        match self.fault {
            PlanFault::Declaration => self.problem.fmt(f),
            PlanFault::Sii => write!(f, "its SII cannot be used: {}", self.problem),
        }
    }
}

impl core::error::Error for PlanError {}

impl fmt::Display for PlanProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoSii => f.write_str("the EEPROM is blank or cannot be read, and nothing is declared"),
            Self::NoSuchSyncManager { sync_manager, available } => {
                write!(f, "SM {sync_manager} is declared, the controller has {available} SyncManagers")
            }
            Self::UnknownSyncManager { sync_manager, described } => {
                write!(f, "SM {sync_manager} has process data, the SII describes {described} SyncManagers only")
            }
            Self::MailboxSyncManager { sync_manager } => {
                write!(f, "SM {sync_manager} has process data, but it belongs to the mailbox")
            }
            Self::Directions { sync_manager, expected, got } => {
                write!(f, "SM {sync_manager} is declared for {expected}, its PDO assignment for {got}")
            }
            Self::UnknownPdo { sync_manager, pdo } => {
                write!(f, "SM {sync_manager}: PDO {pdo:#06x} has no declared entries and is not in the SII")
            }
            Self::PdoDirection { sync_manager, pdo, expected, got } => {
                write!(f, "SM {sync_manager} is for {expected}, PDO {pdo:#06x} for {got}")
            }
            Self::PdoTwice { pdo, first, second } => {
                write!(f, "PDO {pdo:#06x} is assigned to SM {first} and again to SM {second}")
            }
            Self::TooMany { object, expected, got } => {
                write!(f, "object {object:#06x} holds at most {expected} entries, got {got}")
            }
            Self::TooLong { sync_manager, bits } => {
                write!(f, "SM {sync_manager}: {bits} bits of process data, expected at most 524280")
            }
            Self::BeyondDatagram { sync_manager, length } => {
                write!(f, "SM {sync_manager}: {length} bytes of process data, a datagram carries at most {MAX_DATA}")
            }
            Self::NoMemory { sync_manager, start } => {
                write!(f, "SM {sync_manager}: no memory for its direction at {start:#06x}")
            }
            Self::OutsideMemory { .. } | Self::Overlap { .. } => self.fmt_places(f),
            Self::TooFewFmmus { expected, got } => {
                write!(f, "{expected} FMMUs are needed, the controller has {got}")
            }
            Self::NoCoe { .. } | Self::NoSoe { .. } | Self::NoEoe => self.fmt_protocol(f),
            Self::NoProtocol(_) | Self::Message | Self::NoMailInInit => self.fmt_protocol(f),
            Self::MailTooLong { .. } => self.fmt_protocol(f),
            Self::DeclaredTwice { sync_manager } => write!(f, "SM {sync_manager} is declared twice"),
            Self::DeclaredMailboxes { out, inward } => {
                write!(f, "expected a mailbox to the SubDevice and one from it, or none, got {out} and {inward}")
            }
            Self::DeclaredControl { sync_manager, expected, got } => {
                write!(f, "SM {sync_manager} is declared for {expected}, its control byte for {got}")
            }
            Self::DeclaredTooShort { sync_manager, expected, got } => {
                write!(f, "SM {sync_manager}: its PDO entries have {expected} bits, its length {got}")
            }
            Self::RegisterCommand { register, data, mask } => {
                let mask = mask.map_or(String::new(), |mask| format!(" and {mask} of mask"));
                write!(f, "a command to register {register} has {data} bytes of data{mask}")
            }
        }
    }
}

impl PlanProblem {
    /// Places in memory that do not go together.
    fn fmt_places(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Self::OutsideMemory { sync_manager, start, bytes, memory_end } = self {
            write!(f, "SM {sync_manager}: {bytes} bytes (all buffers) at {start:#06x} exceed the memory, ")?;
            write!(f, "which ends at {memory_end:#06x}")?;
        }
        if let Self::Overlap { first, first_bytes, second, second_bytes } = self {
            write!(f, "SM {first} ({:#06x}..{:#06x}) and ", first_bytes.start, first_bytes.end)?;
            write!(f, "SM {second} ({:#06x}..{:#06x}) overlap", second_bytes.start, second_bytes.end)?;
        }
        Ok(())
    }

    /// A start-up command that the mailbox of the SubDevice does not take.
    fn fmt_protocol(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoCoe { index, sub_index } => {
                write!(f, "object {index:#06x}:{sub_index:02x} is to be written, but the SubDevice has no CoE")
            }
            Self::NoSoe { drive, idn } => {
                write!(f, "{idn} of drive {drive} is to be accessed, but the SubDevice has no SoE")
            }
            Self::Message => {
                f.write_str("a message of a start-up command has no header of its protocol, or is an answer")
            }
            Self::MailTooLong { bytes, mailbox } => {
                write!(f, "a start-up command has a message of {bytes} bytes, the mailbox has {mailbox}")
            }
            Self::NoMailInInit => f.write_str("a mailbox command is declared from INIT to INIT: INIT has no mailbox"),
            Self::NoProtocol(protocol) => {
                write!(f, "a message of {protocol} is to be sent, but the SubDevice has no {protocol}")
            }
            _ => f.write_str("IP parameters are to be set, but the SubDevice has no EoE"),
        }
    }
}

impl fmt::Display for PlanWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            PlanWarning::NoCoe { sync_manager } => {
                write!(f, "SM {sync_manager}: the declared PDOs differ from the SII, and without CoE ")?;
                f.write_str("they are not written")
            }
            PlanWarning::FixedAssignment { sync_manager } => {
                write!(
                    f,
                    "SM {sync_manager}: the declared PDO assignment differs from the SII, which marks it as fixed"
                )
            }
            PlanWarning::FixedMapping { pdo } => {
                write!(f, "PDO {pdo:#06x}: the declared mapping differs from that of the SubDevice, which is fixed")
            }
            PlanWarning::MailboxOfSii => {
                f.write_str("the file has no mailboxes, but the SubDevice has some: the mailboxes of its SII are used")
            }
            PlanWarning::OtherMailbox { sync_manager, declared: (start, length), sii } => {
                write!(
                    f,
                    "SM {sync_manager}: the file has a mailbox of {length} bytes at {start:#06x}, the SII one of "
                )?;
                write!(f, "{} bytes at {:#06x}: that of the file is used", sii.1, sii.0)
            }
            PlanWarning::OtherAddress { sync_manager, declared, sii } => {
                write!(f, "SM {sync_manager}: the file has process data at {declared:#06x}, the SII at {sii:#06x}: ")?;
                f.write_str("the address of the file is used")
            }
        }
    }
}
