//! Requests that a device served, for tests to look at.

use ringcat_wire::al::AlState;
use ringcat_wire::mailbox::Protocol;

use crate::time::SimTime;

/// A request that was served.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ServedMail {
    /// When.
    pub at: SimTime,
    /// In which state.
    pub state: AlState,
    /// Protocol.
    pub protocol: Protocol,
    /// What follows the mailbox header.
    pub payload: Vec<u8>,
}
