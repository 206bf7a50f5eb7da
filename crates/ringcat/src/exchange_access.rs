//! What an application sets in the exchange of process data beside its cycles: clocks that it steers itself, deadlines,
//! memory for images. Its images are in [`ProcessData`](crate::ProcessData).

use std::time::Duration;

use ringcat_engine::domain::DomainId;
use ringcat_engine::exchange::ClockDatagrams;
#[cfg(feature = "engine")]
use ringcat_engine::exchange::Exchange;
use ringcat_engine::time::Instant;

use crate::acyclic::AcyclicHalf;
use crate::application::Application;
use crate::links::Links;

impl<L: Links, H: AcyclicHalf> Application<L, H> {
    /// The cyclic half (feature `engine`).
    #[cfg(feature = "engine")]
    pub fn exchange_mut(&mut self) -> &mut Exchange {
        &mut self.cyclic.exchange
    }

    /// Sets the application's time now, in nanoseconds of system time: bus shift steers the reference clock to it
    /// ([`ClockConfig::with_bus_shift`](crate::ClockConfig::with_bus_shift)). Without it, host time plus the epoch of
    /// the configuration is used. The first time may also be the grid of SYNC pulses (`PulseGrid`); 0 counts as not
    /// set.
    #[inline]
    pub fn set_application_time(&mut self, time_ns: u64, now: Instant) {
        self.cyclic.exchange.set_application_time(time_ns, now);
    }

    /// Sets the first application time, in nanoseconds, which was valid at the earlier instant `at`, for example before
    /// this application began: the grid of SYNC pulses begins with this time (`PulseGrid`). To be called before
    /// [`Application::set_application_time`].
    pub fn set_first_application_time(&mut self, time_ns: u64, at: Instant) {
        self.cyclic.exchange.set_first_application_time(time_ns, at);
    }

    /// Chooses when the datagrams of distributed clocks take effect; in each cycle unless chosen otherwise.
    pub fn set_clock_datagrams(&mut self, policy: ClockDatagrams) {
        self.cyclic.exchange.set_clock_datagrams(policy);
    }

    /// The next frame sets the reference clock towards the application's time when it leaves, once.
    #[inline]
    pub fn sync_reference(&mut self, now: Instant) {
        self.cyclic.exchange.sync_reference(now);
    }

    /// The next frame sets the reference clock towards this time, once. The other clocks follow.
    #[inline]
    pub fn sync_reference_to(&mut self, time_ns: u64) {
        self.cyclic.exchange.sync_reference_to(time_ns);
    }

    /// The next frame distributes the time of the reference clock, with [`ClockDatagrams::Called`]. No time is
    /// distributed while delays are unknown after a change of cables.
    #[inline]
    pub fn sync_clocks(&mut self) {
        self.cyclic.exchange.sync_clocks();
    }

    /// The next frame reads the differences of all clocks, with [`ClockDatagrams::Called`]; `Exchange::clock_spread_ns`
    /// is `None` until it is back.
    #[inline]
    pub fn monitor_clocks(&mut self) {
        self.cyclic.exchange.monitor_clocks();
    }

    /// Sets the deadline of a domain's frames; the default is one period per cycle that may be on the wire, less a
    /// quarter of a period.
    pub fn set_timeout(&mut self, domain: DomainId, timeout: Duration) {
        self.cyclic.exchange.set_timeout(domain, timeout);
    }

    /// Returns the memory that the caller gave for the image of a domain, in the length of the image. From then on the
    /// image is in memory of the library. Not for the cyclic path: this allocates. `None` if the image is in memory of
    /// the library already.
    pub fn give_memory_back(&mut self, domain: DomainId) -> Option<&'static mut [u8]> {
        self.cyclic.exchange.give_memory_back(domain)
    }
}
