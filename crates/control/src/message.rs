//! What a daemon, its clients and the owner of a master say to each other.
//!
//! A message is typed content, and bytes where data is in it. A change of any type here changes [`crate::VERSION`].

use std::ops::RangeInclusive;
use std::time::Duration;

pub use ringcat_engine::main_device::snapshot::{Activity, CableSnapshot, ClockSnapshot, RingSnapshot, Snapshot};
use serde::{Deserialize, Serialize};

pub use crate::information::SegmentOverview;
pub use crate::owner::Owner;
use crate::refusal::Refusal;
use crate::settings::BusSettings;
pub use crate::tool::{ToolAnswer, ToolQuery};

/// Longest time for most answers.
const USUAL: Duration = Duration::from_secs(30);
/// Longest time for answers that wait for flash memory of a SubDevice.
const LONG: Duration = Duration::from_secs(600);
/// Network interfaces of EoE of a master: their descriptors fit into a message.
pub const MOST_INTERFACES: usize = 48;
/// Debug interfaces of a master: one for each link.
pub const MOST_DEBUG_INTERFACES: usize = 2;
const _: () = assert!(MOST_INTERFACES + MOST_DEBUG_INTERFACES + 5 <= ringcat_link::descriptors::MOST);

/// A message.
#[derive(Clone, Debug, PartialEq)]
pub struct Message {
    /// Its content.
    pub content: Content,
    /// Data: of an object, of registers, of an SII, or knowledge of a segment. Empty where none belongs to it.
    pub bytes: Vec<u8>,
}

impl From<Content> for Message {
    fn from(content: Content) -> Message {
        Message { content, bytes: Vec::new() }
    }
}

/// The content of a message.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Content {
    /// First message of a client.
    Hello {
        /// Its name, for logs.
        program: String,
    },
    /// Answer of the daemon to [`Content::Hello`].
    Welcome {
        /// What the client may do.
        right: Right,
        /// Process id of the daemon.
        pid: u32,
    },
    /// A query: of a client to the daemon, of the daemon to an owner.
    Query(Numbered<Query>),
    /// An owner has accepted a query, and answers when it is done.
    Underway {
        /// Number of the query.
        id: u32,
    },
    /// The answer.
    Answer(Numbered<Result<Answer, Refusal>>),
    /// A client requests a master, to drive it.
    Take {
        /// Number of the master.
        master: u32,
        /// It moves frames between network interfaces of EoE and mailboxes.
        ethernet: bool,
    },
    /// The client drives it. Descriptors come with the message, in the order of [`HandedBus`]; its bytes are what is
    /// known of the segment, empty if nothing is known.
    Taken(HandedBus),
    /// An owner needs a network interface for a SubDevice with EoE.
    MakeInterface {
        /// Its name.
        name: String,
        /// Its address.
        mac: [u8; 6],
    },
    /// The answer, with the descriptor of the interface.
    Interface {
        /// Its name.
        name: String,
        /// Why there is none.
        fault: Option<String>,
    },
    /// An owner orders a link down, so that its partner detects that, or up again.
    SwitchLink {
        /// The redundant link.
        is_redundant: bool,
        /// Up.
        up: bool,
    },
    /// Known data of the segment after a scan, from an owner, in the bytes.
    Knowledge,
    /// An owner gives the master back, and sends nothing any more. The bytes are its knowledge; empty without
    /// any.
    Release,
    /// The daemon drives the master again, after a release.
    Released,
    /// The daemon drives the master again, without a release: what the client sends reaches no SubDevice.
    TakenBack {
        /// Why, as in the log of the daemon.
        cause: String,
    },
    /// The connection ends, and why.
    Refused(Refusal),
}

/// A query, or the answer to the query with the same number.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Numbered<T> {
    /// Number, chosen by the side that sends the query.
    pub id: u32,
    /// Number of the master; that of a query about all masters is not used.
    pub master: u32,
    /// Question or answer.
    pub what: T,
}

/// What a client may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Right {
    /// Queries that change nothing.
    Read,
    /// Also change states, objects and registers, and drive a master.
    Change,
}

