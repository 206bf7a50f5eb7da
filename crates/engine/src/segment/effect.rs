//! Effects of an observation.

use alloc::string::String;
use alloc::vec::Vec;

use ringcat_wire::address::Position;
use ringcat_wire::al::{AlState, AlStatus, AlStatusCode};

use super::idle::Change;
use super::key::SubDeviceKey;
use super::start::Start;
use crate::declared::SubDeviceId;
use crate::event::Event;
use crate::link::LinkOrder;
use crate::ring_status::Occupant;

/// AL status and code of a SubDevice.
pub type Shown = (AlStatus, AlStatusCode);

/// One effect. Effects are executed in their order.
#[derive(Clone, Debug, PartialEq)]
pub enum Effect {
    /// An event for the application.
    Report(Event),
    /// An event about an identified SubDevice.
    ReportOf(Event, Occupant),
    /// Mail to and from a member stops until it is present again.
    SuspendMailbox {
        /// The member.
        index: usize,
    },
    /// The SubDevices without a declaration that have mailboxes now, at their positions.
    Mailboxes(Vec<(SubDeviceKey, Position)>),
    /// Positions from here on are reached through the redundant link (protocol CR-09).
    MainCount(u16),
    /// The SubDevices at the positions of the cabling have changed.
    Occupants(Vec<Occupant>),
    /// An order waits for the link layer; none does any more with `None`.
    OrderLink(Option<LinkOrder>),
    /// A procedure is to be started.
    Start(Task),
}

/// Check before a SubDevice is configured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Check {
    /// No check.
    None,
    /// Whether it is the member, by its identity: another SubDevice may have its station address.
    Identity,
    /// Whether it is the lost member, by the registers written to it before: the SubDevice may be one of an earlier
    /// session.
    Return,
}

/// A procedure that runs as long as the application, or as long as there is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Watch {
    /// Sets up the clocks and supervises them.
    Clocks,
    /// Supervises clocks that another MainDevice has set up.
    #[cfg(feature = "standby")]
    AdoptedClocks,
    /// Passes posted words to the model.
    Supervision,
    /// Compares registers with the written values.
    Registers,
    /// Reads error counters.
    Errors,
    /// Reads in the background what the scan left out of the SIIs.
    Siis,
    /// Reads the mail status of mailboxes.
    Mail,
    /// Serves requests of the cyclic thread.
    Requests,
    /// Reads the statistics of all SubDevices.
    Statistics,
    /// Without an application: broadcasts.
    Idle,
    /// Reports when attempts of undeclared SubDevices are due.
    Undeclared,
    /// Reads the mail status of undeclared SubDevices.
    UndeclaredMail,
    /// Without an application: reads object dictionaries.
    Dictionaries,
}

/// A procedure on the bus. It returns its result as an observation.
#[derive(Clone, Debug, PartialEq)]
pub enum Task {
    /// Reads all SubDevices: which answer, in which state, with which ports.
    Round {
        /// Nothing has changed: a few SubDevices at a time.
        routine: bool,
    },
    /// Brings a member to its target state, until it is reached, the member is lost, or another attempt begins.
    BringUp {
        /// The member.
        index: usize,
        /// Number of the attempt.
        attempt: u32,
        /// State of its registers.
        from: Start,
        /// Its error that is reported and still present.
        reported: Option<Shown>,
        /// The check before it.
        check: Check,
    },
    /// Brings a member to a state that the application requests; after a refusal back to the state before.
    ChangeState {
        /// The member.
        index: usize,
        /// Number of the attempt.
        attempt: u32,
        /// Its target state before.
        before: AlState,
    },
    /// Sends the commands of a member whose state the application requests again.
    RepeatState {
        /// The member.
        index: usize,
        /// Number of the attempt.
        attempt: u32,
    },
    /// Reads a member's inputs until all have been delivered.
    ProveInputs {
        /// The member.
        index: usize,
        /// Number of the mapping to prove.
        mapping: u32,
    },
    /// Reads the SII of a SubDevice without a declaration.
    ReadUnassigned {
        /// The SubDevice.
        key: SubDeviceKey,
    },
    /// Brings a SubDevice without a declaration to its requested state, once.
    BringUndeclared {
        /// The SubDevice.
        key: SubDeviceKey,
        /// Number of the attempt.
        attempt: u32,
    },
    /// Reads the PDOs in the dictionary of a SubDevice without a declaration that is in its requested state.
    ReadPdos {
        /// The SubDevice.
        key: SubDeviceKey,
        /// Number of the attempt that has reached the state.
        attempt: u32,
    },
    /// Writes the outputs of a SubDevice without a declaration as long as it is to stay in OP.
    KeepOutputs {
        /// The SubDevice.
        key: SubDeviceKey,
        /// Number of the attempt that has reached OP.
        attempt: u32,
    },
    /// Scans the segment without an application for the first time.
    ScanSegment {
        /// Its number.
        number: u32,
    },
    /// Scans it again after a change, or on request.
    FollowChange(Change),
    /// Reads the states of all SubDevices that are kept in their states.
    ReadStates,
    /// Runs as long as the application, or as long as there is none.
    Watch(Watch),
    /// Scans the segment for crossed lines.
    ExamineCabling {
        /// In a closed ring the redundant link may be taken down for it (LC-03).
        in_control: bool,
    },
    /// Examines rings behind junctions, one after the other.
    IsolateRings,
    /// Distributes the reference time many times, as fast as the segment allows (protocol 7.2).
    CompensateDrift,
    /// Scans the cabling again, because a hot connect group has joined or left.
    FollowGroups,
}

/// All effects of one observation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Effects(pub Vec<Effect>);

impl Effects {
    /// Reports an event.
    pub(super) fn report(&mut self, event: Event) {
        self.0.push(Effect::Report(event));
    }

    /// Reports an event about a SubDevice.
    pub(super) fn report_of(&mut self, event: Event, occupant: Occupant) {
        self.0.push(Effect::ReportOf(event, occupant));
    }

    /// Starts a procedure.
    pub(super) fn start(&mut self, task: Task) {
        self.0.push(Effect::Start(task));
    }

    /// Reports that a member could not be configured.
    pub(super) fn failed(&mut self, subdevice: usize, reason: String) {
        self.report(Event::ConfigurationFailed { subdevice: SubDeviceId(subdevice), reason });
    }
}
