//! What follows from an observation.

use alloc::string::String;
use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;
use ringcat_wire::al::{AlStatus, AlStatusCode};

use super::start::Start;
use crate::declared::SubDeviceId;
use crate::event::Event;
use crate::ring_status::Occupant;

/// AL status and code that a SubDevice showed.
pub type Shown = (AlStatus, AlStatusCode);

/// One consequence. They are carried out in their order.
#[derive(Clone, Debug, PartialEq)]
pub enum Effect {
    /// An event for the application.
    Report(Event),
    /// An event about an identified SubDevice.
    ReportOf(Event, Occupant),
    /// Mail to and from a member stops until it is there again.
    SuspendMailbox {
        /// The member.
        index: usize,
    },
    /// Positions from here on are reached through the redundant link (protocol CR-09).
    MainCount(u16),
    /// Other SubDevices are at the positions of the cabling.
    Occupants(Vec<Occupant>),
    /// A procedure is to be started.
    Start(Task),
}

/// What has to be found out before a SubDevice is configured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Check {
    /// Nothing.
    None,
    /// Whether it is the member by its identity: another SubDevice may have its station address.
    Identity,
    /// The same of one that was lost, by what was written to it before: it may be one of an earlier session.
    Return,
}

/// A procedure on the bus. What it finds comes back as an observation.
#[derive(Clone, Debug, PartialEq)]
pub enum Task {
    /// All SubDevices are looked at.
    Look {
        /// Nothing has happened: a few at a time.
        routine: bool,
    },
    /// A member is brought to its target state, until it is there, it is lost, or another attempt begins.
    BringUp {
        /// The member.
        index: usize,
        /// Number of the attempt.
        attempt: u32,
        /// What is known of its registers.
        from: Start,
        /// Its error that is reported and still holds.
        told: Option<Shown>,
        /// What has to be found out first.
        check: Check,
    },
    /// A member's inputs are read until all are there.
    ProveInputs {
        /// The member.
        index: usize,
        /// Number of the mapping that they prove.
        mapping: u32,
    },
    /// The SII of a SubDevice without a declaration is read.
    ReadUnassigned {
        /// Its temporary address.
        station: StationAddress,
    },
    /// The segment is looked at for crossed lines.
    ExamineCabling {
        /// In a closed ring the redundant link may be taken down meanwhile (LC-03).
        in_control: bool,
    },
    /// Rings behind junctions are looked into, one after the other.
    IsolateRings,
    /// The reference time is distributed many times, as fast as the segment allows (protocol 7.2).
    CompensateDrift,
    /// The cabling is looked at anew, because a hot connect group has joined or left.
    FollowGroups,
}

/// All consequences of one observation.
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
