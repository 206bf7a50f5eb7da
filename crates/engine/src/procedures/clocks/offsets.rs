//! Writes the offsets of all clocks when the application's time has jumped, or was set for the first time. Their
//! control loops are not touched: they continue at the learned speed.

use core::time::Duration;

use alloc::vec::Vec;

use ringcat_wire::register::map;

use super::set_up::set_up_one;
use crate::procedures::shared_segment::SharedSegment;
use crate::segment::clocks::{ClockFinding, ClockKey};
use crate::supervisor::Bus;

/// Maximum wait until the exchange distributes no time: an application whose cycles are longer, or have stopped,
/// distributes none meanwhile.
const STOPPED: Duration = Duration::from_millis(50);

/// Writes the offsets that are due, once no frame with the previous time can follow.
pub(super) async fn write_offsets(bus: &Bus, segment: &SharedSegment) {
    let until = bus.now() + STOPPED;
    let (_, stopped) = segment.board.clocks.references();
    while segment.board.clocks.times.taken() != stopped && bus.now() < until {
        let posted = bus.posted();
        segment.until_posted(posted, until, || false).await;
    }
    let versions = segment.view().clock_versions();
    let missed = write_all(bus, segment).await;
    segment.find_of_clocks(versions, ClockFinding::OffsetsWritten { missed: &missed });
}

/// Writes the offsets of all clocks; those that did not answer.
pub(super) async fn write_all(bus: &Bus, segment: &SharedSegment) -> Vec<ClockKey> {
    let all = segment.view().clocks().offsets();
    let written = bus.gather(all, |bus, (key, offset)| async move {
        let result = bus.fpwr(key.station, map::DC_SYSTEM_TIME_OFFSET, &offset.to_le_bytes()).await;
        result.is_err().then_some(key)
    });
    written.await.into_iter().flatten().collect()
}

/// Sets up clocks that answer again, and whose offsets were changed meanwhile.
pub(super) async fn write_missed(bus: &Bus, segment: &SharedSegment) {
    let lacking = segment.view().clocks().without_offset();
    for station in lacking {
        if set_up_one(bus, segment, station).await.is_err() {
            return;
        }
    }
}
