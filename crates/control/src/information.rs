//! What is seen of a segment now, in numbers of the registers.

use serde::{Deserialize, Serialize};

/// What a broadcast shows of all SubDevices now.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct SegmentOverview {
    /// SubDevices that processed the copy on the main link, and on the redundant link.
    pub counts: [u16; 2],
    /// Their AL states, ORed.
    pub al_states: u8,
    /// Which links are up.
    pub is_up: [bool; 2],
    /// There are two links.
    pub is_ring: bool,
    /// SubDevices that the last scan has found.
    pub found: u32,
    /// The segment is scanned and no scan runs.
    pub is_scanned: bool,
    /// A scan runs.
    pub scans: bool,
}

impl SegmentOverview {
    /// SubDevices on both links.
    pub fn responding(&self) -> u16 {
        self.counts[0].saturating_add(self.counts[1])
    }
}
