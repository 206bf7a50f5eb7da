//! Data of the MainDevice's own objects.

use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;

use crate::procedures::shared_segment::SharedSegment;
use crate::supervisor::{AcyclicCounters, Bus};

/// Data of the objects at the time of a request.
#[derive(Clone, Debug)]
pub(crate) struct Seen {
    pub bus: Bus,
    /// Once active.
    pub segment: Option<SharedSegment>,
    /// Station addresses of the last scan, by position.
    pub scanned: Vec<StationAddress>,
    pub acyclic: AcyclicCounters,
}

impl Seen {
    pub(super) fn declared(&self) -> usize {
        self.segment.as_ref().map_or(0, |segment| segment.view().subdevices().member_count())
    }
}
