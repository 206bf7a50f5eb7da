//! Options of a whole segment.

use core::time::Duration;

use crate::device::Device;

/// Handling of datagrams beyond the limit of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Beyond {
    /// They return unchanged.
    Unprocessed,
    /// The whole frame does not return.
    Dropped,
}

/// Maximum number of processed datagrams in a frame, as in other simulators and some gateways.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DatagramLimit {
    /// The limit.
    pub datagrams: u16,
    /// Handling of further ones.
    pub beyond: Beyond,
}

/// Options of a whole segment.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct NetworkOptions {
    /// Seed of random values (the bit that a fault inverts).
    pub seed: u64,
    /// Detection time of a lost signal. Default 10 us (fast detection required by DS1, protocol 2.8); plain PHYs take
    /// hundreds of milliseconds.
    pub link_down_delay: Duration,
    /// Detection time of a new signal. Default 10 us.
    pub link_up_delay: Duration,
    /// Delay of a pass through a device with its processing unit, for devices without their own value. Default 300 ns.
    pub processing_delay: Duration,
    /// Delay of a pass through a device without its processing unit, for devices without their own value. Default 300
    /// ns.
    pub forwarding_delay: Duration,
    /// Size of the transmit queue of an interface of the MainDevice. Default 256.
    pub transmit_queue: usize,
    /// Size of the receive queue of an interface of the MainDevice. Default 256.
    pub receive_queue: usize,
    /// Maximum number of processed datagrams in a frame. Default: no limit.
    pub max_datagrams: Option<DatagramLimit>,
    /// Enables the fast path: frames move in one step if no other event occurs, instead of hop by hop. The observable
    /// result is the same, bit for bit, at a fraction of the computing time. Default true.
    pub compiled: bool,
}

impl Default for NetworkOptions {
    fn default() -> Self {
        NetworkOptions {
            seed: 0,
            link_down_delay: Duration::from_micros(10),
            link_up_delay: Duration::from_micros(10),
            processing_delay: Duration::from_nanos(300),
            forwarding_delay: Duration::from_nanos(300),
            transmit_queue: 256,
            receive_queue: 256,
            max_datagrams: None,
            compiled: true,
        }
    }
}

impl NetworkOptions {
    /// The same delay for every pass through a device.
    #[must_use]
    pub const fn with_hop_delay(mut self, delay: Duration) -> NetworkOptions {
        self.processing_delay = delay;
        self.forwarding_delay = delay;
        self
    }

    /// The same detection time for lost and for new signals.
    #[must_use]
    pub const fn with_detection_delay(mut self, delay: Duration) -> NetworkOptions {
        self.link_down_delay = delay;
        self.link_up_delay = delay;
        self
    }

    /// Sets [`NetworkOptions::seed`].
    #[must_use]
    pub const fn with_seed(mut self, seed: u64) -> NetworkOptions {
        self.seed = seed;
        self
    }

    /// Sets [`NetworkOptions::link_down_delay`].
    #[must_use]
    pub const fn with_link_down_delay(mut self, link_down_delay: Duration) -> NetworkOptions {
        self.link_down_delay = link_down_delay;
        self
    }

    /// Sets [`NetworkOptions::link_up_delay`].
    #[must_use]
    pub const fn with_link_up_delay(mut self, link_up_delay: Duration) -> NetworkOptions {
        self.link_up_delay = link_up_delay;
        self
    }

    /// Sets [`NetworkOptions::processing_delay`].
    #[must_use]
    pub const fn with_processing_delay(mut self, processing_delay: Duration) -> NetworkOptions {
        self.processing_delay = processing_delay;
        self
    }

    /// Sets [`NetworkOptions::forwarding_delay`].
    #[must_use]
    pub const fn with_forwarding_delay(mut self, forwarding_delay: Duration) -> NetworkOptions {
        self.forwarding_delay = forwarding_delay;
        self
    }

    /// Sets [`NetworkOptions::transmit_queue`].
    #[must_use]
    pub const fn with_transmit_queue(mut self, transmit_queue: usize) -> NetworkOptions {
        self.transmit_queue = transmit_queue;
        self
    }

    /// Sets [`NetworkOptions::receive_queue`].
    #[must_use]
    pub const fn with_receive_queue(mut self, receive_queue: usize) -> NetworkOptions {
        self.receive_queue = receive_queue;
        self
    }

    /// Sets [`NetworkOptions::compiled`].
    #[must_use]
    pub const fn with_compiled(mut self, compiled: bool) -> NetworkOptions {
        self.compiled = compiled;
        self
    }

    /// Sets [`NetworkOptions::max_datagrams`].
    #[must_use]
    pub fn with_max_datagrams(mut self, max_datagrams: impl Into<Option<DatagramLimit>>) -> NetworkOptions {
        self.max_datagrams = max_datagrams.into();
        self
    }

    /// Delay of a pass through a device, with or without its processing unit.
    pub(super) fn passage(&self, device: &Device, processed: bool) -> Duration {
        if processed {
            device.description.processing_delay.unwrap_or(self.processing_delay)
        } else {
            device.description.forwarding_delay.unwrap_or(self.forwarding_delay)
        }
    }
}
