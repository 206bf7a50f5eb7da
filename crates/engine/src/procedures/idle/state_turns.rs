//! Which SubDevices have their states read with the next broadcast.

use alloc::vec::Vec;

use crate::procedures::shared_segment::SharedSegment;
use crate::segment::SubDeviceKey;

/// SubDevices per broadcast: 100 have had their turn after 60 ms.
const TURN: usize = 34;

/// Whose turn it is.
#[derive(Debug, Default)]
pub(super) struct StateTurns {
    /// SubDevices that have had their turn in this round.
    done: usize,
}

impl StateTurns {
    /// The next SubDevices, with the attempts that have reached their states; none while a scan gives addresses or
    /// changes ports.
    pub fn next(&mut self, segment: &SharedSegment) -> Vec<(SubDeviceKey, Option<u32>)> {
        let view = segment.view();
        if !view.is_segment_visible() {
            return Vec::new();
        }
        let mut next: Vec<(SubDeviceKey, Option<u32>)> = view.kept_from(self.done).take(TURN).collect();
        if next.is_empty() {
            self.done = 0;
            next.extend(view.kept_from(0).take(TURN));
        }
        self.done += next.len();
        next
    }
}
