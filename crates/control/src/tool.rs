//! The questions of the command line tool `ethercat` and of masters opened for questions, and the answers.
//!
//! Numbers are those of registers, of the SII and of dictionaries. SubDevices have their positions in the ring. Lists
//! of SubDevices go in pieces; the largest of each is named.

mod lines;

use serde::{Deserialize, Serialize};

pub use lines::{
    AreaLine, ClockFeatures, CycleReport, DeclaredLine, DeclaredSyncManager, Description, DomainLine, EntryLine,
    EthernetLine, IdnLine, IpParameters, LinkReport, MasterReport, ObjectLine, PdoEntryLine, PdoLine, PortLine,
    PortsLine, RecordLine, SdoLine, SiiLine, SubDeviceLine, SyncLine, SyncManagerLine, Traffic, TrafficRate,
    TransferLine, TransferWork,
};

/// Most SubDevices in one answer to [`ToolQuery::SubDevices`] and [`ToolQuery::Ports`].
pub const MOST_SUBDEVICES: usize = 512;
/// Most SubDevices in one [`ToolQuery::SiiImages`].
pub const MAX_IMAGES: usize = 64;
/// Most transfers in one answer to [`ToolQuery::Transfers`].
pub const MAX_TRANSFERS: usize = 16;
/// Most declared SubDevices in one answer to [`ToolQuery::Declared`].
pub const MOST_DECLARED: usize = 64;
/// Most bytes of a part of a file, in [`ToolQuery::FilePart`].
pub const MOST_PART: usize = 48 << 10;
/// Most bytes of a file that is read or written.
pub const MOST_FILE: usize = 16 << 20;
/// Most bytes of a start-up command that are sent; its length is that of all of them.
pub const MOST_STARTUP: usize = 1024;

/// A query of the tool.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum ToolQuery {
    /// The master as a whole: links, frames, clocks.
    Master,
    /// SubDevices with their present AL states, from a position on.
    SubDevices {
        /// Position of the first.
        from: u16,
    },
    /// What is known of a SubDevice from its SII, its controller and its dictionary. Needs no frame.
    Description {
        /// Its position.
        position: u16,
    },
    /// Ports of SubDevices, from a position on.
    Ports {
        /// Position of the first.
        from: u16,
        /// Most of them; never more than [`MOST_SUBDEVICES`].
        most: u16,
    },
    /// Indices of all objects in the dictionary of a SubDevice; none without SDO information.
    Objects {
        /// Its position.
        position: u16,
    },
    /// Name of an object, and all its entries.
    Object {
        /// Position of the SubDevice.
        position: u16,
        /// Index of the object.
        index: u16,
    },
    /// One entry of an object.
    Entry {
        /// Position of the SubDevice.
        position: u16,
        /// Index of the object.
        index: u16,
        /// Sub-index of the entry.
        sub_index: u8,
    },
    /// Reads a file of at most [`MOST_FILE`] bytes by FoE.
    FileRead {
        /// Position of the SubDevice.
        position: u16,
        /// Name of the file there.
        name: String,
    },
    /// The next bytes of a file that is to be written are in the message, at most [`MOST_PART`].
    FilePart {
        /// Number of the transfer, chosen by the client.
        transfer: u64,
        /// Place of the first byte. A transfer begins at 0, and goes on without gaps.
        offset: u32,
    },
    /// Writes the file of a transfer by FoE.
    FileWrite {
        /// Position of the SubDevice.
        position: u16,
        /// Name of the file there.
        name: String,
        /// Number of the transfer; a file without bytes needs none before.
        transfer: u64,
    },
    /// Reads whole SIIs. One that has proved to be unchanged since it was read is not read again.
    SiiImages {
        /// Positions of the SubDevices, at most [`MAX_IMAGES`].
        positions: Vec<u16>,
    },
    /// Progress of the long transfers of a SubDevice. Sends no frame.
    Transfers {
        /// Its position.
        position: u16,
    },
    /// Writes the whole SII with the bytes of the message.
    SiiWrite {
        /// Position of the SubDevice.
        position: u16,
        /// Writes the bytes even if they are no valid image.
        force: bool,
    },
    /// Writes the alias into the SII.
    AliasWrite {
        /// Position of the SubDevice.
        position: u16,
        /// The alias; 0 is none.
        alias: u16,
        /// Writes the alias even if the checksum is wrong.
        force: bool,
    },
    /// Requests a state and does not wait for it: 1 INIT, 2 PREOP, 3 BOOT, 4 SAFEOP, 8 OP.
    StartState {
        /// Position of the SubDevice.
        position: u16,
        /// The state, as in register AL_CONTROL.
        state: u8,
    },
    /// Writes registers with the bytes of the message, before all that waits, also of a SubDevice that no scan has
    /// found.
    UrgentWrite {
        /// Position of the SubDevice.
        position: u16,
        /// First register.
        address: u16,
    },
    /// Sets IP parameters by EoE.
    SetIp {
        /// Position of the SubDevice.
        position: u16,
        /// The parameters.
        ip: IpParameters,
    },
    /// Sets the level of messages: 0 to 2, above as 2.
    SetDebugLevel {
        /// The level.
        level: u32,
    },
    /// SubDevices that the application has declared, from an index on; none without an active application.
    Declared {
        /// Index of the first.
        from: u16,
    },
    /// Domains of the application; their images, one behind the other, are the bytes of the message.
    Domains,
    /// Network interfaces of EoE.
    Ethernet,
    /// Writes the last frames into a file, and waits for it.
    Record,
}

