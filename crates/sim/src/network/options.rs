//! Properties of a segment that belong to no single device.

use core::time::Duration;

use crate::device::Device;

/// Handling of datagrams beyond the limit of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Beyond {
    /// They come back unchanged.
    Unprocessed,
    /// The whole frame does not come back.
    Dropped,
}

/// Largest number of processed datagrams in a frame, as in other simulators and some gateways.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DatagramLimit {
    /// The limit.
    pub datagrams: u16,
    /// Handling of further ones.
    pub beyond: Beyond,
}

/// Properties of a segment that belong to no single device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NetworkOptions {
    /// Seed of random choices (the bit that a fault inverts).
    pub seed: u64,
    /// Detection time of a lost signal. Default 10 us (fast detection as DS1 demands it, protocol 2.8); plain PHYs take
    /// hundreds of milliseconds.
    pub link_down_delay: Duration,
    /// Detection time of a returning signal. Default 10 us.
    pub link_up_delay: Duration,
    /// Delay of a pass through a device with its processing unit, for devices without a value of their own. Default 300
    /// ns.
    pub processing_delay: Duration,
    /// Delay of a pass through a device without its processing unit, for devices without a value of their own. Default
    /// 300 ns.
    pub forwarding_delay: Duration,
    /// Frames that an interface of the MainDevice queues for sending. Default 256.
    pub transmit_queue: usize,
    /// Frames that an interface of the MainDevice keeps until they are fetched. Default 256.
    pub receive_queue: usize,
    /// Largest number of processed datagrams in a frame. Default: as many as fit.
    pub max_datagrams: Option<DatagramLimit>,
    /// Frames move in one step where no other event occurs, instead of hop by hop. The observable result is the same,
    /// bit for bit, at a fraction of the computing time. Default true.
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

    /// The same detection time for lost and for returning links.
    #[must_use]
    pub const fn with_detection_delay(mut self, delay: Duration) -> NetworkOptions {
        self.link_down_delay = delay;
        self.link_up_delay = delay;
        self
    }

    /// Delay of a pass through a device, with its processing unit or without.
    pub(super) fn passage(&self, device: &Device, processed: bool) -> Duration {
        if processed {
            device.description.processing_delay.unwrap_or(self.processing_delay)
        } else {
            device.description.forwarding_delay.unwrap_or(self.forwarding_delay)
        }
    }
}
