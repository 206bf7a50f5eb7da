//! How many datagrams a frame may hold on this segment: asked when frames do not bring back what they should.
//!
//! EtherCAT knows no limit but the length of a frame, but some gateways and simulators process the first 15 datagrams
//! only, or drop a frame that holds more. To procedures that looks like SubDevices that do not answer, so a failure of
//! the bus is explained by trying: a frame of many reads of one byte, which any SubDevice answers, and then the number
//! in the middle between one that works and one that does not.

use core::time::Duration;

use ringcat_wire::address::Wkc;
use ringcat_wire::register::map;

use super::shared_segment::SharedSegment;
use crate::event::Event;
use crate::ring::FrameLimit;
use crate::supervisor::{Bus, BusError};
use crate::time::Instant;

/// Most datagrams that are tried: a byte of data each, they nearly fill a frame.
const MOST: usize = 110;
/// A frame that is lost so often in a row is not lost by chance.
const TRIES: u8 = 3;

/// Between two trials in operation.
const PAUSE: Duration = Duration::from_secs(10);

/// What came of a frame.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Outcome {
    Answered,
    Unprocessed,
    Lost,
}

/// The limit of the segment, where it is below what this MainDevice puts into a frame. `None` too where the segment
/// does not answer a frame with one datagram.
pub(super) async fn probe(bus: &Bus) -> Option<FrameLimit> {
    let mut too_many = bus.max_datagrams().min(MOST);
    if attempt(bus, 1).await != Outcome::Answered {
        return None;
    }
    let mut outcome = attempt(bus, too_many).await;
    if outcome == Outcome::Answered {
        return None;
    }
    let mut answered = 1;
    while too_many - answered > 1 {
        let middle = answered + (too_many - answered) / 2;
        match attempt(bus, middle).await {
            Outcome::Answered => answered = middle,
            other => (too_many, outcome) = (middle, other),
        }
    }
    // Nothing has changed meanwhile: a cable that was cut for a moment is no limit.
    let is_so = attempt(bus, answered).await == Outcome::Answered && attempt(bus, too_many).await == outcome;
    is_so.then_some(FrameLimit { datagrams: answered as u16, returns: outcome == Outcome::Unprocessed })
}

async fn attempt(bus: &Bus, datagrams: usize) -> Outcome {
    for _ in 0..TRIES {
        match bus.fill_frame(map::TYPE, datagrams).await {
            Ok(reply) if reply.wkc() == Wkc(0) => return Outcome::Unprocessed,
            Ok(_) => return Outcome::Answered,
            Err(
                BusError::Lost { .. }
                | BusError::Wkc { .. }
                | BusError::TooLong { .. }
                | BusError::Busy { .. }
                | BusError::Disturbed { .. }
                | BusError::Split { .. },
            ) => {}
        }
    }
    Outcome::Lost
}

/// In operation: has the limit told, once, where there is one. Long frames delay a cycle, so it is tried now and then
/// only, whatever else disturbs the segment.
pub(super) async fn explain(bus: &Bus, segment: &SharedSegment) {
    if bus.now() < segment.next_frame_trial() {
        return;
    }
    // At once: the procedure that asks may end before it is answered.
    segment.set_next_frame_trial(bus.now() + PAUSE);
    if let Some(limit) = probe(bus).await {
        segment.set_next_frame_trial(Instant::NEVER);
        bus.report(Event::FrameLimit { limit });
    }
}