impl ToolQuery {
    /// Whether the answer only shows the present state.
    pub fn is_reading(&self) -> bool {
        !matches!(
            self,
            ToolQuery::FilePart { .. }
                | ToolQuery::FileWrite { .. }
                | ToolQuery::SiiWrite { .. }
                | ToolQuery::AliasWrite { .. }
                | ToolQuery::StartState { .. }
                | ToolQuery::UrgentWrite { .. }
                | ToolQuery::SetIp { .. }
                | ToolQuery::SetDebugLevel { .. }
                | ToolQuery::Record
        )
    }

    /// Whether it may take minutes: flash memory is erased and written, or read word by word; a large file is written.
    pub fn is_long(&self) -> bool {
        matches!(
            self,
            ToolQuery::FileRead { .. }
                | ToolQuery::FileWrite { .. }
                | ToolQuery::SiiImages { .. }
                | ToolQuery::SiiWrite { .. }
                | ToolQuery::Record
        )
    }
}

/// An answer to a query of the tool.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum ToolAnswer {
    /// To [`ToolQuery::Master`].
    Master(Box<MasterReport>),
    /// To [`ToolQuery::SubDevices`].
    SubDevices(Piece<SubDeviceLine>),
    /// To [`ToolQuery::Description`].
    Description(Box<Description>),
    /// To [`ToolQuery::Ports`].
    Ports(Piece<PortsLine>),
    /// To [`ToolQuery::Objects`].
    Objects(Vec<u16>),
    /// To [`ToolQuery::Object`].
    Object(ObjectLine),
    /// To [`ToolQuery::Entry`].
    Entry(EntryLine),
    /// To [`ToolQuery::Declared`].
    Declared(Piece<DeclaredLine>),
    /// To [`ToolQuery::Domains`].
    Domains(Vec<DomainLine>),
    /// To [`ToolQuery::SiiImages`], in the order of the positions. The bytes of the message are the images, one behind
    /// the other.
    SiiImages(Vec<SiiLine>),
    /// To [`ToolQuery::Transfers`], the oldest first, at most [`MAX_TRANSFERS`].
    Transfers(Vec<TransferLine>),
    /// To [`ToolQuery::Ethernet`].
    Ethernet(Vec<EthernetLine>),
    /// To [`ToolQuery::Record`].
    Record(RecordLine),
}

/// A piece of a list.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Piece<T> {
    /// Number of entries of the whole list.
    pub total: u32,
    /// Entries of this piece.
    pub these: Vec<T>,
}
