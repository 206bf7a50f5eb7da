//! Regular samples of the counters of frames: rates need equal distances, whatever the times of their readers.

use core::time::Duration;

use crate::supervisor::{AcyclicCounters, Bus};
use crate::time::Instant;

/// Distance of two samples.
const DISTANCE: Duration = Duration::from_secs(1);

/// Runs until the application ends. `before`: counters of earlier supervisors.
pub(crate) async fn sample(bus: Bus, before: AcyclicCounters, mut take: impl FnMut(Instant, AcyclicCounters)) {
    loop {
        let now = bus.now();
        take(now, before.plus(bus.counters()));
        bus.sleep_until(now + DISTANCE).await;
    }
}
