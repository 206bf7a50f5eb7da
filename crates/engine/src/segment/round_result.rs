//! Result of a round of scans.

use ringcat_wire::address::{StationAddress, Wkc};

use super::member::Phase;
use super::reading::Reading;
use super::versions::Versions;

/// Result of a round of scans.
#[derive(Clone, Copy, Debug)]
pub struct RoundResult<'a> {
    /// Version of the model at the start of the round.
    pub versions: Versions,
    /// By member.
    pub readings: &'a [Reading],
    /// Phase of each member when the round began.
    pub before: &'a [Phase],
    /// SubDevices without a declaration, by station address.
    pub unassigned: &'a [(StationAddress, Reading)],
    /// SubDevices that the latest supervision result counts; `None` before the first.
    pub counted: Option<Wkc>,
}
