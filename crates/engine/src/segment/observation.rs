//! Observations: all inputs that change the model.

use alloc::boxed::Box;
use alloc::rc::Rc;
use alloc::string::String;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::{StationAddress, Wkc};
use ringcat_wire::al::AlState;
use ringcat_wire::register::DlControl;

use super::addressed::Addressed;
use super::clocks::ClockObservation;
use super::crossings::LineCheck;
use super::disturbance::Wanted;
use super::effect::Shown;
use super::findings::{DeclarationFinding, ScanFinding};
use super::idle::IdleObservation;
use super::key::SubDeviceKey;
use super::link_order::LinkObservation;
use super::model::Declared;
use super::pdo_finding::PdoFinding;
use super::port_control::BlockedPort;
use super::reading::Reading;
use super::round_result::RoundResult;
use super::scan::{Found, Scan};
use super::seen::Seen;
use super::temporary_address::TemporaryAddress;
use super::undeclared::UndeclaredObservation;
use super::versions::Versions;
use super::view::View;
use super::words::Words;
#[cfg(feature = "standby")]
use crate::board::live::Life;
use crate::declared::Move;
use crate::info::{DataWord, SubDeviceInfo};
use crate::ring::FrameLimit;
use crate::ring_status::CableErrors;
use crate::topology::NodeStatus;

/// An observation of MainDevice redundancy.
#[cfg(feature = "standby")]
#[derive(Debug)]
pub enum StandbyObservation<'a> {
    /// This MainDevice controls the bus from now on, with process data of another one.
    TookOver {
        /// The members as the other MainDevice has seen them.
        lives: &'a [Life],
        /// The states come from another MainDevice, not from the time when this MainDevice was ACTIVE.
        is_of_other: bool,
        /// They keep their configuration; otherwise they get it again from INIT on.
        is_hot: bool,
    },
    /// Another MainDevice controls the bus from now on: procedures have ended.
    Yielded,
    /// Another MainDevice controls the bus, and may have posted other states of the members.
    Mirrored,
}

/// How a SubDevice takes part in process data from now on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProcessDataStep {
    /// It takes no part: no working counter expects it.
    Off,
    /// Its FMMUs are about to be cleared.
    Unmapped,
    /// It takes no part, and its FMMUs are about to be cleared.
    Left,
    /// Its FMMUs are about to be set.
    Mapped,
    /// The working counter expects it; its inputs as soon as they were proven.
    Joined,
}

/// Why an attempt to bring up a member has failed.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Problem {
    /// It refused a state.
    Refused {
        /// The requested state.
        requested: AlState,
        /// Its AL status and code.
        shown: Shown,
    },
    /// Another reason, in words.
    Other(String),
}

