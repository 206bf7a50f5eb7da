//! The model of a MainDevice that follows another one: states that the other one has sent, and requests that are
//! refused.

use core::time::Duration;

use super::serve_requests::Requests;
use super::shared_segment::SharedSegment;
use crate::segment::{Observation, StandbyObservation};
use crate::supervisor::Bus;

/// Interval at which the states are read.
const EACH: Duration = Duration::from_millis(10);

/// Passes the states that the cyclic half posts to the model, and refuses requests of the cyclic thread. Runs until the
/// role changes.
pub(crate) async fn mirror(bus: Bus, segment: SharedSegment, requests: Requests) {
    loop {
        segment.observe(Observation::Standby(StandbyObservation::Mirrored));
        requests.end();
        bus.sleep(EACH).await;
    }
}
