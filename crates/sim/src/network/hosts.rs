//! The hosts at a segment: what passes their interfaces, their power, and programs that react to frames.

use core::any::Any;

use super::host_log::{HostFrame, HostLog};
use super::{Event, Network};
use crate::cable::{CableId, Host, HostLink};
use crate::host::Received;
use crate::host::machine::{HostCondition, Machine, Running};
use crate::host::program::{HostPorts, HostProgram, TurnAround, TurnArounds};
use crate::queue::Lane;
use crate::time::SimTime;

impl Network {
    /// Sends a frame (without FCS) on an interface, padded to the minimum of Ethernet, after the frames queued there.
    /// On an interface without carrier the frame is lost.
    pub fn send(&mut self, link: HostLink, bytes: &[u8]) {
        self.transmit(link, bytes);
    }

    /// The next frame received on an interface with a valid FCS.
    pub fn receive(&mut self, link: HostLink) -> Option<Received> {
        self.hosts[link as usize].received.pop_front()
    }

    /// Returns the buffer of a received frame, so that sending needs no new one.
    pub fn give_back(&mut self, bytes: Vec<u8>) {
        self.frames.give_back(bytes);
    }

    /// Whether the interface has detected a link.
    pub fn carrier(&self, link: HostLink) -> bool {
        self.hosts[link as usize].out.is_some_and(|out| self.legs[out.reverse().index()].detected)
    }

    /// The cable of an interface of a MainDevice.
    pub fn host_cable(&self, link: HostLink) -> Option<CableId> {
        self.hosts[link as usize].out.map(|out| out.cable())
    }

    /// Takes an interface of the MainDevice down, or brings it up: while it is down, the cable has no signal.
    pub fn disconnect(&mut self, link: HostLink, disconnect: bool) {
        self.hosts[link as usize].disconnected = disconnect;
        if let Some(cable) = self.host_cable(link) {
            self.refresh_signal(cable);
        }
    }

    /// Logs the frames that leave and reach the interfaces of the hosts from now on.
    pub fn log_hosts(&mut self) {
        self.host_log.get_or_insert_default();
    }

    /// The logged frames since the last call.
    pub fn take_host_log(&mut self) -> Vec<HostFrame> {
        self.host_log.as_mut().map(HostLog::take).unwrap_or_default()
    }

    /// Condition of a host.
    pub fn condition(&self, host: Host) -> HostCondition {
        self.machines[host as usize].condition
    }

    /// Time since which a host has been in this condition.
    pub fn condition_since(&self, host: Host) -> SimTime {
        self.machines[host as usize].since
    }

    /// Runs a program on a host: it takes all frames that the host receives from now on.
    pub fn run_program(&mut self, host: Host, program: Box<dyn HostProgram>, turn_around: TurnAround) {
        let turn_arounds = TurnArounds::new(turn_around, self.options.seed ^ host as u64);
        self.machines[host as usize].program = Some(Running { program, turn_arounds, reacts_at: None });
        self.expect_reaction(host);
    }

    /// Sets the turn-around time of the program of a host.
    pub fn set_turn_around(&mut self, host: Host, turn_around: TurnAround) {
        if let Some(running) = &mut self.machines[host as usize].program {
            running.turn_arounds.set(turn_around);
        }
    }

    /// The program of a host, if it is of this type.
    pub fn program<P: HostProgram>(&self, host: Host) -> Option<&P> {
        let running = self.machines[host as usize].program.as_ref()?;
        (&*running.program as &dyn Any).downcast_ref()
    }

    /// The program of a host stops, or goes on.
    pub(super) fn stop_host(&mut self, host: Host, stop: bool) {
        let machine = &mut self.machines[host as usize];
        let condition = match (machine.condition, stop) {
            (HostCondition::Off, _) => HostCondition::Off,
            (_, true) => HostCondition::Stopped,
            (_, false) => HostCondition::Runs,
        };
        machine.enter(condition, self.now);
        if let Some(running) = &mut self.machines[host as usize].program {
            running.reacts_at = None;
        }
        self.expect_reaction(host);
    }