/// What an attempt to bring up a member has found.
#[derive(Debug)]
pub enum MemberFinding<'a> {
    /// It reached this state.
    Reached(AlState),
    /// The SubDevice at the lost member's address is the member.
    Returned,
    /// The SubDevice at the lost member's address is another one, or cannot be identified.
    NotReturned,
    /// It does not answer.
    Unreachable,
    /// Its registers hold its configuration, or no longer do.
    Configured(bool),
    /// Its registers do not hold the written values; the missing value.
    Undone(String),
    /// Its registers hold the written values, after its configuration was repeated.
    Held,
    /// How it takes part in process data from now on.
    ProcessData(ProcessDataStep),
    /// The attempt has failed; it is repeated, or given up.
    Failed(Problem),
    /// It shows an error that is not reported yet.
    Shows(Shown),
    /// It refused the requested state; the previous target state.
    Refused(AlState),
    /// Its SII was read again.
    ReadAgain(&'a SubDeviceInfo),
    /// It cannot be read again; the reason.
    NotReadAgain(String),
    /// What it refuses differs from its own description.
    SettingFinding(String),
    /// Something was found about the PDOs in its dictionary.
    Pdos(PdoFinding<'a>),
}

/// What is read of a SubDevice after its scan.
#[derive(Clone, Debug)]
pub enum More<'a> {
    /// The whole SII; the scan reads some SIIs only in part.
    Sii(&'a SubDeviceInfo),
    /// Words of its memory by which declarations may find it; without words that its memory does not have.
    DataWords(Vec<DataWord>),
    /// The alias that was written into its EEPROM, where aliases are those of SIIs.
    Alias(u16),
}

/// An observation.
#[derive(Debug)]
pub enum Observation<'a> {
    /// Words posted by the exchange, or without an application the answer to a broadcast, and carriers of the links.
    Words(Words),
    /// The course of an order to the link layer.
    Link(LinkObservation),
    /// Observations without an application.
    Idle(IdleObservation<'a>),
    /// Intermediate result of a round of reads. `others`: answers of SubDevices without a declaration.
    PartOfRound {
        /// Version of the model at the request.
        versions: Versions,
        /// Readings of the members, by index.
        readings: &'a [Reading],
        /// Answers of SubDevices without a declaration.
        others: usize,
        /// SubDevices that the latest supervision result counts.
        counted: Option<Wkc>,
    },
    /// A round of reads is complete.
    Round(RoundResult<'a>),
    /// All effects of a round of reads are completed. With the number of the latest supervision result.
    RoundEnded(Option<u32>),
    /// Another round is requested.
    RoundWanted,
    /// Another round is requested after a pause.
    RoundWantedIn(Duration),
    /// It is about to be tested how many datagrams a frame may hold: no other test is necessary for some time.
    FramesTested,
    /// A frame may hold this number of datagrams: no other test is necessary. It is refused if the cabling has changed
    /// since the test began, or SubDevices were out of reach on purpose.
    FramesLimited {
        /// Version of the model when the test began.
        versions: Versions,
        /// The limit.
        limit: FrameLimit,
    },

    /// A scan that the application has requested begins, with new station addresses.
    ScanBegun,
    /// What it has found beside its result, in the order of the reports; refused if it was given up.
    ScanShows {
        /// The findings.
        findings: Vec<ScanFinding>,
        /// SubDevices that were found.
        subdevices: usize,
    },
    /// It has ended; the reason if it failed.
    ScanEnded(Result<Scan, String>),
    /// The segment was scanned again without an application; SubDevices in place have kept their addresses.
    FoundAgain {
        /// Version of the model at the request.
        versions: Versions,
        /// The SubDevices.
        found: Rc<Found>,
    },
    /// More data of a scanned SubDevice was read. The observation is refused if another SubDevice has got the address
    /// since.
    MoreRead {
        /// The SubDevice at the request.
        key: SubDeviceKey,
        /// What was read.
        more: More<'a>,
    },
    /// A finding of the comparison of a declaration with the scan. There is no wait between both and this.
    Compared(DeclarationFinding),
    /// An application declares SubDevices.
    Activated(Box<Declared>),
    /// Both halves have the declaration: the procedures of the application begin. The configuration begins at once, or
    /// with clocks when they are set up: an answer meanwhile is not a return.
    Attached,
    /// The application ends. The result of the scan stays.
    Deactivated,
    /// What another MainDevice of the ring does, or has done.
    #[cfg(feature = "standby")]
    Standby(StandbyObservation<'a>),

    /// The configuration of all present members may begin.
    Started,
    /// A finding of an attempt to bring up a member. It is refused if that is no longer the current attempt: the member
    /// was lost, or another attempt has begun.
    OfMember {
        /// The member.
        index: usize,
        /// The attempt.
        attempt: u32,
        /// The finding.
        finding: MemberFinding<'a>,
    },
    /// A member has delivered all its inputs.
    Proven {
        /// The member.
        index: usize,
        /// Number of the mapping for which they were read.
        mapping: u32,
    },
    /// A member does not deliver its inputs.
    NotProven {
        /// The member.
        index: usize,
        /// Number of the mapping for which they were read.
        mapping: u32,
        /// What is missing.
        what: String,
    },
    /// The application requests a state of a SubDevice.
    Requested {
        /// The SubDevice.
        subdevice: Addressed,
        /// The state.
        state: AlState,
    },

    /// The application requests that failed attempts are repeated now: of a SubDevice, or of all.
    Retried(Option<Addressed>),

    /// States of SubDevices without a declaration, and attempts to reach them.
    Undeclared(UndeclaredObservation<'a>),

    /// The incident counters of members are reset.
    IncidentsForgotten,

    /// Positions of SubDevices, all of which are known.
    Places {
        /// Version of the model at the request.
        versions: Versions,
        /// Their positions.
        view: &'a View,
    },
    /// These addresses are taken away from the SubDevices that have them.
    Readdressing(&'a [StationAddress]),
    /// This temporary address is about to be assigned, or was not needed: it is not used again before all others.
    Offered(StationAddress),
    /// Temporary addresses were assigned.
    Given {
        /// Version of the model when the positions were requested.
        versions: Versions,
        /// Positions of the SubDevices with these addresses.
        view: &'a View,
        /// The addresses.
        given: &'a [TemporaryAddress],
    },
    /// A search for SubDevices without a known address has ended; the reason if not all are known. A failure is refused
    /// if station addresses have changed since, or SubDevices were out of reach on purpose: it is one of another
    /// segment.
    Searched {
        /// Version of the model when the search last read addresses.
        versions: Versions,
        /// The result.
        result: Result<(), String>,
    },
    /// An unassigned SubDevice was read, or could not be: then with the reason, if it is to be reported.
    Read {
        /// The SubDevice.
        key: SubDeviceKey,
        /// Its data.
        read: Result<Rc<SubDeviceInfo>, Option<String>>,
    },
    /// An unassigned SubDevice matches no declaration.
    Unexpected(SubDeviceKey),
    /// An unassigned SubDevice is a member but does not fit its declaration. It is refused if the member has come back
    /// since.
    Misfit {
        /// The unassigned SubDevice.
        key: SubDeviceKey,
        /// The member.
        index: usize,
        /// The member's attempt when it was compared.
        attempt: u32,
        /// What does not fit.
        reason: String,
    },
    /// An unassigned SubDevice may be this member, or another one of the same kind. It is refused as a misfit is.
    Held {
        /// The unassigned SubDevice.
        key: SubDeviceKey,
        /// The member.
        index: usize,
        /// The member's attempt when it was compared.
        attempt: u32,
    },
    /// An unassigned SubDevice was identified as a member and has got its address.
    Admitted {
        /// The unassigned SubDevice.
        key: SubDeviceKey,
        /// The member.
        index: usize,
        /// The member's attempt when it was identified.
        attempt: u32,
        /// Its data.
        info: Box<SubDeviceInfo>,
    },

    /// A check for crossed lines has ended.
    LineChecked {
        /// Version of the model at the request.
        versions: Versions,
        /// The result; `None` if the segment changed too often for a result.
        found: Option<LineCheck>,
        /// The redundant link was down during the check.
        in_control: bool,
    },
    /// Declared SubDevices that a rescan has found at other positions: from, and to.
    Moved {
        /// Version of the model at the request.
        versions: Versions,
        /// The moves.
        moved: Vec<Move>,
    },
    /// A rescan of the whole segment has ended.
    Rescanned {
        /// Version of the model at the request.
        versions: Versions,
        /// The result.
        seen: Seen<'a>,
        /// Words posted at that time.
        words: Words,
    },
    /// The cabling was followed up to this number of changes of hot connect groups.
    GroupsFollowed(u32),
    /// Cables have counted errors since the last reading. By number in the cabling of that version.
    CableErrors {
        /// Version of the model at the request.
        versions: Versions,
        /// The new errors.
        fresh: &'a [CableErrors],
    },

    /// Clocks were measured, written, read or lost.
    Clocks(ClockObservation<'a>),

    /// A disturbance is requested.
    Wanted(Wanted),
    /// The disturbance with this number has been undone, or is no longer requested.
    Undisturbed(u32),
    /// An examination of rings behind junctions has ended without changes.
    Isolated {
        /// Version of the model at the request.
        versions: Versions,
        /// Port states of the SubDevices, by position.
        found: &'a [Option<NodeStatus>],
        /// Words posted at that time.
        words: Words,
    },
    /// Port commands to this SubDevice are stored from now on.
    PortsFollowed(StationAddress),
    /// Ports of these SubDevices are about to be changed for a moment; with their settings before. None: they are
    /// restored, or expire. It is no finding that may be outdated: only the disturbance under way alters ports, and
    /// what the application orders since the settings were read is counted ([`Observation::PortsOrdered`]) and
    /// restored.
    PortsAltered(&'a [(StationAddress, DlControl)]),
    /// A port command to a SubDevice whose commands are stored is about to be sent.
    PortsOrdered {
        /// The SubDevice.
        station: StationAddress,
        /// The command.
        control: DlControl,
    },
    /// The SubDevice has got the command.
    PortsWritten(StationAddress),
    /// The port control of such a SubDevice was read, after this number of commands.
    PortsRead {
        /// The SubDevice.
        station: StationAddress,
        /// Commands up to then.
        orders: u32,
        /// The value read.
        control: DlControl,
    },
    /// Ports were closed to cut a SubDevice off. It is no finding that may be outdated: they stay closed until this
    /// MainDevice opens them, whatever the segment does.
    Blocked(&'a [BlockedPort]),
    /// The closed ports are about to be opened.
    Unblocking,
}
