//! Events of both halves.

mod cyclic;
pub mod history;
mod log;

use alloc::string::String;
use alloc::vec::Vec;

use ringcat_wire::address::{Position, StationAddress};
use ringcat_wire::al::{AlState, AlStatus, AlStatusCode};
use ringcat_wire::mailbox::coe::Emergency;
use ringcat_wire::sii::Identity;

pub use cyclic::CyclicEvent;
pub use log::EventLog;

pub use crate::ring_status::Occupant;

use crate::domain::DomainStatus;
use crate::info::IdentityField;
use crate::link::Link;
use crate::ring::FrameLimit;
use crate::ring_status::{Cable, CableErrors, RedundancyLoss};
use crate::time::Instant;
use crate::topology::{Closing, PortOf};

/// An event with its time.
#[derive(Clone, Debug, PartialEq)]
pub struct TimedEvent {
    /// The `now` of the call in which the engine saw it.
    pub at: Instant,
    /// What happened.
    pub event: Event,
    /// The SubDevices at the cabling positions that the event names, where known, as of that time: for a cable the one
    /// at its near end and the one at its far end.
    pub whom: [Option<Occupant>; 2],
}

impl TimedEvent {
    /// An event that names no cabling position, or one with an unknown SubDevice.
    pub const fn new(at: Instant, event: Event) -> TimedEvent {
        TimedEvent { at, event, whom: [None; 2] }
    }
}

