//! What was seen, heard or done: all that changes the model.

use alloc::boxed::Box;
use alloc::rc::Rc;
use alloc::string::String;
use core::time::Duration;

use ringcat_wire::address::{StationAddress, Wkc};
use ringcat_wire::al::AlState;
use ringcat_wire::register::DlControl;

use super::asked::Asked;
use super::clocks::ClockObservation;
use super::crossings::LineCheck;
use super::disturbance::Wanted;
use super::look::Look;
use super::looked::Looked;
use super::port_control::BlockedPort;
use super::ring::Words;
use super::seen::Seen;
use super::start::Start;
use super::view::View;
use crate::info::SubDeviceInfo;
use crate::ring_status::CableErrors;
use crate::topology::NodeStatus;

/// What a SubDevice does in process data from now on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProcessDataStep {
    /// Nothing is counted on any more.
    Off,
    /// Its FMMUs are about to be cleared.
    Unmapped,
    /// Both.
    Left,
    /// Its FMMUs are about to be set.
    Mapped,
    /// It is counted on, for its inputs as soon as they were seen.
    Joined,
}

/// Something that was observed.
#[derive(Debug)]
pub enum Observation<'a> {
    /// What the exchange has posted, and what the links tell.
    Words(Words),
    /// A round of looks has brought this so far. `others`: answers of SubDevices without a declaration.
    PartOfLooks {
        /// What it was about.
        asked: Asked,
        /// By member.
        looks: &'a [Look],
        /// Answers of SubDevices without a declaration.
        others: usize,
        /// SubDevices that the latest supervision result counts.
        counted: Option<Wkc>,
    },
    /// A round of looks is complete.
    Looks(Looked<'a>),
    /// What followed from a round of looks is done. With the number of the latest supervision result.
    RoundEnded(Option<u32>),
    /// Another round is called for.
    LookAgain,
    /// Another round is called for after a pause.
    LookAgainIn(Duration),

    /// The configuration of all members that are there may begin.
    Started(Start),
    /// They will be configured later: what answers meanwhile has not come back.
    Delayed,
    /// A member reached a state.
    Reached {
        /// The member.
        index: usize,
        /// The attempt.
        attempt: u32,
        /// The state.
        state: AlState,
    },
    /// What answers at a lost member's address is that member.
    Returned {
        /// The member.
        index: usize,
        /// The attempt that found it out.
        attempt: u32,
    },
    /// What answers at a lost member's address is another SubDevice, or cannot be identified.
    NotReturned {
        /// The member.
        index: usize,
        /// The attempt that found it out.
        attempt: u32,
    },
    /// A member does not answer.
    Unreachable {
        /// The member.
        index: usize,
        /// The attempt that found it out.
        attempt: u32,
    },
    /// A member's registers hold its configuration, or no longer do.
    Configured {
        /// The member.
        index: usize,
        /// They do.
        is: bool,
    },
    /// A member's registers do not hold what was written to them.
    Undone {
        /// The member.
        index: usize,
        /// Its attempt when they were read.
        attempt: u32,
        /// What is not there.
        reason: String,
    },
    /// What a member does in process data from now on.
    ProcessData {
        /// The member.
        index: usize,
        /// What it does.
        step: ProcessDataStep,
    },
    /// A member was seen to give all its inputs.
    Proven {
        /// The member.
        index: usize,
        /// Number of the mapping for which they were read.
        mapping: u32,
    },
    /// The application wants a member in another state.
    Requested {
        /// The member.
        index: usize,
        /// The state.
        state: AlState,
    },
    /// A member has refused that.
    Refused {
        /// The member.
        index: usize,
        /// The attempt.
        attempt: u32,
        /// The state that was its target before.
        before: AlState,
    },
    /// A member's SII was read again.
    ReadAgain {
        /// The member.
        index: usize,
        /// What it says.
        info: &'a SubDeviceInfo,
    },

    /// What has happened to members is counted from 0 again.
    IncidentsForgotten,

    /// Where SubDevices are, all of which are known.
    Places(&'a View),
    /// These addresses are taken from the SubDevices that have them.
    Readdressing(&'a [StationAddress]),
    /// Temporary addresses were given.
    Given {
        /// Where SubDevices are with them.
        view: &'a View,
        /// The addresses.
        given: &'a [StationAddress],
    },
    /// An unassigned SubDevice was read, or could not be: then why, where that is to be told.
    Read {
        /// Its address.
        station: StationAddress,
        /// What it is.
        read: Result<Rc<SubDeviceInfo>, Option<String>>,
    },
    /// An unassigned SubDevice is none of the declared ones.
    Unexpected(StationAddress),
    /// An unassigned SubDevice is a member and does not fit.
    Misfit {
        /// Its address.
        station: StationAddress,
        /// The member.
        index: usize,
        /// Why.
        reason: String,
    },
    /// An unassigned SubDevice may be this member, or another one of the same kind.
    Held {
        /// Its address.
        station: StationAddress,
        /// The member.
        index: usize,
    },
    /// An unassigned SubDevice has got the address of the member that it is.
    Admitted {
        /// Its address until then.
        station: StationAddress,
        /// The member.
        index: usize,
        /// What it is.
        info: Box<SubDeviceInfo>,
    },

    /// The segment was looked at for crossed lines.
    LineChecked {
        /// What was found; `None` where it changes too much to tell.
        found: Option<LineCheck>,
        /// The redundant link was down meanwhile.
        in_control: bool,
    },
    /// The whole segment was looked at.
    Rescanned {
        /// What was found.
        seen: Seen<'a>,
        /// What was posted then.
        words: Words,
    },
    /// The cabling was followed up to so many changes of hot connect groups.
    GroupsFollowed(u32),
    /// Cables have counted errors since the last look. By their number in the cabling that was asked about.
    CableErrors {
        /// What it was about.
        asked: Asked,
        /// Those that are new.
        fresh: &'a [CableErrors],
    },

    /// Clocks were measured, written, read or lost.
    Clocks(ClockObservation<'a>),

    /// A disturbance is wanted.
    Wanted(Wanted),
    /// The one with this number has been undone, or is not wanted any more.
    Undisturbed(u32),
    /// Rings behind junctions have been looked into, and all is as before.
    Isolated {
        /// What it was about.
        asked: Asked,
        /// What SubDevices said about their ports, by position.
        found: &'a [Option<NodeStatus>],
        /// What was posted then.
        words: Words,
    },
    /// A junction is about to get an order about its ports.
    PortsOrdered {
        /// The junction.
        station: StationAddress,
        /// What.
        control: DlControl,
    },
    /// It has got it.
    PortsTold(StationAddress),
    /// The order that a junction has was read, after so many orders.
    PortsRead {
        /// The junction.
        station: StationAddress,
        /// Orders by then.
        orders: u32,
        /// What it said.
        control: DlControl,
    },
    /// Ports were closed to cut a SubDevice off.
    Blocked(&'a [BlockedPort]),
    /// They are about to be opened.
    Unblocking,
}
