//! Signals on cables, their detection at both ends, and the power of devices.

use core::time::Duration;

use super::{Event, Network, Node};
use crate::cable::{CableId, DeviceIndex, Direction, Endpoint, LegId};
use crate::device::Device;
use crate::frame::Port;
use crate::queue::Lane;
use crate::time::SimTime;

/// The order of processing in a controller (protocol 2.1), as the successor of each port.
const NEXT_PORT: [usize; 4] = [3, 2, 0, 1];

impl Node {
    pub(super) fn new(device: Device, out: [Option<LegId>; 4]) -> Node {
        Node {
            device,
            out,
            loop_changed_at: [SimTime::ZERO; 4],
            last_loop_change: SimTime::ZERO,
            wake_at: SimTime::NEVER,
            arranged: None,
            unsettled_by: None,
        }
    }

    /// A port detects a change of its link.
    fn link_changed(&mut self, port: Port, up: bool, now: SimTime) {
        let before = self.device.controller.loop_closed(port);
        self.device.controller.link_changed(port, up, now);
        if self.device.controller.loop_closed(port) != before {
            self.loop_changed_at[port.index()] = now;
            self.last_loop_change = now;
        }
    }

    /// Whether the deadlines of the controller may have changed since the device was last settled without a run. The
    /// deadlines of the application change only in a run.
    fn needs_schedule(&self) -> bool {
        self.arranged != Some(self.device.controller.schedules())
    }

    /// Whether a port opened or closed while a frame passed from one port to another; `first_bit` is the time of its
    /// first bit.
    pub(super) fn interrupted(&self, from: Port, to: Port, first_bit: SimTime) -> bool {
        if self.last_loop_change <= first_bit {
            return false;
        }
        let mut at = from.index();
        loop {
            at = NEXT_PORT[at];
            if self.loop_changed_at[at] > first_bit {
                return true;
            }
            if at == to.index() {
                return false;
            }
        }
    }
}

impl Network {
    /// Switches on the power of all devices, with links up.
    pub(super) fn start(&mut self) {
        for index in 0..self.nodes.len() {
            let node = &mut self.nodes[index];
            node.device.power_on(SimTime::ZERO);
            for port in Port::ALL {
                if node.out[port.index()].is_some() {
                    node.device.controller.link_changed(port, true, SimTime::ZERO);
                }
            }
            self.settle(index);
        }
    }

    /// Makes a device react to past events, and schedules its next wake-up.
    pub(super) fn settle(&mut self, index: usize) {
        let node = &mut self.nodes[index];
        if node.device.needs_run() {
            node.device.run(self.now);
        } else if !node.needs_schedule() {
            return;
        }
        node.arranged = Some(node.device.controller.schedules());
        if let Some(deadline) = node.device.next_deadline() {
            self.wake_at(index, deadline);
        }
    }

    /// Makes a device react to a frame after that has left the segment.
    pub(super) fn settle_later(&mut self, index: usize, frame: u64) {
        let node = &mut self.nodes[index];
        if !node.device.needs_run() && !node.needs_schedule() {
            return;
        }
        if node.unsettled_by.replace(frame).is_none() {
            self.unsettled.push(index as u32);
        }
    }

    /// Makes a device react to the frames that have passed it, before another one passes.
    pub(super) fn settle_before(&mut self, index: usize, frame: u64) {
        if self.nodes[index].unsettled_by.is_some_and(|by| by != frame) {
            self.settle_if_due(index);
        }
    }

    fn settle_if_due(&mut self, index: usize) {
        if self.nodes[index].unsettled_by.take().is_some() {
            self.settle(index);
        }
    }

    /// Makes all devices react to frames that passed them in [`Network::advance_until_quiet`].
    pub fn settle_all(&mut self) {
        if self.unsettled.is_empty() {
            return;
        }
        let mut unsettled = core::mem::take(&mut self.unsettled);
        for index in unsettled.drain(..) {
            self.settle_if_due(index as usize);
        }
        self.unsettled = unsettled;
    }

    /// Schedules the wake-up of a device, unless an earlier wake-up is scheduled. A deadline can be in the past when it
    /// is set: a watchdog time that was shortened, an application that hung meanwhile.
    pub(super) fn wake_at(&mut self, index: usize, at: SimTime) {
        let at = at.max(self.now);
        let node = &mut self.nodes[index];
        if at < node.wake_at {
            node.wake_at = at;
            self.queue.push(Lane::Any, at, Event::Wake { device: index as u32 });
        }
    }