/// All events. Declared SubDevices are named by their index in the declaration, others by position.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Event {
    /// A scan counted the SubDevices on each link.
    Counted {
        /// SubDevices that processed the main copy.
        main: u16,
        /// SubDevices that processed the redundant copy.
        redundant: u16,
    },
    /// Progress of a scan: SubDevices with their information read.
    ScanProgress {
        /// Number read.
        done: usize,
        /// Number found.
        total: usize,
    },
    /// A scan ended.
    ScanFinished {
        /// SubDevices found.
        subdevices: usize,
    },
    /// A problem that keeps a scan from being complete.
    ScanFailed {
        /// What and where.
        reason: String,
    },
    /// A fault in a SubDevice's SII that was worked around.
    SiiOddity {
        /// Position.
        position: Position,
        /// The fault.
        what: String,
    },
    /// Port 0 of a SubDevice is not connected though frames reach it: the frame is looped there, and a second such
    /// place destroys it (protocol 2.4).
    UnconnectedPort0 {
        /// Position.
        position: Position,
    },
    /// A SubDevice is entered at a port other than 0: its cables are swapped (protocol LC-01).
    LineCrossed {
        /// Position; `None` where only the ring shows that there is one (protocol LC-02).
        position: Option<Position>,
        /// The port of entry, where known.
        entry_port: Option<u8>,
    },
    /// All SubDevices of a ring are entered at another port than 0: the cables of the main and the redundant link are
    /// swapped (protocol LC-01). The ring works, as with any crossed line.
    InterfacesSwapped,
    /// A scan found a ring behind a junction (JR-03).
    JunctionLearned {
        /// Its closing cable, from the last SubDevice back to the junction; nodes are positions.
        closing: Closing,
    },
    /// The ports show rings behind junctions whose closing cable a scan in mode automatic did not find: frames were
    /// lost meanwhile, a junction does not close its ports on command, or there are more than 16 rings. Declared
    /// connections ([`JunctionMode::Strict`](crate::junction::JunctionMode)) need no such test.
    JunctionsNotLearned {
        /// Number of rings.
        rings: usize,
    },
    /// A cable of a ring behind a junction broke or is restored (JUNCTION_RED_CHANGE in Cable Redundancy). Nodes are
    /// positions of the cabling as it was last read.
    JunctionChanged {
        /// The port from which frames come; `None` until the ring has been seen closed.
        near: Option<PortOf>,
        /// The port that they reach. Behind a break it is port 0 of the SubDevice that is entered at another port; at
        /// the closing cable it is the junction's.
        far: PortOf,
        /// Station address of the SubDevice that they reach; `None` where no SubDevice has one there.
        station: Option<StationAddress>,
        /// Indices in the declaration of the SubDevices at both ends, `near` first.
        declared: [Option<usize>; 2],
        /// The cable broke.
        broken: bool,
        /// Broken cables of all such rings now. One is tolerated. With two in one ring the SubDevices between them are
        /// isolated; with two in different rings no frame comes back (JR-02).
        breaks: usize,
    },
    /// The ports show more rings behind junctions than are known: a ring was closed that was open at the scan (JR-03),
    /// or is not declared. Until it is known, its breaks are reported as crossed lines (JR-04).
    JunctionUnknown {
        /// Number of unknown rings.
        rings: usize,
    },
    /// No frame comes back while a ring behind a junction is open: with a second unconnected port 0 in one path, frames
    /// are destroyed (JR-02). Or the cable of the only link is broken too. With several such rings, each is then
    /// examined while the junctions isolate the others for a moment, and [`Event::JunctionChanged`] reports the broken
    /// cables.
    JunctionsBlocked {
        /// True when it begins, false when frames come back.
        blocked: bool,
        /// Cables of such rings that are known to be broken.
        breaks: usize,
    },
    /// The link layer cannot take a link down, so crossed lines in a closed ring cannot be located (LC-03).
    CannotDisconnect {
        /// The link.
        link: Link,
    },
    /// Another fault of a SubDevice's ports.
    CablingOddity {
        /// Position.
        position: Position,
        /// The fault.
        what: String,
    },
    /// Two SubDevices have the same alias.
    DuplicateAlias {
        /// The alias.
        alias: u16,
        /// First SubDevice that has it.
        first: Position,
        /// Second SubDevice that has it.
        second: Position,
    },
    /// The ring opened (RED_LINEBRK in Cable Redundancy).
    RingOpened {
        /// SubDevices on the main link.
        main: u16,
        /// SubDevices on the redundant link.
        redundant: u16,
    },
    /// The break is located, from the topology.
    BreakLocated {
        /// The cable that is broken; its ends are ports of SubDevices by position, or interfaces of the host.
        cable: Cable,
    },
    /// The ring closed again (RED_LINEFIXED).
    RingClosed {
        /// SubDevices on the main link.
        main: u16,
        /// SubDevices on the redundant link.
        redundant: u16,
        /// The cable that is restored: where the break was last located, if it was.
        place: Option<Cable>,
    },
    /// The ring opens and closes so often that single changes are no longer reported: the next one is, when the ring
    /// has been stable for a second.
    RingUnsteady {
        /// Number of changes since activation.
        changes: u32,
    },
    /// The ring tolerates no further break: the next one isolates SubDevices. This is no fault of the bus: all
    /// SubDevices are still reached.
    RedundancyLost {
        /// Reason.
        cause: RedundancyLoss,
    },
    /// The ring is closed again and passes frames both ways.
    RedundancyRegained,
    /// Frames are damaged repeatedly on a cable. Reported for each cable once in ten seconds at most.
    CableErrors {
        /// The cable.
        cable: Cable,
        /// Errors that its ends counted since the last report.
        errors: CableErrors,
    },
    /// An interface has lost its carrier.
    LinkDown {
        /// The interface.
        link: Link,
    },
    /// An interface has its carrier back.
    LinkUp {
        /// The interface.
        link: Link,
    },
    /// A SubDevice reached a state.
    StateReached {
        /// Index in the declaration.
        subdevice: usize,
        /// The state.
        state: AlState,
    },
    /// A SubDevice refused a state or left one by itself.
    StateError {
        /// Index in the declaration.
        subdevice: usize,
        /// The requested state; `None` where it changed by itself.
        requested: Option<AlState>,
        /// Its AL status.
        status: AlStatus,
        /// Reason.
        code: AlStatusCode,
    },
    /// A SubDevice no longer answers.
    Lost {
        /// Index in the declaration.
        subdevice: usize,
    },
    /// A SubDevice that was lost answers again.
    Returned {
        /// Index in the declaration.
        subdevice: usize,
    },
    /// The configuration of a SubDevice failed; it is retried.
    ConfigurationFailed {
        /// Index in the declaration.
        subdevice: usize,
        /// Step and reason.
        reason: String,
    },
    /// A setting in a declaration that the SubDevice may not follow.
    PlanOddity {
        /// Index in the declaration.
        subdevice: usize,
        /// The setting.
        what: String,
    },
    /// A start-up command read an object with another value than required.
    StartupRead {
        /// Index in the declaration.
        subdevice: usize,
        /// Number of the command in the declaration, from 0.
        number: usize,
        /// Index of the object.
        index: u16,
        /// Subindex of the object.
        sub_index: u8,
        /// Purpose of the command, as its declaration words it.
        comment: Option<String>,
        /// The value read.
        data: Vec<u8>,
    },
    /// A SubDevice sent a CoE emergency (protocol 6.3). The mailbox of each SubDevice also keeps its last ones.
    Emergency {
        /// Index in the declaration; before activation the position.
        subdevice: usize,
        /// Its content.
        emergency: Emergency,
    },
    /// A SubDevice without a declaration answers.
    Unexpected {
        /// Position.
        position: Position,
        /// Its identity.
        identity: Identity,
    },
    /// A rescan found a declared SubDevice at another place in the order than the scan did.
    Moved {
        /// Index in the declaration.
        subdevice: usize,
        /// Its place at the scan.
        from: Position,
        /// Its place now.
        to: Position,
    },
    /// A SubDevice of another identity is where a declared one is expected. It is not configured.
    Mismatch {
        /// Index in the declaration.
        subdevice: usize,
        /// Position.
        position: Position,
        /// The field that differs.
        field: IdentityField,
        /// Declared value.
        expected: u32,
        /// Value found.
        got: u32,
    },
    /// All SubDevices of a hot connect group are in the states that were declared.
    GroupJoined {
        /// Its number.
        group: usize,
    },
    /// Not all SubDevices of a hot connect group that had joined are in the declared states any more.
    GroupLeft {
        /// Its number.
        group: usize,
    },
    /// A declared SubDevice is absent.
    Missing {
        /// Index in the declaration.
        subdevice: usize,
        /// Whether the declaration allows its absence.
        optional: bool,
    },
    /// A frame of another MainDevice arrived (protocol MR-10). The first few are kept, all are counted.
    ForeignFrame {
        /// The link on which it arrived.
        arrived_on: Link,
        /// Its bytes without FCS.
        bytes: Vec<u8>,
    },
    /// Frames with more datagrams than this come back unprocessed: a gateway or simulator processes fewer than fit.
    /// Reported once.
    FrameLimit {
        /// The limit, and what happens to further datagrams.
        limit: FrameLimit,
    },
    /// The state of a domain changed.
    Domain {
        /// Number of the domain.
        domain: usize,
        /// The new state.
        status: DomainStatus,
    },
    /// A domain was due while its previous frames were still on the wire.
    Skipped {
        /// Number of the domain.
        domain: usize,
    },
    /// All clocks are locked (protocol 7.2).
    ClocksLocked {
        /// Largest |0x092C| in nanoseconds.
        largest_ns: u32,
    },
    /// The clock of another SubDevice is the reference now.
    ReferenceClock {
        /// Position in the scan; `None` where no clock is left.
        position: Option<Position>,
    },
    /// The segment has changed, and with it the propagation delays (protocol 7.1).
    DelaysChanged {
        /// Clocks with a new delay.
        clocks: usize,
        /// Largest change in nanoseconds.
        largest_ns: u32,
    },
    /// The propagation delay of a SubDevice cannot be measured: a fork without a clock is in front of it, and the
    /// latched times show only the sum of all its branches (protocol 7.1). Reported once, until the delay is known.
    DelayUnknown {
        /// Position in the scan.
        position: Position,
        /// Position of the fork; `None` where the way from the reference to this SubDevice is unknown.
        fork: Option<Position>,
        /// Lower and upper limit of the delay in nanoseconds; `None` where nothing is known.
        range_ns: Option<(i64, i64)>,
        /// The middle of the range was written. Otherwise no delay was.
        is_estimated: bool,
    },
    /// Distributed clocks could not be set up or measured; this is retried.
    ClocksFailed {
        /// Step and reason.
        reason: String,
    },
    /// The differences of the clocks entered or left the sync window.
    SyncWindow {
        /// True: within the sync window.
        inside: bool,
        /// OR of all |0x092C| in nanoseconds: at most twice the largest.
        spread_ns: u32,
    },
}

impl Event {
    /// Cabling positions that the event names; positions of the scan differ from those of a later reading of the
    /// cabling.
    fn positions(&self) -> [Option<usize>; 2] {
        match self {
            Event::BreakLocated { cable }
            | Event::CableErrors { cable, .. }
            | Event::RingClosed { place: Some(cable), .. } => cable.positions(),
            _ => [None; 2],
        }
    }
}
