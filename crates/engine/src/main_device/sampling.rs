//! Regular samples of the counters of frames, for an application that computes rates.

use super::MainDevice;
use crate::procedures::sample::sample;
use crate::supervisor::AcyclicCounters;
use crate::time::Instant;

impl MainDevice {
    /// Calls `take` with the time and the counters of the acyclic half now and each second until the application ends.
    pub fn sample_each_second(&mut self, take: impl FnMut(Instant, AcyclicCounters) + 'static) {
        let bus = self.supervisor.bus();
        self.supervisor.spawn(sample(bus, self.counted, take));
    }
}
