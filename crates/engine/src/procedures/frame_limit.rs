//! Determines how many datagrams a frame may contain on this segment, after frames returned without the expected
//! result.
//!
//! EtherCAT has no limit except the length of a frame, but some gateways and simulators process only the first 15
//! datagrams, or drop a frame with more. To procedures this looks like absent SubDevices, so a failure of the bus is
//! tested: first with a frame of many reads of one byte, which any SubDevice answers, and then by bisection between a
//! number that works and one that does not.

use ringcat_wire::address::Wkc;
use ringcat_wire::register::map;

use super::shared_segment::SharedSegment;
use crate::ring::FrameLimit;
use crate::segment::Observation;
use crate::supervisor::{Bus, BusError};

/// Largest number of datagrams tested: with a byte of data each, they nearly fill a frame.
const MOST: usize = 110;
/// A frame lost this often in a row is not lost by chance.
const TRIES: u8 = 3;

/// Result of a frame.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Outcome {
    Answered,
    Unprocessed,
    Lost,
}

/// The limit of the segment, if it is below the number of datagrams that this MainDevice puts into a frame. `None` also
/// if the segment does not answer a frame with one datagram.
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
    // Confirms that nothing has changed meanwhile: a cable that was cut for a moment is not a limit.
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

/// In operation: the limit is reported once, if there is one. The model says when another test may begin.
pub(super) async fn explain(bus: &Bus, segment: &SharedSegment) {
    if bus.now() < segment.view().next_frame_test() {
        return;
    }
    // Set first: the calling procedure may end before the result arrives.
    segment.observe(Observation::FramesTested);
    let versions = segment.view().versions();
    if let Some(limit) = probe(bus).await {
        segment.observe(Observation::FramesLimited { versions, limit });
    }
}
