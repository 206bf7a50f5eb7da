//! The links of a program on one of two hosts.

use std::panic::resume_unwind;
use std::sync::{Arc, MutexGuard};
use std::time::Duration;

use ringcat_engine::link::Link;
use ringcat_engine::time::Instant;
use ringcat_sim::cable::Host;
use ringcat_sim::time::SimTime;
use ringcat_wire::frame::MacAddress;

use super::state::{Guard, Program, Shared, State, Turn};
use crate::links::{Links, PerLink};
use crate::simulated_addresses::{MAIN, REDUNDANT, SECOND_MAIN, SECOND_REDUNDANT};

/// How long a program takes to send a frame.
const SEND_TIME: Duration = Duration::from_micros(1);

/// Ends the thread of a program that is killed.
pub(super) struct Killed;

/// The links of a program on one of two hosts ([`TwoHosts`](super::TwoHosts)). The program lets time pass only by
/// waiting, and by sending.
#[derive(Debug)]
pub struct HostLinks {
    shared: Arc<Shared>,
    host: Host,
    /// Arrival of the frame that was taken last.
    arrived_at: Instant,
}

impl HostLinks {
    pub(super) fn new(shared: Arc<Shared>, host: Host) -> HostLinks {
        HostLinks { shared, host, arrived_at: Instant::default() }
    }

    /// The host that they belong to.
    pub fn host(&self) -> Host {
        self.host
    }

    /// Takes both links down, or brings them up.
    pub fn switch(&mut self, up: bool) {
        Link::ALL.into_iter().for_each(|link| _ = self.force_disconnect(link, !up));
    }

    /// Waits for the first turn of the program.
    pub(super) fn begin(&self) {
        let state = self.shared.await_turn(self.shared.lock(), Turn::Host(self.host));
        self.go_on(state);
    }

    /// Lets others have their turns.
    fn pause(&self, program: Program) {
        let mut state = self.shared.lock();
        if !state.slot(self.host).is_killed {
            state.slot(self.host).program = program;
            state = self.shared.take_turns(state, Turn::Host(self.host));
        }
        self.go_on(state);
    }

    /// The program has its turn, unless it is killed.
    fn go_on(&self, mut state: MutexGuard<'_, State>) {
        let slot = state.slot(self.host);
        slot.program = Program::Runs;
        let is_killed = slot.is_killed;
        drop(state);
        if is_killed && !std::thread::panicking() {
            resume_unwind(Box::new(Killed));
        }
    }
}

impl Links for HostLinks {
    fn now(&self) -> Instant {
        Instant(self.shared.lock().network.now().0)
    }

    fn addresses(&self) -> PerLink<MacAddress> {
        match self.host {
            Host::First => PerLink::new(MAIN, Some(REDUNDANT)),
            Host::Second => PerLink::new(SECOND_MAIN, Some(SECOND_REDUNDANT)),
        }
    }

    fn send(&mut self, link: Link, frame: &[u8]) {
        let mut state = self.shared.lock();
        let State { network, slots, .. } = &mut *state;
        let slot = &slots[self.host as usize];
        if slot.is_killed {
            return;
        }
        if slot.guard != Guard::HasActed {
            network.send(self.host.links()[link.index()], frame);
        }
        let until = network.now() + SEND_TIME;
        drop(state);
        self.pause(Program::Sleeps(until));
    }

    fn receive(&mut self, take: &mut dyn FnMut(Link, &[u8])) -> bool {
        let Some((link, received)) = self.shared.lock().slot(self.host).arrived.pop_front() else { return false };
        self.arrived_at = Instant(received.at.0);
        take(link, &received.bytes);
        self.shared.lock().network.give_back(received.bytes);
        true
    }

    fn has_frame(&self) -> bool {
        !self.shared.lock().slot(self.host).arrived.is_empty()
    }

    fn has_arrival_times(&self) -> bool {
        true
    }

    fn received_at(&mut self, _sent_at: Instant, _now: Instant) -> Option<Instant> {
        Some(self.arrived_at)
    }

    fn carrier(&self, link: Link) -> Option<bool> {
        Some(self.shared.lock().network.carrier(self.host.links()[link.index()]))
    }

    fn wait(&mut self, until: Instant) {
        if !self.has_frame() {
            self.pause(Program::Listens(SimTime(until.0)));
        }
    }

    fn sleep(&mut self, until: Instant) {
        self.pause(Program::Sleeps(SimTime(until.0)));
    }

    fn force_disconnect(&mut self, link: Link, disconnect: bool) -> bool {
        self.shared.lock().network.disconnect(self.host.links()[link.index()], disconnect);
        true
    }
}
