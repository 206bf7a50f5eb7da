//! The static drift compensation (protocol 7.2): the reference time is distributed many times, as fast as the segment
//! allows.

use core::time::Duration;

use ringcat_wire::address::{StationAddress, Wkc};
use ringcat_wire::register::map;

use crate::link::Link;
use crate::procedures::shared_segment::SharedSegment;
use crate::segment::Segment;
use crate::segment::clocks::ClockFinding;
use crate::supervisor::Bus;

/// Consecutive distributions; then the bus is free for others for [`BURST_PAUSE`].
const BURST: u32 = 8;
const BURST_PAUSE: Duration = Duration::from_micros(100);
/// Minimum duration of a burst and its pause: the control loops need time as well as samples. What remains of the
/// deviation at the end of the phase takes seconds with cycles of a millisecond.
const BURST_TIME: Duration = Duration::from_micros(640);
/// Pause after a lost frame, and while there is no reference; each pause counts as one distribution.
const PAUSE: Duration = Duration::from_millis(1);
/// The station address of a link without a reference: no SubDevice takes the time from its datagram.
const NONE: StationAddress = StationAddress(0);

/// Distributes the reference time.
pub(in crate::procedures) async fn compensate_drift(bus: Bus, segment: SharedSegment) {
    let (mut left, followers, versions) = {
        let view = segment.view();
        let followers = view.clocks().nodes.iter().filter(|node| node.has_clock).count() as u16;
        (view.clocks().config.drift_distributions, followers, view.clock_versions())
    };
    let (mut next, mut reading, mut number) = (bus.now(), None, 0);
    while left > 0 {
        if segment.board.clocks.times.is_called() {
            break;
        }
        let Some(stations) = references(&segment.view()) else {
            // Meanwhile the time may jump.
            reading = None;
            let from = bus.now();
            let _ = bus.within(PAUSE * left, segment.until(references)).await;
            let waited = bus.now().since(from).as_nanos().div_ceil(PAUSE.as_nanos());
            left = left.saturating_sub(u32::try_from(waited).unwrap_or(u32::MAX).max(1));
            continue;
        };
        (left, number) = (left - 1, number + 1);
        let epoch = segment.view().clocks().epoch;
        let time = reading.unwrap_or_else(|| (bus.now().0.wrapping_add(epoch) as u32, bus.now()));
        reading = None;
        match bus.distribute_time(stations, map::DC_SYSTEM_TIME, time, Wkc(followers)).await {
            // Clocks before the reference receive its last value plus the time since: a late send of this host has the
            // opposite effect in the next frame.
            Ok(reply) if reply.redundant == Wkc(0) => {
                reading = reply.data.first_chunk().map(|bytes| (u32::from_le_bytes(*bytes), reply.sent_at));
            }
            Ok(_) => {}
            Err(_) => bus.sleep(PAUSE).await,
        }
        if number % BURST == 0 {
            next += BURST_TIME;
            bus.sleep_until(next.max(bus.now() + BURST_PAUSE)).await;
        }
    }
    segment.find_of_clocks(versions, ClockFinding::Compensated);
}

/// The references by link. `None` without references, and while a ring opens or closes: the time would be distributed
/// to the wrong clocks.
fn references(segment: &Segment) -> Option<[StationAddress; 2]> {
    let references = segment.references_in_use()?;
    let stations = Link::ALL.map(|link| references.on(link).unwrap_or(NONE));
    (stations != [NONE; 2]).then_some(stations)
}
