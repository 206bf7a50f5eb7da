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
use ringcat_sim::cable::HostLink;
use ringcat_sim::network::Network;
use ringcat_sim::time::SimTime;
use ringcat_wire::frame::MacAddress;

use crate::links::{Links, PerLink};
use crate::simulated::{add_standby, host_link};
use crate::simulated_addresses::{MAIN, REDUNDANT};
use crate::window::Half;

/// The other thread's frames may be due at any time: the segment is polled again after this.
const NAP: Duration = Duration::from_micros(100);

#[derive(Debug)]
struct Inner {
    network: Network,
    /// Frames that have come back, for each half.
    arrived: [VecDeque<(Link, Vec<u8>)>; 2],
}

impl Inner {
    fn follow(&mut self, now: Instant) {
        self.network.advance(SimTime(now.0));
        for (host, link) in [(HostLink::Main, Link::Main), (HostLink::Redundant, Link::Redundant)] {
            while let Some(received) = self.network.receive(host) {
                let half = match class_of(&received.bytes) {
                    Some(Class::Acyclic) => Half::Acyclic,
                    Some(Class::Cyclic) | None => Half::Cyclic,
                };
                self.arrived[half as usize].push_back((link, received.bytes));
            }
        }
    }
}

/// The links of one half.
#[derive(Debug)]
pub struct SharedSegment {
    inner: Arc<Mutex<Inner>>,
    half: Half,
    begin: WallClock,
    ring: bool,
}

impl SharedSegment {
    /// Links into a network for the cyclic and for the acyclic half; two of each if a cable is connected to its
    /// redundant host interface. A second MainDevice is INACTIVE, as in [`SimulatedSegment`](crate::simulated).
    pub fn halves(mut network: Network) -> (SharedSegment, SharedSegment) {
        add_standby(&mut network);
        let ring = network.host_cable(HostLink::Redundant).is_some();
        let begin = WallClock::now();
        let inner = Arc::new(Mutex::new(Inner { network, arrived: Default::default() }));
        let half = |half| SharedSegment { inner: inner.clone(), half, begin, ring };
        (half(Half::Cyclic), half(Half::Acyclic))
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
        PerLink::new(MAIN, self.ring.then_some(REDUNDANT))
    }

    fn send(&mut self, link: Link, frame: &[u8]) {
        let mut inner = lock(&self.inner);
        inner.follow(self.now());
        inner.network.send(host_link(link), frame);
    }

    fn receive(&mut self, take: &mut dyn FnMut(Link, &[u8])) -> bool {
        let mut inner = lock(&self.inner);
        inner.follow(self.now());
        let Some((link, bytes)) = inner.arrived[self.half as usize].pop_front() else { return false };
        drop(inner);
        take(link, &bytes);
        lock(&self.inner).network.give_back(bytes);
        true
    }

    fn carrier(&self, link: Link) -> Option<bool> {
        Some(lock(&self.inner).network.carrier(host_link(link)))
    }

    fn wait(&mut self, until: Instant) {
        loop {
            let now = self.now();
            let mut inner = lock(&self.inner);
            inner.follow(now);
            let next = inner.network.next_event().map_or(until, |next| until.min(Instant(next.0)));
            if !inner.arrived[self.half as usize].is_empty() || now >= until {
                return;
            }
            drop(inner);
            std::thread::sleep(next.since(now).min(NAP));
        }
    }
}
