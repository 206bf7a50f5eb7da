//! What `ringcat standby --json` prints.

use ringcat::standby::ForwardingCounters;
use serde::Serialize;

/// Frames that an INACTIVE MainDevice has received.
#[derive(Clone, Debug, Serialize)]
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
        }
    }
}
