//! Links of one half: network interfaces, or a segment that is simulated in this process.

use std::path::Path;
use std::task::Waker;

use ringcat::packet::{PacketLinks, ReceiveMode};
use ringcat::shared_segment::SharedSegment;
use ringcat::sim::network::Network;
use ringcat::wire::frame::MacAddress;
use ringcat::{Instant, Link, Links};

use crate::environment::Source;

/// Links of one half.
#[derive(Debug)]
pub enum AnyLinks {
    /// Network interfaces.
    Packet(Box<PacketLinks>),
    /// A simulated segment.
    Simulated(SharedSegment),
}

impl AnyLinks {
    /// Opens the links of the cyclic and of the acyclic half.
    ///
    /// # Errors
    /// What is wrong, for the operator.
    pub fn open(source: &Source) -> Result<(AnyLinks, AnyLinks), String> {
        match source {
            Source::Simulated(file) => {
                let segment = ringcat::esi::load_segment(Path::new(file)).map_err(|error| error.to_string())?;
                let network = Network::from_description(segment).map_err(|error| error.to_string())?;
                let (cyclic, acyclic) = SharedSegment::halves(network);
                Ok((AnyLinks::Simulated(cyclic), AnyLinks::Simulated(acyclic)))
            }
            Source::Interfaces(main, redundant) => {
                let opened = PacketLinks::open_halves(main, redundant.as_deref(), ReceiveMode::Blocking);
                let (cyclic, acyclic) = opened.map_err(|error| error.to_string())?;
                Ok((AnyLinks::Packet(Box::new(cyclic)), AnyLinks::Packet(Box::new(acyclic))))
            }
        }
    }
}

macro_rules! either {
    ($self:expr, $links:ident => $call:expr) => {
        match $self {
            AnyLinks::Packet($links) => $call,
            AnyLinks::Simulated($links) => $call,
        }
    };
}

impl Links for AnyLinks {
    #[inline(always)]
    fn now(&self) -> Instant {
        either!(self, links => links.now())
    }

    fn addresses(&self) -> ringcat::PerLink<MacAddress> {
        either!(self, links => links.addresses())
    }

    #[inline(always)]
    fn send(&mut self, link: Link, frame: &[u8]) {
        either!(self, links => links.send(link, frame));
    }

    #[inline(always)]
    fn receive(&mut self, take: &mut dyn FnMut(Link, &[u8])) -> bool {
        either!(self, links => links.receive(take))
    }

    #[inline(always)]
    fn has_frame(&self) -> bool {
        either!(self, links => links.has_frame())
    }

    fn knows_arrivals(&self) -> bool {
        either!(self, links => links.knows_arrivals())
    }

    #[inline(always)]
    fn received_at(&mut self, sent_at: Instant, now: Instant) -> Option<Instant> {
        either!(self, links => links.received_at(sent_at, now))
    }

    fn carrier(&self, link: Link) -> Option<bool> {
        either!(self, links => links.carrier(link))
    }

    fn waker(&self) -> Option<Waker> {
        either!(self, links => links.waker())
    }

    fn take_call(&mut self) -> bool {
        either!(self, links => links.take_call())
    }

    fn wait(&mut self, until: Instant) {
        either!(self, links => links.wait(until));
    }

    fn wait_from(&mut self, now: Instant, until: Instant) {
        either!(self, links => links.wait_from(now, until));
    }

    fn sleep(&mut self, until: Instant) {
        either!(self, links => links.sleep(until));
    }

    fn force_disconnect(&mut self, link: Link, disconnect: bool) -> bool {
        either!(self, links => links.force_disconnect(link, disconnect))
    }
}
