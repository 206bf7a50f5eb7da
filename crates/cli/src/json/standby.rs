//! What `ringcat standby --json` prints.

use ringcat::standby::ForwardingCounters;
use serde::Serialize;

/// Frames that were received as INACTIVE; with a declaration those with process data, since there is an application.
#[derive(Clone, Debug, Default, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Standby {
    /// Sent on at the main link
    pub forwarded_on_main_frames: u64,
    /// Sent on at the redundant link
    pub forwarded_on_redundant_frames: u64,
    /// Of these, sent back at the link on which they came, because the other one was down
    pub sent_back_frames: u64,
    /// Of these, frames with the identity of this MainDevice, which it has not sent
    pub same_identity_frames: u64,
    /// Not sent: forwarded on that link before
    pub repeated_frames: u64,
    /// Not sent: own frames
    pub own_frames: u64,
    /// Not sent: no EtherCAT frames with datagrams
    pub other_frames: u64,
    /// Not sent: too old, because this MainDevice was stopped
    pub outdated_frames: u64,
    /// Not sent: no link was up
    pub no_link_frames: u64,
    /// Roles; null without a declaration
    pub takeover: Option<Takeover>,
}

/// Roles of one of two MainDevices.
#[derive(Clone, Debug, Default, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Takeover {
    /// `active` or `inactive`, before the end
    pub role: &'static str,
    /// An application ran: an ACTIVE was followed, or none was there
    pub has_joined: bool,
    /// Changes of the role, with that from INACTIVE at the beginning
    pub role_changes: u64,
    /// Of these, takeovers of a running bus
    pub takeovers: u64,
    /// Of these, takeovers after which all SubDevices were configured again from INIT on
    pub warm_takeovers: u64,
    /// Frames of another ACTIVE that were reported
    pub collisions: u64,
    /// Number of alarms: no ACTIVE, and this MainDevice did not take over
    pub alarms: u64,
    /// Differences of the configuration that were reported
    pub configuration_differences: u64,
    /// Why a failure of one MainDevice would have cost more than a takeover, before the end; empty if ready
    pub not_ready: Vec<&'static str>,
    /// Switchovers on a schedule; null without `--switch-every`
    pub switchovers: Option<Switchovers>,
    /// The other MainDevice was ready to take over at the end
    pub partner_ready: bool,
    /// The role was handed over at the end
    pub handed_over: bool,
    /// The bus was stopped at the end: outputs zero, all SubDevices in INIT
    pub stopped: bool,
}

/// Switchovers on a schedule.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Switchovers {
    /// This MainDevice has handed its role over
    pub done: u64,
    /// It has not: not ready, or the other MainDevice did not take the role
    pub refused: u64,
    /// Longest time from the request to the end of the role, in nanoseconds; null before the first
    pub longest_ns: Option<u64>,
}

impl From<&ForwardingCounters> for Standby {
    fn from(counters: &ForwardingCounters) -> Standby {
        Standby {
            forwarded_on_main_frames: counters.on_main,
            forwarded_on_redundant_frames: counters.on_redundant,
            sent_back_frames: counters.sent_back,
            same_identity_frames: counters.same_identity,
            repeated_frames: counters.again,
            own_frames: counters.own,
            other_frames: counters.not_ethercat,
            outdated_frames: counters.too_old,
            no_link_frames: counters.no_link,
            takeover: None,
        }
    }
}
