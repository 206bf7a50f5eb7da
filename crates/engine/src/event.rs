//! Events of both halves.

mod clients;
mod cyclic;
pub mod history;
mod log;
mod messages;
mod notice;
#[cfg(feature = "standby")]
mod standby;
mod startup_source;
mod subject;
mod timed;

use alloc::string::String;
use alloc::vec::Vec;

use ringcat_wire::address::{LogicalAddress, Position, StationAddress, Wkc};
use ringcat_wire::al::{AlState, AlStatus, AlStatusCode};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::mailbox::Protocol;
use ringcat_wire::mailbox::coe::Emergency;
use ringcat_wire::sii::Identity;

pub use clients::{ClientEvents, ClientId};
pub use cyclic::CyclicEvent;
pub use log::{EventLog, EventsSince};
pub use messages::{LogFilter, LogLevel, Message, MessageContent, MessagesSince};
pub(crate) use notice::Notice;
#[cfg(feature = "standby")]
pub use standby::{CyclicStandbyEvent, StandbyEvent};
pub use startup_source::StartupSource;
pub use subject::{Subject, Subjects};
pub use timed::TimedEvent;

pub use crate::ring_status::Occupant;

use crate::clocks::DelayRange;
use crate::declared::{Address, GroupId, SubDeviceId};
use crate::domain::{DomainId, DomainStatus};
use crate::info::IdentityField;
use crate::link::Link;
use crate::ring::FrameLimit;
use crate::ring_status::{Cable, CableErrors, RedundancyLoss};
use crate::topology::{Closing, PortOf};