    /// A host loses its power: its interfaces have no signal at once, and what it has received is lost.
    pub(super) fn power_host_off(&mut self, host: Host) {
        self.machines[host as usize].enter(HostCondition::Off, self.now);
        for link in host.links() {
            while let Some(received) = self.receive(link) {
                self.give_back(received.bytes);
            }
            if let Some(out) = self.hosts[link as usize].out {
                self.legs[out.reverse().index()].detected = false;
                self.refresh_signal(out.cable());
            }
        }
    }

    /// A host gets power: its interfaces are up unless its program has taken them down.
    pub(super) fn power_host_on(&mut self, host: Host) {
        let machine = &mut self.machines[host as usize];
        if machine.condition != HostCondition::Off {
            return;
        }
        machine.enter(HostCondition::Runs, self.now);
        if let Some(running) = &mut machine.program {
            running.program.restart();
            running.reacts_at = None;
        }
        for cable in host.links().map(|link| self.host_cable(link)).into_iter().flatten() {
            self.refresh_signal(cable);
        }
    }

    /// Whether an interface is up, as far as its host decides.
    pub(super) fn is_host_link_up(&self, link: HostLink) -> bool {
        !self.hosts[link as usize].disconnected && self.condition(link.host()) != HostCondition::Off
    }

    /// Whether a frame waits for a program outside of the segment that runs.
    pub(super) fn is_received(&self) -> bool {
        let waits = |link: HostLink| !self.hosts[link as usize].received.is_empty();
        Host::ALL.into_iter().any(|host| {
            let machine = &self.machines[host as usize];
            let is_outside = machine.program.is_none() && machine.condition == HostCondition::Runs;
            is_outside && host.links().into_iter().any(waits)
        })
    }

    /// How often the conditions of the hosts have changed.
    pub(super) fn host_changes(&self) -> [u32; 2] {
        self.machines.each_ref().map(|machine| machine.changes)
    }

    /// Whether a program will react to frames that wait.
    pub(super) fn is_program_due(&self) -> bool {
        self.machines.iter().any(Machine::is_reacting)
    }

    /// A frame waits for the program of a host: it reacts after its turn-around time.
    pub(super) fn expect_reaction(&mut self, host: Host) {
        let waits = host.links().into_iter().any(|link| !self.hosts[link as usize].received.is_empty());
        let machine = &mut self.machines[host as usize];
        let is_running = machine.condition == HostCondition::Runs;
        let Some(running) = machine.program.as_mut().filter(|it| waits && is_running && it.reacts_at.is_none()) else {
            return;
        };
        let at = self.now + running.turn_arounds.next_time();
        running.reacts_at = Some(at);
        self.queue.push(Lane::Any, at, Event::Reaction { host });
    }

    /// The program of a host reacts to the frames that wait.
    pub(super) fn react(&mut self, host: Host) {
        let now = self.now;
        let machine = &mut self.machines[host as usize];
        if machine.condition != HostCondition::Runs {
            return;
        }
        let Some(mut running) = machine.program.take_if(|it| it.reacts_at == Some(now)) else { return };
        running.reacts_at = None;
        running.program.work(&mut Ports { network: self, host });
        self.machines[host as usize].program = Some(running);
        self.expect_reaction(host);
    }
}

/// The interfaces of a host for its program.
struct Ports<'a> {
    network: &'a mut Network,
    host: Host,
}

impl HostPorts for Ports<'_> {
    fn links(&self) -> [HostLink; 2] {
        self.host.links()
    }

    fn now(&self) -> SimTime {
        self.network.now
    }

    fn receive(&mut self, link: HostLink) -> Option<Received> {
        self.network.receive(link)
    }

    fn send(&mut self, link: HostLink, bytes: &[u8]) {
        self.network.send(link, bytes);
    }

    fn give_back(&mut self, bytes: Vec<u8>) {
        self.network.give_back(bytes);
    }

    fn carrier(&self, link: HostLink) -> bool {
        self.network.carrier(link)
    }
}