/// A query. SubDevices have their positions in the ring, whether an application is active or not.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Query {
    /// All masters and their owners.
    Masters,
    /// The whole state of a master, its SubDevices with it.
    State,
    /// Events from a number on, at most 256 of them.
    Events {
        /// Number of the first.
        from: u64,
    },
    /// AL status and AL status code of a SubDevice.
    AlStatus {
        /// Its position.
        position: u16,
    },
    /// Reads an object.
    SdoUpload {
        /// Position of the SubDevice.
        position: u16,
        /// Index.
        index: u16,
        /// Sub-index; `None` for complete access.
        sub_index: Option<u8>,
    },
    /// Writes an object with the bytes of the message.
    SdoDownload {
        /// Position of the SubDevice.
        position: u16,
        /// Index.
        index: u16,
        /// Sub-index; `None` for complete access.
        sub_index: Option<u8>,
    },
    /// Reads registers.
    RegisterRead {
        /// Position of the SubDevice.
        position: u16,
        /// First register.
        address: u16,
        /// Number of bytes, 1 to 1,024.
        length: u16,
    },
    /// Writes registers with the bytes of the message, 1 to 1,024.
    RegisterWrite {
        /// Position of the SubDevice.
        position: u16,
        /// First register.
        address: u16,
    },
    /// Requests a state: 1 INIT, 2 PREOP, 3 BOOT, 4 SAFEOP, 8 OP.
    RequestState {
        /// Position of the SubDevice.
        position: u16,
        /// The state, as in register AL_CONTROL.
        state: u8,
    },
    /// Scans the segment again.
    Rescan,
    /// What a broadcast shows of all SubDevices now.
    Overview,
    /// Reads the value of an IDN.
    IdnRead {
        /// Position of the SubDevice.
        position: u16,
        /// Drive behind it, 0 to 7.
        drive: u8,
        /// The IDN.
        idn: u16,
    },
    /// Writes the value of an IDN with the bytes of the message.
    IdnWrite {
        /// Position of the SubDevice.
        position: u16,
        /// Drive behind it, 0 to 7.
        drive: u8,
        /// The IDN.
        idn: u16,
    },
    /// Queries of the command line tool, and of clients that need the same.
    Tool(ToolQuery),
}

impl Query {
    /// Longest time for the answer of the process that drives the master.
    pub fn limit(&self) -> Duration {
        match self {
            Query::Tool(ask) if ask.is_long() => LONG,
            _ => USUAL,
        }
    }

    /// The right that it needs.
    pub fn right(&self) -> Right {
        match self {
            Query::Masters
            | Query::State
            | Query::Events { .. }
            | Query::AlStatus { .. }
            | Query::SdoUpload { .. }
            | Query::Overview
            | Query::IdnRead { .. } => Right::Read,
            Query::RegisterRead { address, length, .. } => right_to_read(*address, *length),
            Query::Tool(ask) if ask.is_reading() => Right::Read,
            Query::Tool(_)
            | Query::SdoDownload { .. }
            | Query::RegisterWrite { .. }
            | Query::RequestState { .. }
            | Query::Rescan
            | Query::IdnWrite { .. } => Right::Change,
        }
    }
}

/// Registers whose reading changes something: SYNC status and latch times, which reading acknowledges, and the memory
/// of process data and mailboxes, where reading the last byte frees a buffer.
const CHANGED_BY_READING: [RangeInclusive<u32>; 3] = [0x098E..=0x098F, 0x09AE..=0x09CF, 0x1000..=0x1_FFFF];

/// The right that reading these registers needs.
fn right_to_read(address: u16, length: u16) -> Right {
    let first = u32::from(address);
    let last = first + u32::from(length).saturating_sub(1);
    let is_changed = CHANGED_BY_READING.iter().any(|range| first <= *range.end() && last >= *range.start());
    if is_changed { Right::Change } else { Right::Read }
}

/// An answer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Answer {
    /// To [`Query::Masters`].
    Masters(Vec<MasterState>),
    /// To [`Query::State`].
    State(Box<Snapshot>),
    /// To [`Query::Events`].
    Events {
        /// Identifies the numbering: another epoch means that it began anew.
        epoch: u64,
        /// Events that are no longer kept.
        missed: u64,
        /// The number to go on with.
        next: u64,
        /// Oldest first.
        events: Vec<EventLine>,
    },
    /// To [`Query::AlStatus`].
    AlStatus {
        /// Register AL_STATUS: state, error bit 0x10.
        status: u16,
        /// Register AL_STATUS_CODE.
        code: u16,
    },
    /// What was read is in the bytes of the message.
    Data,
    /// The query was carried out; there is no data.
    Done,
    /// To [`Query::Overview`].
    Overview(SegmentOverview),
    /// To [`Query::Tool`].
    Tool(ToolAnswer),
}

