//! Links into a simulated segment that outlives the program on them.

use ringcat::simulated::SimulatedSegment;
use ringcat::{Instant, Link, Links};
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::frame::MacAddress;

use crate::segments::{descriptions, line};

/// Calls without progress of time after which the engine hangs.
const MOST_CALLS: u64 = 100_000;

/// Links into a simulated segment.
#[derive(Debug)]
pub struct CallLinks {
    segment: SimulatedSegment,
    calls: u64,
    last: Instant,
    /// Frames sent since the beginning.
    pub sent: u64,
}

impl CallLinks {
    /// Links into a network.
    pub fn new(network: Network) -> CallLinks {
        CallLinks { segment: SimulatedSegment::new(network), calls: 0, last: Instant::default(), sent: 0 }
    }

    /// The segment.
    pub fn network(&self) -> &Network {
        self.segment.network()
    }

    /// The segment, for faults.
    pub fn network_mut(&mut self) -> &mut Network {
        self.segment.network_mut()
    }

    /// Takes the segment away from a program that has ended. These links lead to another one afterwards.
    pub fn take_network(&mut self) -> Network {
        let other = line(descriptions(&["coupler"]), NetworkOptions::default());
        std::mem::replace(self.segment.network_mut(), other)
    }

    fn count(&mut self) {
        let now = self.segment.now();
        self.calls = if now == self.last { self.calls + 1 } else { 0 };
        self.last = now;
        assert!(self.calls < MOST_CALLS, "the engine lets no time pass, at {} ns", now.0);
    }
}

impl Links for CallLinks {
    fn now(&self) -> Instant {
        self.segment.now()
    }

    fn addresses(&self) -> ringcat::PerLink<MacAddress> {
        self.segment.addresses()
    }

    fn send(&mut self, link: Link, frame: &[u8]) {
        self.sent += 1;
        self.segment.send(link, frame);
    }

    fn receive(&mut self, take: &mut dyn FnMut(Link, &[u8])) -> bool {
        self.count();
        self.segment.receive(take)
    }

    fn carrier(&self, link: Link) -> Option<bool> {
        self.segment.carrier(link)
    }

    fn wait(&mut self, until: Instant) {
        self.count();
        self.segment.wait(until);
    }
}
