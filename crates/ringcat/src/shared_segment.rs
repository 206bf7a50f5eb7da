//! A simulated segment in real time with links for two threads: to test applications with both halves in their own
//! threads, without an interface.
//!
//! Virtual time follows the wall clock. Each call to send, receive or wait brings the segment up to date first.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant as WallClock};

use ringcat_engine::link::Link;
use ringcat_engine::time::Instant;
use ringcat_engine::{Class, class_of};
use ringcat_sim::cable::{Host, HostLink};
use ringcat_sim::network::Network;
use ringcat_sim::time::SimTime;
use ringcat_wire::frame::MacAddress;

use crate::links::{Links, PerLink};
use crate::simulated::add_standby;
use crate::simulated_addresses::{MAIN, REDUNDANT, SECOND_MAIN, SECOND_REDUNDANT};
use crate::window::Half;

/// The other thread's frames may be due at any time: the segment is polled again after this.
const NAP: Duration = Duration::from_micros(100);

/// Frames that have arrived for a half.
type Arrived = VecDeque<(Link, Vec<u8>)>;

#[derive(Debug)]
struct Inner {
    network: Network,
    /// Hosts whose programs have links; what others receive is not taken.
    hosts: &'static [Host],
    /// Frames that have arrived, by host, for each half.
    arrived: [[Arrived; 2]; 2],
}

impl Inner {
    fn follow(&mut self, now: Instant) {
        self.network.advance(SimTime(now.0));
        let ports = self.hosts.iter().flat_map(|host| host.links().into_iter().zip(Link::ALL));
        for (port, link) in ports {
            while let Some(received) = self.network.receive(port) {
                let half = match class_of(&received.bytes) {
                    Some(Class::Acyclic) => Half::Acyclic,
                    Some(Class::Cyclic) | None => Half::Cyclic,
                };
                self.arrived[port.host() as usize][half as usize].push_back((link, received.bytes));
            }
        }
    }
}

/// The links of one half.
#[derive(Debug)]
pub struct SharedSegment {
    inner: Arc<Mutex<Inner>>,
    host: Host,
    half: Half,
    begin: WallClock,
    ring: bool,
}

impl SharedSegment {
    /// Links into a network for the cyclic and for the acyclic half; two of each if a cable is connected to its
    /// redundant host interface. A second MainDevice is INACTIVE, as in [`SimulatedSegment`](crate::simulated).
    pub fn halves(mut network: Network) -> (SharedSegment, SharedSegment) {
        add_standby(&mut network);
        let [first, _] = SharedSegment::with_hosts(network, &[Host::First]);
        first
    }

    /// The same for two MainDevices, both programs of the caller, in a ring of two
    /// ([`SegmentBuilder::ring_of_two`](ringcat_sim::network::builder::SegmentBuilder::ring_of_two)).
    #[cfg(feature = "standby")]
    pub fn halves_of_two(network: Network) -> [(SharedSegment, SharedSegment); 2] {
        SharedSegment::with_hosts(network, &Host::ALL)
    }

    fn with_hosts(network: Network, hosts: &'static [Host]) -> [(SharedSegment, SharedSegment); 2] {
        let ring = network.host_cable(HostLink::Redundant).is_some();
        let begin = WallClock::now();
        let inner = Arc::new(Mutex::new(Inner { network, hosts, arrived: Default::default() }));
        let half = |host, half| SharedSegment { inner: inner.clone(), host, half, begin, ring };
        Host::ALL.map(|host| (half(host, Half::Cyclic), half(host, Half::Acyclic)))
    }

    /// The interface of a link.
    fn port(&self, link: Link) -> HostLink {
        self.host.links()[link.index()]
    }

    /// The segment, for access from another thread.
    pub fn plant(&self) -> Plant {
        Plant { inner: self.inner.clone(), begin: self.begin }
    }
}

/// Access to a shared segment from outside of its links.
#[derive(Clone, Debug)]
pub struct Plant {
    inner: Arc<Mutex<Inner>>,
    begin: WallClock,
}

impl Plant {
    /// Gives access to the segment, to read from it or to inject faults.
    pub fn with_network<R>(&self, look: impl FnOnce(&mut Network) -> R) -> R {
        let mut inner = lock(&self.inner);
        inner.follow(since(self.begin));
        look(&mut inner.network)
    }
}

fn lock(inner: &Mutex<Inner>) -> MutexGuard<'_, Inner> {
    inner.lock().unwrap_or_else(PoisonError::into_inner)
}

fn since(begin: WallClock) -> Instant {
    Instant(u64::try_from(begin.elapsed().as_nanos()).unwrap_or(u64::MAX))
}

impl Links for SharedSegment {
    fn now(&self) -> Instant {
        since(self.begin)
    }

    fn addresses(&self) -> PerLink<MacAddress> {
        match self.host {
            Host::First => PerLink::new(MAIN, self.ring.then_some(REDUNDANT)),
            Host::Second => PerLink::new(SECOND_MAIN, Some(SECOND_REDUNDANT)),
        }
    }

    fn send(&mut self, link: Link, frame: &[u8]) {
        let mut inner = lock(&self.inner);
        inner.follow(self.now());
        inner.network.send(self.port(link), frame);
    }

    fn receive(&mut self, take: &mut dyn FnMut(Link, &[u8])) -> bool {
        let mut inner = lock(&self.inner);
        inner.follow(self.now());
        let Some((link, bytes)) = inner.arrived[self.host as usize][self.half as usize].pop_front() else {
            return false;
        };
        drop(inner);
        take(link, &bytes);
        lock(&self.inner).network.give_back(bytes);
        true
    }

    fn carrier(&self, link: Link) -> Option<bool> {
        Some(lock(&self.inner).network.carrier(self.port(link)))
    }

    fn wait(&mut self, until: Instant) {
        loop {
            let now = self.now();
            let mut inner = lock(&self.inner);
            inner.follow(now);
            let next = inner.network.next_event().map_or(until, |next| until.min(Instant(next.0)));
            if !inner.arrived[self.host as usize][self.half as usize].is_empty() || now >= until {
                return;
            }
            drop(inner);
            std::thread::sleep(next.since(now).min(NAP));
        }
    }
}
