//! The INACTIVE MainDevice on a host of the simulator.

use ringcat_engine::link::Link;
use ringcat_engine::time::Instant;
use ringcat_sim::cable::HostLink;
use ringcat_sim::host::program::{HostPorts, HostProgram};
use ringcat_wire::frame::MacAddress;

use crate::links::{Links, PerLink};
use crate::simulated_addresses::{SECOND_MAIN, SECOND_REDUNDANT};
use crate::standby::{ForwardingCounters, NeedsTwoLinks, StoreAndForward};

/// Addresses of the host.
const ADDRESSES: PerLink<MacAddress> = PerLink::new(SECOND_MAIN, Some(SECOND_REDUNDANT));

/// Forwards what the host receives.
#[derive(Debug)]
pub(super) struct Forwarding(Result<StoreAndForward, NeedsTwoLinks>);

impl Forwarding {
    pub(super) fn new() -> Forwarding {
        Forwarding(StoreAndForward::new(ADDRESSES))
    }

    /// What it has forwarded since it began.
    pub(super) fn counters(&self) -> ForwardingCounters {
        self.0.as_ref().map(StoreAndForward::counters).unwrap_or_default()
    }
}

impl HostProgram for Forwarding {
    fn work(&mut self, ports: &mut dyn HostPorts) {
        if let Ok(forwarder) = &mut self.0 {
            forwarder.forward(&mut PortLinks { ports, arrived_at: Instant::default() });
        }
    }

    fn restart(&mut self) {
        *self = Forwarding::new();
    }
}

/// Interfaces of a host as links.
struct PortLinks<'a> {
    ports: &'a mut dyn HostPorts,
    /// Arrival of the last taken frame.
    arrived_at: Instant,
}

impl PortLinks<'_> {
    fn of(&self, link: Link) -> HostLink {
        self.ports.links()[link.index()]
    }
}

impl Links for PortLinks<'_> {
    fn now(&self) -> Instant {
        Instant(self.ports.now().0)
    }

    fn addresses(&self) -> PerLink<MacAddress> {
        ADDRESSES
    }

    fn send(&mut self, link: Link, frame: &[u8]) {
        self.ports.send(self.of(link), frame);
    }

    fn receive(&mut self, take: &mut dyn FnMut(Link, &[u8])) -> bool {
        for link in Link::ALL {
            if let Some(received) = self.ports.receive(self.of(link)) {
                self.arrived_at = Instant(received.at.0);
                take(link, &received.bytes);
                self.ports.give_back(received.bytes);
                return true;
            }
        }
        false
    }

    fn has_arrival_times(&self) -> bool {
        true
    }

    fn received_at(&mut self, _sent_at: Instant, _now: Instant) -> Option<Instant> {
        Some(self.arrived_at)
    }

    fn carrier(&self, link: Link) -> Option<bool> {
        Some(self.ports.carrier(self.of(link)))
    }

    /// A program on a host reacts; it does not wait.
    fn wait(&mut self, _until: Instant) {}
}
