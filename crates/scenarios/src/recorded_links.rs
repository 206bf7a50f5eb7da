//! Links into a simulated segment that keep every frame that is sent on the main link, for checkers of frames.

use ringcat::simulated::SimulatedSegment;
use ringcat::{Instant, Link, Links};
use ringcat_sim::network::Network;
use ringcat_wire::frame::MacAddress;

/// Links with the frames that were sent.
#[derive(Debug)]
pub struct RecordedLinks {
    segment: SimulatedSegment,
    /// The frames sent on the main link, with their times.
    pub sent: Vec<(Instant, Vec<u8>)>,
}

impl RecordedLinks {
    /// Links into a network.
    pub fn new(network: Network) -> RecordedLinks {
        RecordedLinks { segment: SimulatedSegment::new(network), sent: Vec::new() }
    }

    /// The segment.
    pub fn network_mut(&mut self) -> &mut Network {
        self.segment.network_mut()
    }
}

impl Links for RecordedLinks {
    fn now(&self) -> Instant {
        self.segment.now()
    }

    fn addresses(&self) -> ringcat::PerLink<MacAddress> {
        self.segment.addresses()
    }

    fn send(&mut self, link: Link, frame: &[u8]) {
        if link == Link::Main {
            self.sent.push((self.segment.now(), frame.to_vec()));
        }
        self.segment.send(link, frame);
    }

    fn receive(&mut self, take: &mut dyn FnMut(Link, &[u8])) -> bool {
        self.segment.receive(take)
    }

    fn carrier(&self, link: Link) -> Option<bool> {
        self.segment.carrier(link)
    }

    fn wait(&mut self, until: Instant) {
        self.segment.wait(until);
    }
}
