//! What happened: the events of both halves.

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

/// An event with the time at which the engine saw it.
#[derive(Clone, Debug, PartialEq)]
pub struct TimedEvent {
    /// The `now` of the call in which it was seen.
    pub at: Instant,
    /// What happened.
    pub event: Event,
    /// Who was at the positions of the cabling that the event names when it was seen, where that is known: for a cable
    /// at its near end and at its far one.
    pub whom: [Option<Occupant>; 2],
}

impl TimedEvent {
    /// An event that names nobody by a position of the cabling, or of whom nothing is known.
    pub const fn new(at: Instant, event: Event) -> TimedEvent {
        TimedEvent { at, event, whom: [None; 2] }
    }
}

/// What can happen. SubDevices that were declared are named by their index in the declaration, others by position.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Event {
    /// A scan counted the SubDevices on each link.
    Counted {
        /// Met by the main copy.
        main: u16,
        /// Met by the redundant copy.
        redundant: u16,
    },
    /// SubDevices whose information a scan has read so far.
    ScanProgress {
        /// Done.
        done: usize,
        /// Of.
        total: usize,
    },
    /// A scan ended.
    ScanFinished {
        /// SubDevices found.
        subdevices: usize,
    },
    /// Something that keeps a scan from being complete.
    ScanFailed {
        /// What and where.
        reason: String,
    },
    /// Something odd in a SubDevice's SII that was worked around.
    SiiOddity {
        /// Where.
        position: Position,
        /// What.
        what: String,
    },
    /// Port 0 of a SubDevice is not connected though frames reach it: the frame is looped there and may pass no second
    /// such place (protocol 2.4).
    UnconnectedPort0 {
        /// Where.
        position: Position,
    },
    /// A SubDevice is entered at a port other than 0: its cables are swapped (protocol LC-01).
    LineCrossed {
        /// Where; `None` where only the ring shows that there is one (protocol LC-02).
        position: Option<Position>,
        /// The port of entry, where known.
        entry_port: Option<u8>,
    },
    /// All SubDevices of a ring are entered at another port than 0: the main link is plugged in where the redundant one
    /// belongs, and the other way round (protocol LC-01). All works, as with any crossed line.
    InterfacesSwapped,
    /// A scan found a ring behind a junction (JR-03).
    JunctionLearned {
        /// Its closing cable, from the last SubDevice back to the junction; nodes are positions.
        closing: Closing,
    },
    /// The ports show rings behind junctions of which a scan in mode automatic did not find out where they close:
    /// frames got lost meanwhile, a junction does not close its ports on demand, or there are more than 16. Declared
    /// connections ([`JunctionMode::Strict`](crate::junction::JunctionMode)) need no tries.
    JunctionsNotLearned {
        /// How many.
        rings: usize,
    },
    /// A cable of a ring behind a junction broke or is whole again (JUNCTION_RED_CHANGE in Cable Redundancy). Nodes are
    /// positions, of the cabling as it was found last.
    JunctionChanged {
        /// The port from which frames come; `None` where the ring has not been seen whole yet.
        near: Option<PortOf>,
        /// The port that they reach. Behind a break it is port 0 of the SubDevice that is entered from behind; at the
        /// closing cable it is the junction's.
        far: PortOf,
        /// The SubDevice that they reach: its station address, `None` where nobody has one there.
        station: Option<StationAddress>,
        /// Indices in the declaration of the SubDevices at both ends, `near` first.
        declared: [Option<usize>; 2],
        /// It broke.
        broken: bool,
        /// Broken cables of all such rings now. One is tolerated; with two, SubDevices between them in one ring are cut
        /// off, or no frame comes back where they are in two rings (JR-02).
        breaks: usize,
    },
    /// The ports show more rings behind junctions than are known: one was closed that was open when the segment was
    /// scanned (JR-03), or is not declared. Its breaks read as crossed lines (JR-04) until it is.
    JunctionUnknown {
        /// How many are not known.
        rings: usize,
    },
    /// No frame comes back while a ring behind a junction is open: with a second unconnected port 0 in one path, frames
    /// are destroyed (JR-02). Or the cable of the only link is broken too. Where there are several such rings, each is
    /// looked into then while its junctions leave the others out for a moment, and what is broken is told by
    /// [`Event::JunctionChanged`].
    JunctionsBlocked {
        /// True when it begins, false when frames come back.
        blocked: bool,
        /// Cables of such rings that are known to be broken.
        breaks: usize,
    },
    /// The link layer cannot take a link down, so crossed lines in a closed ring have no place (LC-03).
    CannotDisconnect {
        /// The link.
        link: Link,
    },
    /// Something else that is odd about a SubDevice's ports.
    CablingOddity {
        /// Where.
        position: Position,
        /// What.
        what: String,
    },
    /// Two SubDevices have one alias.
    DuplicateAlias {
        /// The alias.
        alias: u16,
        /// First SubDevice that has it.
        first: Position,
        /// Second one.
        second: Position,
    },
    /// The ring opened (RED_LINEBRK in Cable Redundancy).
    RingOpened {
        /// SubDevices on the main link.
        main: u16,
        /// SubDevices on the redundant link.
        redundant: u16,
    },
    /// The place of the break, from the topology.
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
        /// The cable that is whole again: where the break was located last, if it was.
        place: Option<Cable>,
    },
    /// The ring opens and closes so often that not every change is told any more: the next one when it has been steady
    /// for a second.
    RingUnsteady {
        /// How often it changed since activation.
        changes: u32,
    },
    /// The next break isolates somebody. This is no fault of the bus: everybody is still reached.
    RedundancyLost {
        /// Why.
        cause: RedundancyLoss,
    },
    /// The ring is closed again and passes frames both ways.
    RedundancyRegained,
    /// Frames get damaged on a cable, again and again. Told of each cable once in ten seconds at the most.
    CableErrors {
        /// Which cable.
        cable: Cable,
        /// What its ends have counted since it was told of last.
        errors: CableErrors,
    },
    /// An interface has no carrier any more.
    LinkDown {
        /// Which one.
        link: Link,
    },
    /// An interface has its carrier back.
    LinkUp {
        /// Which one.
        link: Link,
    },
    /// A SubDevice reached a state.
    StateReached {
        /// Index in the declaration.
        subdevice: usize,
        /// The state.
        state: AlState,
    },
    /// A SubDevice refused a state or fell out of one.
    StateError {
        /// Index in the declaration.
        subdevice: usize,
        /// What was asked for; `None` where it fell by itself.
        requested: Option<AlState>,
        /// What AL status says.
        status: AlStatus,
        /// Why.
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
    /// The configuration of a SubDevice failed; it is tried again.
    ConfigurationFailed {
        /// Index in the declaration.
        subdevice: usize,
        /// What and why.
        reason: String,
    },
    /// Something in a declaration that the SubDevice may not follow.
    PlanOddity {
        /// Index in the declaration.
        subdevice: usize,
        /// What.
        what: String,
    },
    /// A start-up command has read an object without a value that it must have.
    StartupRead {
        /// Index in the declaration.
        subdevice: usize,
        /// Number of the command in the declaration, from 0.
        number: usize,
        /// Index of the object.
        index: u16,
        /// Subindex of the object.
        sub_index: u8,
        /// What the command is for, in the words of its declaration.
        comment: Option<String>,
        /// What came.
        data: Vec<u8>,
    },
    /// A SubDevice sent a CoE emergency (protocol 6.3). The last ones of each SubDevice are kept with its mailbox, too.
    Emergency {
        /// Index in the declaration; before activation the position.
        subdevice: usize,
        /// What it says.
        emergency: Emergency,
    },
    /// A SubDevice that was not declared answers.
    Unexpected {
        /// Where.
        position: Position,
        /// Who.
        identity: Identity,
    },
    /// A rescan found a declared SubDevice at another place among the others than the scan.
    Moved {
        /// Index in the declaration.
        subdevice: usize,
        /// Its place at the scan.
        from: Position,
        /// Its place now.
        to: Position,
    },
    /// Another SubDevice is where a declared one is expected. It is left alone.
    Mismatch {
        /// Index in the declaration.
        subdevice: usize,
        /// Where.
        position: Position,
        /// What differs.
        field: IdentityField,
        /// What was declared.
        expected: u32,
        /// What is there.
        got: u32,
    },
    /// All SubDevices of a hot connect group are in the states that were declared.
    GroupJoined {
        /// Its number.
        group: usize,
    },
    /// Of a hot connect group that had joined not all SubDevices are in the states that were declared any more.
    GroupLeft {
        /// Its number.
        group: usize,
    },
    /// A declared SubDevice is not there.
    Missing {
        /// Index in the declaration.
        subdevice: usize,
        /// Whether the declaration allows that.
        optional: bool,
    },
    /// A frame of another MainDevice arrived (protocol MR-10). The first few are kept, all are counted.
    ForeignFrame {
        /// Where it arrived.
        arrived_on: Link,
        /// Its bytes without FCS.
        bytes: Vec<u8>,
    },
    /// Frames that hold more datagrams do not bring them back processed: a gateway or simulator takes fewer than fit.
    /// Told once.
    FrameLimit {
        /// How many may be in a frame, and what becomes of more.
        limit: FrameLimit,
    },
    /// The judgement of a domain changed.
    Domain {
        /// Number of the domain.
        domain: usize,
        /// The new judgement.
        status: DomainStatus,
    },
    /// A domain was due while its frames were still out.
    Skipped {
        /// Number of the domain.
        domain: usize,
    },
    /// All clocks are locked (protocol 7.2).
    ClocksLocked {
        /// Largest |0x092C| in nanoseconds.
        largest_ns: u32,
    },
    /// Another SubDevice's clock is the reference now.
    ReferenceClock {
        /// Where in the scan; `None` where nobody is left.
        position: Option<Position>,
    },
    /// The segment has changed, and propagation delays with it (protocol 7.1).
    DelaysChanged {
        /// Clocks with another delay.
        clocks: usize,
        /// Largest change in nanoseconds.
        largest_ns: u32,
    },
    /// The propagation delay of a SubDevice cannot be measured: a fork without a clock is in front of it, and times
    /// that were latched show only what all branches of that take together (protocol 7.1). Told once, until it is
    /// known.
    DelayUnknown {
        /// Where in the scan.
        position: Position,
        /// Position of the fork; `None` where it is not known what is between this SubDevice and the reference.
        fork: Option<Position>,
        /// The least and the most that it may be, in nanoseconds; `None` where nothing is known.
        range_ns: Option<(i64, i64)>,
        /// The middle of that was written. Otherwise no delay was.
        is_estimated: bool,
    },
    /// Distributed clocks could not be set up or measured; it is tried again.
    ClocksFailed {
        /// What and why.
        reason: String,
    },
    /// The differences of the clocks came into their window or left it.
    SyncWindow {
        /// They are inside.
        inside: bool,
        /// OR of all |0x092C| in nanoseconds: at most twice the largest.
        spread_ns: u32,
    },
}

impl Event {
    /// Positions of the cabling that it names; those of a scan and of a look since are others.
    fn positions(&self) -> [Option<usize>; 2] {
        match self {
            Event::BreakLocated { cable }
            | Event::CableErrors { cable, .. }
            | Event::RingClosed { place: Some(cable), .. } => cable.positions(),
            _ => [None; 2],
        }
    }
}