    /// Handles a wake-up. Deadlines may have moved meanwhile (a retriggered watchdog), so the device computes its
    /// deadline again.
    pub(super) fn wake(&mut self, index: usize) {
        let node = &mut self.nodes[index];
        if node.wake_at > self.now {
            return;
        }
        node.wake_at = SimTime::NEVER;
        node.device.run(self.now);
        if let Some(deadline) = node.device.next_deadline() {
            // A deadline that the run did not handle must not stop time.
            self.wake_at(index, deadline.max(self.now + Duration::from_nanos(1)));
        }
    }

    /// Cuts a cable.
    ///
    /// # Panics
    /// If there is no cable with this number.
    pub fn cut(&mut self, cable: CableId) {
        self.cables[cable.0].cut = true;
        self.refresh_signal(cable);
    }

    /// Repairs a cable.
    ///
    /// # Panics
    /// If there is no cable with this number.
    pub fn heal(&mut self, cable: CableId) {
        self.cables[cable.0].cut = false;
        self.refresh_signal(cable);
    }

    /// Repairs a cable, with a later detection at one end.
    pub(super) fn heal_unevenly(&mut self, cable: CableId, later: Direction, by: Duration) {
        self.cables[cable.0].cut = false;
        self.refresh_signal_unevenly(cable, |direction| if direction == later { by } else { Duration::ZERO });
    }

    /// Switches the power of a device off. Its ports have no signal at once; its neighbours detect it after their
    /// detection delay.
    ///
    /// # Panics
    /// If there is no device with this number.
    pub fn power_off(&mut self, device: DeviceIndex) {
        let node = &mut self.nodes[device.0];
        if !node.device.controller.is_powered() {
            return;
        }
        node.device.power_off(self.now);
        self.wiring += 1;
        for out in node.out.into_iter().flatten() {
            self.legs[out.reverse().index()].detected = false;
            self.refresh_signal(out.cable());
        }
    }

    /// Switches the power of a device on. Its links come up after their detection delay.
    ///
    /// # Panics
    /// If there is no device with this number.
    pub fn power_on(&mut self, device: DeviceIndex) {
        let node = &mut self.nodes[device.0];
        if node.device.controller.is_powered() {
            return;
        }
        node.device.power_on(self.now);
        self.wiring += 1;
        for out in node.out.into_iter().flatten() {
            self.refresh_signal(out.cable());
        }
        self.settle(device.0);
    }

    fn has_power(&self, endpoint: Endpoint) -> bool {
        match endpoint {
            Endpoint::Device(device, _) => self.nodes[device.0].device.controller.is_powered(),
            Endpoint::Host(link) => self.is_host_link_up(link),
        }
    }

    /// Updates whether a cable carries a signal; after a change, its ends detect it later.
    pub(super) fn refresh_signal(&mut self, id: CableId) {
        self.refresh_signal_unevenly(id, |_| Duration::ZERO);
    }

    /// As `refresh_signal`, with additional detection time per direction.
    fn refresh_signal_unevenly(&mut self, id: CableId, longer: impl Fn(Direction) -> Duration) {
        let cable = &self.cables[id.0];
        let up = !cable.cut && self.has_power(cable.spec.a) && self.has_power(cable.spec.b);
        if up == self.leg_mut(id, Direction::AToB).signal() {
            return;
        }
        self.wiring_changed();
        let cable = &mut self.cables[id.0];
        cable.epoch += 1;
        let epoch = cable.epoch;
        let delay = if up { self.options.link_up_delay } else { self.options.link_down_delay };
        for direction in Direction::ALL {
            let now = self.now;
            self.leg_mut(id, direction).set_signal(up, now);
            let delay = delay + longer(direction);
            self.queue.push(Lane::Any, now + delay, Event::Detection { leg: LegId::new(id, direction), epoch });
        }
    }

    /// The end of a leg detects a signal or its loss.
    pub(super) fn detect(&mut self, id: LegId, epoch: u32) {
        if self.cables[id.cable().0].epoch != epoch {
            return;
        }
        let leg = &mut self.legs[id.index()];
        let up = leg.signal();
        if leg.detected == up {
            return;
        }
        leg.detected = up;
        leg.detected_at = self.now;
        self.wiring += 1;
        if let Endpoint::Device(device, port) = leg.to {
            self.nodes[device.0].link_changed(port, up, self.now);
            self.settle(device.0);
        }
    }
}
