//! Links that end in a simulated segment in the same thread.
//!
//! In virtual time waiting takes no real time. Paced, virtual time does not run ahead of the wall clock. A stall of the
//! machine then stops host and segment alike, and no frame counts as lost.
//!
//! Where the network has links of a second MainDevice, that one is INACTIVE and forwards (feature `standby`; without it
//! what the second MainDevice receives is lost).

#[cfg(feature = "standby")]
mod forwarding;
#[cfg(feature = "standby")]
pub mod two_hosts;

use std::time::{Duration, Instant as WallClock};

use ringcat_engine::link::Link;
use ringcat_engine::time::Instant;
use ringcat_sim::cable::{Host, HostLink};
use ringcat_sim::host::Received;
#[cfg(not(feature = "standby"))]
use ringcat_sim::host::program::Deaf;
use ringcat_sim::host::program::TurnAround;
use ringcat_sim::network::Network;
use ringcat_sim::segment::{Segment, SegmentError};
use ringcat_sim::time::SimTime;
use ringcat_wire::frame::MacAddress;

use crate::links::{Links, PerLink};
use crate::simulated_addresses::{MAIN, REDUNDANT};
#[cfg(feature = "standby")]
use crate::standby::ForwardingCounters;
#[cfg(feature = "standby")]
use forwarding::Forwarding;

/// No sleep while virtual time is ahead of the wall clock by less than this.
const SLEEP_THRESHOLD: Duration = Duration::from_micros(100);

/// A simulated segment as links.
#[derive(Debug)]
pub struct SimulatedSegment {
    network: Network,
    ring: bool,
    arrived: Option<(Link, Received)>,
    pace: Option<(WallClock, SimTime)>,
    stalled: Duration,
}

impl SimulatedSegment {
    /// Links into a network; two of them if a cable is connected to its redundant host interface.
    pub fn new(mut network: Network) -> SimulatedSegment {
        let ring = network.host_cable(HostLink::Redundant).is_some();
        add_standby(&mut network);
        SimulatedSegment { network, ring, arrived: None, pace: None, stalled: Duration::ZERO }
    }

    /// Frames that the second MainDevice has forwarded, in a network where it has links.
    #[cfg(feature = "standby")]
    pub fn forwarded(&self) -> ForwardingCounters {
        let program = self.network.program::<Forwarding>(Host::Second);
        program.map(Forwarding::counters).unwrap_or_default()
    }

    /// A segment from the text of a segment file; SII images are read from the working directory.
    pub fn from_toml(text: &str) -> Result<SimulatedSegment, SegmentError> {
        let segment = Segment::from_toml(text, std::path::Path::new("."))?;
        Ok(SimulatedSegment::new(Network::from_description(segment)?))
    }

    /// From now on virtual time does not run ahead of the wall clock.
    pub fn pace(&mut self) {
        self.pace = Some((WallClock::now(), self.network.now()));
        self.stalled = Duration::ZERO;
    }

    /// Largest delay of virtual time behind the wall clock since [`SimulatedSegment::pace`].
    pub fn stalled(&self) -> Duration {
        self.stalled
    }

    /// The segment behind the links.
    pub fn network(&self) -> &Network {
        &self.network
    }

    /// The segment behind the links, to inject faults.
    pub fn network_mut(&mut self) -> &mut Network {
        &mut self.network
    }

    fn fetch(&mut self) -> bool {
        if self.arrived.is_none() {
            let main = self.network.receive(HostLink::Main).map(|received| (Link::Main, received));
            let next =
                main.or_else(|| self.network.receive(HostLink::Redundant).map(|received| (Link::Redundant, received)));
            self.arrived = next;
        }
        self.arrived.is_some()
    }

    /// Holds virtual time back to the wall clock.
    fn keep_pace(&mut self) {
        let Some((wall, virtual_time)) = self.pace else { return };
        let ahead = self.network.now() - virtual_time;
        let elapsed = wall.elapsed();
        if ahead > elapsed + SLEEP_THRESHOLD {
            std::thread::sleep(ahead - elapsed);
        } else if elapsed > ahead {
            self.stalled = self.stalled.max(elapsed - ahead);
        }
    }
}

pub(crate) const fn host_link(link: Link) -> HostLink {
    match link {
        Link::Main => HostLink::Main,
        Link::Redundant => HostLink::Redundant,
    }
}

impl Links for SimulatedSegment {
    fn now(&self) -> Instant {
        Instant(self.network.now().0)
    }

    fn addresses(&self) -> PerLink<MacAddress> {
        PerLink::new(MAIN, self.ring.then_some(REDUNDANT))
    }

    fn send(&mut self, link: Link, frame: &[u8]) {
        self.network.send(host_link(link), frame);
    }

    fn receive(&mut self, take: &mut dyn FnMut(Link, &[u8])) -> bool {
        self.fetch();
        let Some((link, received)) = self.arrived.take() else { return false };
        take(link, &received.bytes);
        self.network.give_back(received.bytes);
        true
    }

    fn carrier(&self, link: Link) -> Option<bool> {
        Some(self.network.carrier(host_link(link)))
    }

    fn wait(&mut self, until: Instant) {
        let until = SimTime(until.0);
        while !self.fetch() && self.network.now() < until {
            self.network.advance_until_received(until);
        }
        self.keep_pace();
    }

    fn force_disconnect(&mut self, link: Link, disconnect: bool) -> bool {
        self.network.disconnect(host_link(link), disconnect);
        true
    }
}

/// A second MainDevice, as INACTIVE, where the network has links of one.
pub(crate) fn add_standby(network: &mut Network) {
    let has_links = Host::Second.links().into_iter().any(|link| network.host_cable(link).is_some());
    if has_links {
        #[cfg(feature = "standby")]
        let program = Box::new(Forwarding::new());
        #[cfg(not(feature = "standby"))]
        let program = Box::new(Deaf);
        network.run_program(Host::Second, program, TurnAround::default());
    }
}
