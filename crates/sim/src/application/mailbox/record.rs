//! Record of the requests that a device served, for tests.

use ringcat_wire::al::AlState;
use ringcat_wire::mailbox::Protocol;

use crate::time::SimTime;

/// A served request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ServedMail {
    /// Time.
    pub at: SimTime,
    /// AL state.
    pub state: AlState,
    /// Protocol.
    pub protocol: Protocol,
    /// Data after the mailbox header.
    pub payload: Vec<u8>,
}
