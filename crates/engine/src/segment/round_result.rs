//! Result of a round of reads.

use ringcat_wire::address::Wkc;

use super::key::SubDeviceKey;
use super::member::Phase;
use super::reading::Reading;
use super::versions::Versions;

/// Result of a round of reads.
#[derive(Clone, Copy, Debug)]
pub struct RoundResult<'a> {
    /// Version of the model at the start of the round.
    pub versions: Versions,
    /// Readings of the members, by index.
    pub readings: &'a [Reading],
    /// Phase of each member when the round began.
    pub before: &'a [Phase],
    /// SubDevices without a declaration.
    pub unassigned: &'a [(SubDeviceKey, Reading)],
    /// SubDevices that the latest supervision result counts; `None` before the first.
    pub counted: Option<Wkc>,
}
