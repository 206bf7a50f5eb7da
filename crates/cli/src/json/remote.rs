//! What `ringcat remote --json` prints.

use ringcat::standby::remote::{RemoteCounters, RemoteState};
use serde::Serialize;

/// One of two MainDevices, as it answers.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Remote {
    /// Version of its program
    pub program: String,
    /// `active` or `inactive`
    pub role: &'static str,
    /// Permanent standby: it takes over on request only
    pub is_permanent_standby: bool,
    /// It has an application: it follows the ACTIVE, or drives the bus
    pub has_application: bool,
    /// Why a failure of one MainDevice would cost more than a takeover; empty if it would not
    pub not_ready: Vec<String>,
    /// Changes of its role since its start
    pub role_changes: u32,
    /// The ring: `closed`, `open` or `unknown`
    pub ring: String,
    /// Its main link has a carrier; null where that is not known
    pub main_link_up: Option<bool>,
    /// Its redundant link has a carrier; null where that is not known
    pub redundant_link_up: Option<bool>,
    /// State of each declared SubDevice, such as `OP`, `absent`, `configuring` or `unknown`
    pub subdevices: Vec<String>,
    /// Cycles of its application, in both roles
    pub cycles: u64,
    /// Its counters as ACTIVE
    pub counters: RemoteFrames,
    /// As INACTIVE: what the ACTIVE has reported; null otherwise
    pub of_active: Option<RemoteFrames>,
    /// Frames that it has sent on at its main link as INACTIVE
    pub forwarded_on_main_frames: u64,
    /// The same at its redundant link
    pub forwarded_on_redundant_frames: u64,
    /// Of these, sent back at the link on which they came
    pub sent_back_frames: u64,
    /// Frames that it has not forwarded
    pub not_forwarded_frames: u64,
}

/// Frames and cycles of an ACTIVE.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct RemoteFrames {
    /// Frames that left
    pub sent_frames: u64,
    /// Frames of which no copy came back
    pub lost_frames: u64,
    /// Cycles without complete process data
    pub incomplete_cycles: u64,
    /// Frames of another MainDevice
    pub foreign_frames: u64,
}

impl From<RemoteCounters> for RemoteFrames {
    fn from(counters: RemoteCounters) -> RemoteFrames {
        RemoteFrames {
            sent_frames: counters.sent,
            lost_frames: counters.lost,
            incomplete_cycles: counters.incomplete,
            foreign_frames: counters.foreign,
        }
    }
}

impl Remote {
    /// The answer of a program.
    pub fn new(program: &str, state: &RemoteState) -> Remote {
        let [main_link_up, redundant_link_up] = state.carriers;
        let [forwarded_on_main_frames, forwarded_on_redundant_frames] = state.forwarded;
        Remote {
            program: program.to_owned(),
            role: if state.is_active { "active" } else { "inactive" },
            is_permanent_standby: state.is_held,
            has_application: state.has_application,
            not_ready: state.not_ready.clone(),
            role_changes: state.role_changes,
            ring: state.ring.clone(),
            main_link_up,
            redundant_link_up,
            subdevices: state.subdevices.clone(),
            cycles: state.cycles,
            counters: state.counters.into(),
            of_active: state.of_active.map(RemoteFrames::from),
            forwarded_on_main_frames,
            forwarded_on_redundant_frames,
            sent_back_frames: state.sent_back,
            not_forwarded_frames: state.not_forwarded,
        }
    }
}