/// A master.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct MasterState {
    /// Its number.
    pub master: u32,
    /// Its links, as in the option of the daemon.
    pub links: String,
    /// The application that drives it; `None` while the daemon does.
    pub owner: Option<Owner>,
    /// Why nothing drives it; `None` while it is driven.
    pub fault: Option<String>,
}

/// An event.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct EventLine {
    /// Its number.
    pub number: u64,
    /// Time in nanoseconds of the monotonic clock.
    pub at_ns: u64,
    /// One line for the operator.
    pub text: String,
}

/// A master that is handed over. Descriptors follow in this order: those of the links, a lock, network interfaces,
/// debug interfaces.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct HandedBus {
    /// Its links.
    pub links: HandedLinks,
    /// A lock comes with them, which the client keeps for as long as it drives the master.
    pub has_lock: bool,
    /// Network interfaces of EoE.
    pub interfaces: Vec<String>,
    /// Debug interfaces, at most [`MOST_DEBUG_INTERFACES`]: `ecdbgmX` of the main link, `ecdbgbX` of the backup link.
    pub debug_interfaces: Vec<String>,
    /// The daemon can switch links ([`Content::SwitchLink`]).
    pub can_switch: bool,
    /// Level of messages: 0 to 2, above as 2 ([`ToolQuery::SetDebugLevel`]). It outlasts hand-overs.
    pub debug_level: u32,
    /// Settings, for the daemon and for applications.
    pub settings: BusSettings,
}

/// The links of a master that is handed over. Descriptors follow in this order: cyclic half main, redundant; acyclic
/// half main, redundant.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct HandedLinks {
    /// The main link.
    pub main: HandedLink,
    /// The redundant link.
    pub redundant: Option<HandedLink>,
}

/// A link, with a socket for each half.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum HandedLink {
    /// Pipes to a simulated segment.
    Pipe,
    /// Packet sockets on an interface. Places in their rings are found.
    Interface {
        /// Its name.
        name: String,
        /// Slots of each ring.
        slots: u32,
        /// The address that stands for it while it is absent: the daemon binds the sockets when it comes. `None`: it is
        /// there.
        absent_mac: Option<[u8; 6]>,
    },
}

impl MasterState {
    /// A master with these links that the daemon drives.
    pub const fn new(master: u32, links: String) -> MasterState {
        MasterState { master, links, owner: None, fault: None }
    }
}

impl HandedBus {
    /// These links and nothing else.
    pub fn new(links: HandedLinks) -> HandedBus {
        let settings = BusSettings::default();
        let (interfaces, debug_interfaces) = (Vec::new(), Vec::new());
        HandedBus { links, has_lock: false, interfaces, debug_interfaces, can_switch: false, debug_level: 0, settings }
    }
}

impl HandedLinks {
    /// Names of the links, the main one first: those of interfaces, otherwise what they are.
    pub fn names(&self) -> Vec<String> {
        let name = |link: &HandedLink, of_pipe: &str| match link {
            HandedLink::Interface { name, .. } => name.clone(),
            HandedLink::Pipe => of_pipe.to_owned(),
        };
        let redundant = self.redundant.as_ref().map(|link| name(link, "redundant"));
        std::iter::once(name(&self.main, "main")).chain(redundant).collect()
    }

    /// One link, or two.
    pub const fn new(main: HandedLink, redundant: Option<HandedLink>) -> HandedLinks {
        HandedLinks { main, redundant }
    }

    /// Number of descriptors that come with it.
    pub fn descriptors(&self) -> usize {
        if self.redundant.is_some() { 4 } else { 2 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: daemon
    #[test]
    fn to_read_registers_that_reading_changes_needs_the_right_to_change() {
        let right = |address, length| Query::RegisterRead { position: 0, address, length }.right();
        for (address, length) in [(0, 1024), (0x0130, 2), (0x0900, 0x8E), (0x0990, 0x1E), (0x09D0, 2), (0x0FFF, 1)] {
            assert_eq!(right(address, length), Right::Read, "{address:#x}, {length}");
        }
        for (address, length) in [(0x0900, 0x8F), (0x098E, 1), (0x09CF, 1), (0x0FFF, 2), (0x1000, 0), (0xFFFF, 0xFFFF)]
        {
            assert_eq!(right(address, length), Right::Change, "{address:#x}, {length}");
        }
    }
}
