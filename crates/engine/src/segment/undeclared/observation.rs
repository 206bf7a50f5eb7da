//! Observations of SubDevices without a declaration.

use ringcat_wire::address::StationAddress;
use ringcat_wire::al::AlState;

use super::upkeep::{AttemptFailure, UpkeepProgress};
use crate::segment::effect::Shown;
use crate::segment::key::SubDeviceKey;
use crate::segment::pdo_finding::PdoFinding;

/// The state of a SubDevice without a declaration was read.
#[derive(Clone, Copy, Debug)]
pub struct StateRead {
    /// The SubDevice.
    pub key: SubDeviceKey,
    /// The attempt that had reached its state when the read was requested; without one only the address counts.
    pub attempt: Option<u32>,
    /// The result.
    pub shown: ShownState,
}

/// What a read of the state of one SubDevice has shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShownState {
    /// Its frames were lost: no information.
    Unknown,
    /// Its station address is not, or not only, its own.
    Elsewhere,
    /// Its AL status and code.
    Shown(Shown),
}

/// The requested state of a SubDevice that another process has kept, as its registers show it now.
#[derive(Clone, Copy, Debug)]
pub struct KeptState {
    /// Its station address.
    pub station: StationAddress,
    /// The requested state.
    pub target: AlState,
    /// Progress towards it.
    pub progress: UpkeepProgress,
    /// What it shows, if it has left the state that it had reached.
    pub has_left: Option<Shown>,
}

/// An observation of SubDevices without a declaration. Their requested states are observed as those of members.
#[derive(Debug)]
pub enum UndeclaredObservation<'a> {
    /// They are kept in their requested states until the application ends.
    KeepingBegun,
    /// Each of them without a requested state is to go to PREOP.
    TakenOver,
    /// Another process has kept some of them in their states: this one goes on with these. The others are to go to
    /// PREOP if SubDevices are kept in their requested states.
    HandedOver(&'a [KeptState]),
    /// The time has come at which attempts are due.
    AttemptsDue,
    /// An attempt to bring one to its requested state has ended.
    AttemptEnded {
        /// The SubDevice.
        key: SubDeviceKey,
        /// The attempt.
        attempt: u32,
        /// Why it has failed; `None` if the state was reached.
        failure: Option<AttemptFailure>,
    },
    /// Something was found about the PDOs in the dictionary of one.
    Pdos {
        /// The SubDevice.
        key: SubDeviceKey,
        /// The finding.
        finding: PdoFinding<'a>,
    },
    /// The object dictionary of one was read, or cannot be.
    DictionaryRead {
        /// The SubDevice.
        key: SubDeviceKey,
        /// The attempt after which it was requested.
        attempt: u32,
    },
    /// States were read.
    StatesRead(&'a [StateRead]),
    /// The application forces a state of one, which then is left as it is.
    Forced(SubDeviceKey),
}
