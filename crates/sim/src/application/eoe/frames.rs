//! Frame queues of an IP stack (smoltcp).

use std::collections::VecDeque;

use smoltcp::phy::{Device, DeviceCapabilities, Medium, RxToken, TxToken};
use smoltcp::time::Instant;

/// Longest frame without FCS.
const MAX_FRAME: usize = 1514;

/// Two queues that form an interface of a stack. The code that fills the input queue limits it.
#[derive(Debug)]
pub struct Frames {
    /// Frames to the stack.
    pub received: VecDeque<Vec<u8>>,
    /// Frames from the stack.
    pub sent: VecDeque<Vec<u8>>,
    ready: usize,
}

impl Frames {
    /// Empty queues. While this number of frames waits in `sent`, the stack starts no new frame.
    pub const fn new(ready: usize) -> Frames {
        Frames { received: VecDeque::new(), sent: VecDeque::new(), ready }
    }
}

/// A frame for the stack.
#[derive(Debug)]
pub struct Received(Vec<u8>);

/// Buffer for a frame of the stack.
#[derive(Debug)]
pub struct Sending<'a>(&'a mut VecDeque<Vec<u8>>);

impl RxToken for Received {
    fn consume<R, F: FnOnce(&[u8]) -> R>(self, f: F) -> R {
        f(&self.0)
    }
}

impl TxToken for Sending<'_> {
    fn consume<R, F: FnOnce(&mut [u8]) -> R>(self, length: usize, f: F) -> R {
        let mut frame = vec![0; length];
        let result = f(&mut frame);
        self.0.push_back(frame);
        result
    }
}

impl Device for Frames {
    type RxToken<'a> = Received;
    type TxToken<'a> = Sending<'a>;

    fn receive(&mut self, _: Instant) -> Option<(Received, Sending<'_>)> {
        let frame = self.received.pop_front()?;
        Some((Received(frame), Sending(&mut self.sent)))
    }

    fn transmit(&mut self, _: Instant) -> Option<Sending<'_>> {
        (self.sent.len() < self.ready).then_some(Sending(&mut self.sent))
    }

    fn capabilities(&self) -> DeviceCapabilities {
        let mut capabilities = DeviceCapabilities::default();
        capabilities.medium = Medium::Ethernet;
        capabilities.max_transmission_unit = MAX_FRAME;
        capabilities
    }
}
