//! Links of a thread that sends heartbeats to the guard while it waits.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::task::Waker;
use std::time::Duration;

use ringcat::links::{Arrived, SendOn};
use ringcat::packet::PacketLinks;
use ringcat::standby::RoleControl;
use ringcat::standby::guard::Pulse;
use ringcat::wire::frame::MacAddress;
use ringcat::{Instant, Link, Links, MainDeviceRole, PerLink};
use ringcat_link::interface;

/// Shared by the threads that send heartbeats.
#[derive(Debug, Default)]
pub struct Beats {
    /// Cycles run: only their thread sends heartbeats.
    pub cycles_run: AtomicBool,
    /// The role: as ACTIVE without cycles, this MainDevice brings up its bus, and its cyclic half has nothing to do.
    pub role: OnceLock<RoleControl>,
    /// The guard has acted.
    pub has_acted: AtomicBool,
}

impl Beats {
    fn brings_up(&self) -> bool {
        let is_active = self.role.get().is_some_and(|control| control.role() == MainDeviceRole::Active);
        is_active && !self.cycles_run.load(Ordering::Relaxed)
    }
}

/// Half of a MainDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Half {
    Cyclic,
    /// Sends heartbeats while this MainDevice brings up its bus and no cycles run.
    Acyclic,
}

/// Links of one half.
pub type HalfLinks = BeatingLinks<PacketLinks>;

/// Interfaces that are switched off when this is dropped, also if the program panics.
#[derive(Debug)]
pub struct OffAtEnd(pub [String; 2]);

impl Drop for OffAtEnd {
    fn drop(&mut self) {
        for name in &self.0 {
            // Where it is not permitted, it was not permitted to begin either.
            let _ = interface::switch(name, false);
        }
    }
}

/// Links whose waits send heartbeats.
#[derive(Debug)]
pub struct BeatingLinks<L> {
    /// Dropped before the links: an interface that is on and does not forward takes the bus from the ACTIVE.
    _off: Option<OffAtEnd>,
    links: L,
    half: Half,
    pulse: Option<Pulse>,
    /// Longest wait.
    period: Duration,
    beats: Arc<Beats>,
}

impl<L: Links> BeatingLinks<L> {
    /// Links of a half, with a heartbeat at least once a period.
    pub fn new(links: L, half: Half, pulse: Option<Pulse>, period: Duration, beats: Arc<Beats>) -> BeatingLinks<L> {
        BeatingLinks { _off: None, links, half, pulse, period, beats }
    }

    /// The same, and these interfaces are switched off before the links end.
    #[must_use]
    pub fn with_off_at_end(self, interfaces: [String; 2]) -> BeatingLinks<L> {
        BeatingLinks { _off: Some(OffAtEnd(interfaces)), ..self }
    }

    /// Sends a heartbeat if one is due from this half. Returns the end of a wait that is to end at `until`.
    fn beat(&self, now: Instant, until: Instant) -> Instant {
        let Some(pulse) = &self.pulse else { return until };
        let is_due = match self.half {
            Half::Cyclic => true,
            Half::Acyclic => self.beats.brings_up(),
        };
        if is_due && !pulse.beat() {
            self.beats.has_acted.store(true, Ordering::Relaxed);
        }
        if self.half == Half::Acyclic && self.beats.cycles_run.load(Ordering::Relaxed) {
            return until;
        }
        until.min(now + self.period)
    }
}

impl<L: Links> Links for BeatingLinks<L> {
    fn now(&self) -> Instant {
        self.links.now()
    }

    fn addresses(&self) -> PerLink<MacAddress> {
        self.links.addresses()
    }

    fn send(&mut self, link: Link, frame: &[u8]) {
        self.links.send(link, frame);
    }

    fn receive(&mut self, take: &mut dyn FnMut(Link, &[u8])) -> bool {
        self.links.receive(take)
    }

    fn receive_and_pass(&mut self, since: Instant, pass: &mut dyn FnMut(Arrived<'_>, &mut dyn SendOn)) -> bool {
        self.links.receive_and_pass(since, pass)
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
        let until = self.beat(self.links.now(), until);
        self.links.wait(until);
    }

    fn wait_from(&mut self, now: Instant, until: Instant) {
        let until = self.beat(now, until);
        self.links.wait_from(now, until);
    }

    fn sleep(&mut self, until: Instant) {
        loop {
            let now = self.links.now();
            let slice = self.beat(now, until);
            self.links.sleep(slice);
            if slice >= until {
                return;
            }
        }
    }

    fn force_disconnect(&mut self, link: Link, disconnect: bool) -> bool {
        self.links.force_disconnect(link, disconnect)
    }
}