/// All events. Declared SubDevices are named by their index in the declaration, others by position.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Event {
    /// A scan has counted the SubDevices on each link.
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
        /// The problem and its place.
        reason: String,
    },
    /// Without an application: SubDevices were connected or removed, and the segment was scanned again.
    SegmentChanged {
        /// SubDevices now.
        subdevices: usize,
        /// SubDevices that were not there before.
        added: usize,
        /// SubDevices that are no longer there.
        removed: usize,
    },
    /// The MainDevice goes on with a segment that another process has known, without a scan.
    Resumed {
        /// SubDevices now.
        subdevices: usize,
        /// SubDevices that go on as they are, in their states.
        in_state: usize,
        /// The segment was not as known: what differs was scanned.
        differs: bool,
    },
    /// The hand-over of the segment has cut a conversation with a mailbox: an SDO transfer and a file are aborted.
    ConversationCut {
        /// Position.
        position: Position,
        /// Protocol of the conversation.
        protocol: Protocol,
    },
    /// A SubDevice without a declaration did not reach its requested state.
    UndeclaredFailed {
        /// Position.
        position: Position,
        /// The reason.
        reason: String,
    },
    /// A SubDevice without a declaration has left its requested state without a request; it is brought back.
    UndeclaredState {
        /// Position.
        position: Position,
        /// Its AL status.
        status: AlStatus,
        /// Its AL status code.
        code: AlStatusCode,
    },
    /// A fault in a SubDevice's SII that was worked around.
    SiiWarning {
        /// Position.
        position: Position,
        /// The fault.
        what: String,
    },
    /// Port 0 of a SubDevice is not connected although frames reach it: the SubDevice loops the frame there, and a
    /// second such SubDevice destroys the frame (protocol 2.4).
    UnconnectedPort0 {
        /// Position.
        position: Position,
    },
    /// Frames enter a SubDevice at another port than 0: its cables are swapped (protocol LC-01).
    LineCrossed {
        /// Position; `None` if the crossed line is detected but not located (protocol LC-02).
        position: Option<Position>,
        /// The entry port, if known.
        entry_port: Option<u8>,
    },
    /// Frames enter all SubDevices of a ring at another port than 0: the cables of the main and the redundant link are
    /// swapped (protocol LC-01). The ring works, as with any crossed line.
    InterfacesSwapped,
    /// A scan found a ring behind a junction (JR-03).
    JunctionLearned {
        /// Its closing cable, from the last SubDevice back to the junction; nodes are positions.
        closing: Closing,
    },
    /// The port status shows rings behind junctions, but a scan in mode automatic did not find their closing cables:
    /// frames were lost meanwhile, a junction does not close its ports on command, or there are more than 16 rings.
    /// Declared connections ([`JunctionMode::Strict`](crate::junction::JunctionMode)) need no such test.
    JunctionsNotLearned {
        /// Number of rings.
        rings: usize,
    },
    /// A cable of a ring behind a junction broke or is restored (JUNCTION_RED_CHANGE in Cable Redundancy). Nodes are
    /// positions of the cabling as it was last read.
    JunctionChanged {
        /// The port from which frames come; `None` until the ring was closed once.
        near: Option<PortOf>,
        /// The port that frames reach: behind a break, the unconnected port 0 of a SubDevice; at the closing cable, the
        /// port of the junction.
        far: PortOf,
        /// Station address of the SubDevice with the port `far`; `None` if it is unknown.
        station: Option<StationAddress>,
        /// Indices in the declaration of the SubDevices at both ends, `near` first.
        declared: [Option<SubDeviceId>; 2],
        /// The cable broke.
        broken: bool,
        /// Number of broken cables of all such rings now. One is tolerated. With two in one ring, the SubDevices
        /// between them are isolated; with two in different rings, no frame comes back (JR-02).
        breaks: usize,
    },
    /// The port status shows more rings behind junctions than are known: a ring was open at the scan and is closed now
    /// (JR-03), or it is not declared. Until it is known, its breaks are reported as crossed lines (JR-04).
    JunctionUnknown {
        /// Number of unknown rings.
        rings: usize,
    },
    /// No frame comes back while a ring behind a junction is open: a second unconnected port 0 on the path destroys
    /// frames (JR-02), or the cable of the only link is broken too. With several such rings, each ring is then examined
    /// while the junctions isolate the others for a moment, and [`Event::JunctionChanged`] reports the broken cables.
    JunctionsBlocked {
        /// True when it begins, false when frames come back.
        blocked: bool,
        /// Cables of such rings that are known to be broken.
        breaks: usize,
    },
    /// The link layer cannot disconnect a link, so crossed lines in a closed ring cannot be located (LC-03).
    CannotDisconnect {
        /// The link.
        link: Link,
    },
    /// Another fault of a SubDevice's ports.
    CablingWarning {
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
    /// The break is located by the port status.
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
        /// The cable that is restored: the last located break, if any.
        place: Option<Cable>,
    },
    /// The ring opens and closes so often that changes are not reported until it has been stable for a second.
    RingUnsteady {
        /// Number of changes since activation.
        changes: u32,
    },
    /// The ring tolerates no further break: the next one isolates SubDevices. This is no fault of the bus: frames still
    /// reach all SubDevices.
    RedundancyLost {
        /// Reason.
        cause: RedundancyLoss,
    },
    /// The ring is closed again and passes frames in both directions.
    RedundancyRegained,
    /// Frames are damaged repeatedly on a cable. Reported for each cable at most once in ten seconds.
    CableErrors {
        /// The cable.
        cable: Cable,
        /// Errors counted at both ends since the last report.
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
        subdevice: SubDeviceId,
        /// The state.
        state: AlState,
    },
    /// A SubDevice refused a requested state, or left its state without a request.
    StateError {
        /// Index in the declaration.
        subdevice: SubDeviceId,
        /// The requested state; `None` if there was no request.
        requested: Option<AlState>,
        /// Its AL status.
        status: AlStatus,
        /// Reason.
        code: AlStatusCode,
    },
    /// A SubDevice no longer answers.
    Lost {
        /// Index in the declaration.
        subdevice: SubDeviceId,
    },
    /// A SubDevice that was lost answers again.
    Returned {
        /// Index in the declaration.
        subdevice: SubDeviceId,
    },
    /// The configuration of a SubDevice failed; it is retried.
    ConfigurationFailed {
        /// Index in the declaration.
        subdevice: SubDeviceId,
        /// Step and reason.
        reason: String,
    },
    /// A setting in a declaration that the SubDevice may not follow.
    DeclarationWarning {
        /// Index in the declaration.
        subdevice: SubDeviceId,
        /// The setting.
        what: String,
    },
    /// A start-up command without a required value read an object, an IDN or a file.
    StartupRead {
        /// Index in the declaration.
        subdevice: SubDeviceId,
        /// Number of the command in the declaration, from 0.
        number: usize,
        /// What was read.
        source: StartupSource,
        /// Purpose of the command, from its declaration.
        comment: Option<String>,
        /// The value, the data of the elements, or the contents.
        data: Vec<u8>,
    },
    /// A SubDevice sent a CoE emergency (protocol 6.3). The mailbox of each SubDevice also keeps those that were
    /// not taken, as many as fit.
    Emergency {
        /// The SubDevice: before activation by its position.
        subdevice: Address,
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
    /// A rescan found a declared SubDevice at another position than the scan.
    Moved {
        /// Index in the declaration.
        subdevice: SubDeviceId,
        /// Its position at the scan.
        from: Position,
        /// Its position now.
        to: Position,
    },
    /// A SubDevice of another identity is at the place of a declared one. It is not configured.
    Mismatch {
        /// Index in the declaration.
        subdevice: SubDeviceId,
        /// Position.
        position: Position,
        /// The field that differs.
        field: IdentityField,
        /// Declared value.
        expected: u32,
        /// Value found.
        got: u32,
    },
    /// All SubDevices of a hot connect group are in their declared target states.
    GroupJoined {
        /// Its number.
        group: GroupId,
    },
    /// SubDevices of a hot connect group that had joined left their declared target states.
    GroupLeft {
        /// Its number.
        group: GroupId,
    },
    /// A declared SubDevice is absent.
    Missing {
        /// Index in the declaration.
        subdevice: SubDeviceId,
        /// Whether the declaration allows its absence.
        optional: bool,
    },
    /// A frame of another MainDevice arrived (protocol MR-10). Only the first few are reported; all are counted.
    ForeignFrame {
        /// The link on which it arrived.
        arrived_on: Link,
        /// Its bytes without FCS.
        bytes: Vec<u8>,
    },
    /// A gateway or simulator processes fewer datagrams than fit into a frame. Reported once.
    FrameLimit {
        /// The limit, and what happens to further datagrams.
        limit: FrameLimit,
    },
    /// The state of a domain changed.
    Domain {
        /// Number of the domain.
        domain: DomainId,
        /// The new state.
        status: DomainStatus,
        /// Evaluated cycles of this interruption that were not complete; with a complete state those of the
        /// interruption that has ended.
        incomplete: u64,
    },
    /// On request ([`set_command_reports`](crate::main_device::MainDevice::set_command_reports)): a datagram of process
    /// data had a wrong working counter (EC_NOTIFY_CYCCMD_WKC_ERROR). At most once a second per datagram.
    CyclicCommand {
        /// Number of the domain.
        domain: DomainId,
        /// The command.
        command: Command,
        /// Its logical address.
        logical: LogicalAddress,
        /// Bytes of its data.
        length: u16,
        /// Expected in the last such cycle.
        expected: Wkc,
        /// Received then; 0 if no copy came back.
        got: Wkc,
        /// Cycles since the last report.
        cycles: u32,
        /// SubDevices that did not process it as expected meanwhile, or of which that is not known.
        subdevices: Vec<SubDeviceId>,
    },
    /// On request, too: an acyclic datagram had a wrong working counter. At most once a second per command and address.
    /// [`TimedEvent::occupants`] names the SubDevice.
    AcyclicCommand {
        /// The command.
        command: Command,
        /// Its address; none for commands to more than 64 addresses a second, which are reported together.
        target: Target,
        /// Expected.
        expected: Wkc,
        /// Working counter of the last of these datagrams.
        got: Wkc,
        /// Number of these datagrams since the last report.
        count: u32,
    },
    /// A domain was due while its previous frames were still on the wire.
    Skipped {
        /// Number of the domain.
        domain: DomainId,
    },
    /// All clocks are locked (protocol 7.2).
    ClocksLocked {
        /// Largest |0x092C| in nanoseconds.
        largest_ns: u32,
    },
    /// The clock of another SubDevice is the reference clock now.
    ReferenceClock {
        /// Position in the scan; `None` if no clock is left.
        position: Option<Position>,
    },
    /// Propagation delays changed with the segment (protocol 7.1).
    DelaysChanged {
        /// Clocks with a new delay.
        clocks: usize,
        /// Largest change in nanoseconds.
        largest_ns: u32,
    },
    /// The propagation delay of a SubDevice cannot be measured: a fork without a clock is upstream of it, and the
    /// latched times show only the sum of all its branches (protocol 7.1). Reported once, until the delay is known.
    DelayUnknown {
        /// Position in the scan.
        position: Position,
        /// Position of the fork; `None` if the path from the reference clock to this SubDevice is unknown.
        fork: Option<Position>,
        /// Limits of the delay; `None` if they are unknown.
        range: Option<DelayRange>,
        /// The middle of the range was written. Otherwise no delay was written.
        is_estimated: bool,
    },
    /// The set-up or measurement of distributed clocks failed; it is retried.
    ClocksFailed {
        /// Step and reason.
        reason: String,
    },
    /// Clocks were not locked in time, and a SubDevice with SYNC signals went on (`WhenUnlocked::GoOn`).
    WentOnUnlocked {
        /// Index in the declaration.
        subdevice: SubDeviceId,
        /// The clock that is not locked, and its difference.
        reason: String,
    },
    /// The clocks follow another time of the application, its first one or after a jump. Both values are signed.
    ApplicationTime {
        /// Nanoseconds by which the system time of all clocks has jumped; 0 while SYNC signals run.
        jump_ns: i64,
        /// Application time minus system time from now on, in nanoseconds.
        shift_ns: i64,
    },
    /// The differences of the clocks entered or left the sync window.
    SyncWindow {
        /// True: within the sync window.
        inside: bool,
        /// OR of all |0x092C| in nanoseconds: at most twice the largest.
        spread_ns: u32,
    },
    /// An event of MainDevice redundancy.
    #[cfg(feature = "standby")]
    Standby(StandbyEvent),
}
