//! Links that record when the first frame of the cyclic class leaves.

use std::task::Waker;

use ringcat::packet::PacketLinks;
use ringcat::{Instant, Link, Links, PerLink};
use ringcat_engine::{Class, class_of};
use ringcat_wire::frame::MacAddress;
use ringcat_wire::source_address::{FORWARDED_ON_MAIN, FORWARDED_ON_REDUNDANT};

/// Offset of the source address in a frame.
const SOURCE_AT: usize = 6;

/// The call that sent a frame.
#[derive(Clone, Copy, Debug)]
pub struct Sent {
    /// When the frame was handed to the kernel.
    pub handed_at: Instant,
    /// When the call had returned: the frame is at the other end of its veth pair.
    pub returned_at: Instant,
}

/// The links of a controller.
#[derive(Debug)]
pub struct TimedLinks {
    links: PacketLinks,
    first: Option<Sent>,
}

impl TimedLinks {
    /// Links without a frame so far.
    pub fn new(links: PacketLinks) -> TimedLinks {
        TimedLinks { links, first: None }
    }

    /// The first frame of the cyclic class since the last call that was sent on a link with a carrier. Forwarded frames
    /// do not count.
    pub fn take_first(&mut self) -> Option<Sent> {
        self.first.take()
    }

    /// Switches both interfaces off, as the guard of a controller does.
    pub fn switch_off(&mut self) -> Result<(), String> {
        self.links.switch(false).map_err(|error| error.to_string())
    }
}

impl Links for TimedLinks {
    fn now(&self) -> Instant {
        self.links.now()
    }

    fn addresses(&self) -> PerLink<MacAddress> {
        self.links.addresses()
    }

    fn send(&mut self, link: Link, frame: &[u8]) {
        let is_forwarded = frame[SOURCE_AT] & (FORWARDED_ON_MAIN | FORWARDED_ON_REDUNDANT) != 0;
        let is_first = self.first.is_none() && self.links.carrier(link) != Some(false);
        if is_forwarded || !is_first || class_of(frame) != Some(Class::Cyclic) {
            return self.links.send(link, frame);
        }
        let handed_at = self.links.now();
        self.links.send(link, frame);
        self.first = Some(Sent { handed_at, returned_at: self.links.now() });
    }

    fn receive(&mut self, take: &mut dyn FnMut(Link, &[u8])) -> bool {
        self.links.receive(take)
    }

    fn has_frame(&self) -> bool {
        self.links.has_frame()
    }

    fn has_arrival_times(&self) -> bool {
        self.links.has_arrival_times()
    }

    fn received_at(&mut self, sent_at: Instant, now: Instant) -> Option<Instant> {
        self.links.received_at(sent_at, now)
    }

    fn carrier(&self, link: Link) -> Option<bool> {
        self.links.carrier(link)
    }

    fn waker(&self) -> Option<Waker> {
        self.links.waker()
    }

    fn take_call(&mut self) -> bool {
        self.links.take_call()
    }

    fn wait(&mut self, until: Instant) {
        self.links.wait(until);
    }

    fn wait_from(&mut self, now: Instant, until: Instant) {
        self.links.wait_from(now, until);
    }

    fn sleep(&mut self, until: Instant) {
        self.links.sleep(until);
    }
}
