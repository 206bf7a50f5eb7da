//! Properties of a segment that belong to no single device.

use core::time::Duration;

use crate::device::Device;

/// What becomes of datagrams that are too many for a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Beyond {
    /// They come back as they were sent.
    Unprocessed,
    /// The whole frame does not come back.
    Dropped,
}

/// How many datagrams a frame may hold, as other simulators and some gateways have it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DatagramLimit {
    /// So many.
    pub datagrams: u16,
    /// What becomes of more.
    pub beyond: Beyond,
}

/// Properties of a segment that belong to no single device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NetworkOptions {
    /// Where random choices start from (the bit that a fault corrupts).
    pub seed: u64,
    /// From the loss of a signal to the moment the ends notice. Default 10 us (fast detection as DS1 demands it,
    /// protocol 2.8); plain PHYs take hundreds of milliseconds.
    pub link_down_delay: Duration,
    /// From the return of a signal to the moment the ends notice. Default 10 us.
    pub link_up_delay: Duration,
    /// Delay of a passage through a device with its processing unit, for devices that say nothing. Default 300 ns.
    pub processing_delay: Duration,
    /// Delay of a passage through a device without its processing unit, for devices that say nothing. Default 300 ns.
    pub forwarding_delay: Duration,
    /// Frames that an interface of the MainDevice queues for sending. Default 256.
    pub transmit_queue: usize,
    /// Frames that an interface of the MainDevice keeps until they are fetched. Default 256.
    pub receive_queue: usize,
    /// How many datagrams a frame may hold. Default: as many as fit.
    pub max_datagrams: Option<DatagramLimit>,
    /// Frames fly in one go where nothing else happens, instead of hop by hop. What can be seen is the same, bit for
    /// bit; it takes a fraction of the computing. Default true.
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
    /// The same delay for every passage through a device.
    #[must_use]
    pub const fn with_hop_delay(mut self, delay: Duration) -> NetworkOptions {
        self.processing_delay = delay;
        self.forwarding_delay = delay;
        self
    }

    /// The same delay for noticing that a link goes and that it comes.
    #[must_use]
    pub const fn with_detection_delay(mut self, delay: Duration) -> NetworkOptions {
        self.link_down_delay = delay;
        self.link_up_delay = delay;
        self
    }

    /// Delay of a passage through a device, with its processing unit or without.
    pub(super) fn passage(&self, device: &Device, processed: bool) -> Duration {
        if processed {
            device.description.processing_delay.unwrap_or(self.processing_delay)
        } else {
            device.description.forwarding_delay.unwrap_or(self.forwarding_delay)
        }
    }
}
