//! Makes up the rest of a jump of the application's time while SYNC signals run: the offsets of all clocks are set back
//! in small equal steps, which leave their control loops and their differences as they are.
//!
//! Steps go back only. A SYNC unit waits for the time of its next pulse, which a step forward may pass: there would be
//! no pulse any more. A step back delays the next pulse, wherever in the cycle it comes.

use core::time::Duration;

use super::offsets::write_all;
use crate::procedures::shared_segment::SharedSegment;
use crate::segment::clocks::{ClockFinding, ClockObservation};
use crate::supervisor::Bus;
use crate::time::Instant;

/// Shortest interval of steps: the datagrams of about 60 clocks, a frame.
const INTERVAL: Duration = Duration::from_millis(1);
/// Clocks per interval: a step of more clocks takes as many intervals as it takes frames.
const IN_A_FRAME: usize = 60;
/// Number of steps after which differences are read, and changes of the segment are followed.
const STEPS: usize = 50;

/// Makes some steps, unless the segment changes meanwhile.
pub(super) async fn slide(bus: &Bus, segment: &SharedSegment, ring_changes: u32) {
    // Before, the exchange cannot assign the steps to a shift.
    let is_known = segment.board.clocks.times.taken() == segment.board.clocks.references().1;
    if !segment.view().clocks().is_slide_left() || !is_known {
        return;
    }
    segment.observe_clocks(ClockObservation::SlideBegun);
    let clocks = segment.view().clocks().offsets().len();
    let interval = INTERVAL * clocks.div_ceil(IN_A_FRAME).max(1) as u32;
    let mut last = bus.now();
    for _ in 0..STEPS {
        if last + interval > bus.now() {
            bus.sleep((last + interval).since(bus.now())).await;
        }
        segment.observe_words();
        let is_calm = !segment.board.clocks.is_held() && segment.view().changes().ring == ring_changes;
        let step_ns = segment.view().clocks().next_step_ns(bus.now().since(last).as_nanos() as u64);
        if !is_calm || step_ns == 0 {
            return;
        }
        last = step(bus, segment, step_ns).await;
    }
}

/// Writes the offsets of a step; returns when it began.
async fn step(bus: &Bus, segment: &SharedSegment, step_ns: u64) -> Instant {
    let begun = bus.now();
    segment.observe_clocks(ClockObservation::SteppingBack(step_ns));
    let versions = segment.view().clock_versions();
    let missed = write_all(bus, segment).await;
    segment.find_of_clocks(versions, ClockFinding::SteppedBack { missed: &missed });
    begun
}
