//! A change of the segment without an application, to be followed by a scan.

use crate::ring_status::LinkCounts;

/// What the broadcast has shown when a scan after a change begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Change {
    /// SubDevices on each link.
    pub counts: LinkCounts,
    /// The ECAT event of ports is set.
    pub ports_changed: bool,
    /// No link has a carrier.
    pub is_unplugged: bool,
    /// Number of the request for a rescan that it answers.
    pub wanted: Option<u64>,
}
