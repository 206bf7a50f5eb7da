//! The fast path: moves frames along a [`Route`] in one step, up to the next other event.
//!
//! A frame that cannot change the paths of frames moves from one processing unit to the next, and on to the end, at the
//! same times as hop by hop ([`super::traffic`]). The same code computes its effect on a device.
//!
//! Frames of the same kind that enter after it, or at the other end, may move at the same time: they do not overtake
//! it, each processing unit belongs to the path of one interface, and a frame that only passes by has no effect. Any
//! other due event, in the segment or in a device, ends the fast path there, and the frame continues hop by hop. The
//! same applies to the time limit of the caller, which may then inspect the devices or change the segment.

use super::Network;
use super::event::Event;
use super::pool::Slot;
use super::route::{Hop, Route, Stop};
use crate::cable::{Endpoint, HostLink, LegId};
use crate::controller::InternalPath;
use crate::queue::Lane;
use crate::time::SimTime;

impl Network {
    /// Handles a frame that has arrived at the end of the first cable.
    pub(super) fn enter(&mut self, slot: Slot, link: HostLink, leg: LegId) -> Option<(SimTime, Event)> {
        if self.options.compiled {
            let frame = self.frames.frame(slot);
            let first_bit = self.now.back_ns(frame.first_to_last_bit_ns());
            if self.routes[link as usize].wiring != Some(self.wiring) {
                self.find_route(link);
            }
            let route = &self.routes[link as usize];
            // Events due at the same time have their own order.
            let alone = self.horizon(link) >= self.now;
            if alone && route.wiring == Some(self.wiring) && first_bit >= route.since {
                return self.take_fast_path(slot, link);
            }
        }
        self.arrive(slot, leg, false)
    }

    /// Handles a change of cables, links or power.
    pub(super) fn wiring_changed(&mut self) {
        self.wiring = self.wiring.wrapping_add(1);
    }

    /// Moves a frame along its route up to the next other event. Returns its next hop, if it has not reached the end.
    fn take_fast_path(&mut self, slot: Slot, link: HostLink) -> Option<(SimTime, Event)> {
        let mut route = core::mem::take(&mut self.routes[link as usize]);
        let entered = self.now;
        let place = self.follow(slot, link, &mut route);
        self.now = entered;
        let last = route.hops.len() - 1;
        let place = place.min(last);
        let time = |hop: Hop| SimTime(entered.0.saturating_add(hop.after_ns));
        let Hop { leg, .. } = route.hops[place];
        let at = time(route.hops[place]);
        self.fast_path_until = self.fast_path_until.max(time(route.hops[place.saturating_sub(1)]));
        self.statistics.hops += place as u64;
        self.routes[link as usize] = route;
        let arrival = Event::Arrival { slot, leg, faults_applied: false };
        if place < last {
            return Some((at, arrival));
        }
        self.queue.push(Lane::Exit, at, arrival);
        None
    }

    /// Processes the frame up to the hop with the returned index.
    fn follow(&mut self, slot: Slot, link: HostLink, route: &mut Route) -> usize {
        let entered = self.now;
        let time = |hop: &Hop| SimTime(entered.0.saturating_add(hop.after_ns));
        let end = SimTime(entered.0.saturating_add(route.length_ns()));
        let (id, wire_ns) = (self.frames.frame(slot).id, self.frames.frame(slot).first_to_last_bit_ns());
        let mut horizon = self.horizon(link);
        for stop in &route.stops {
            let place = stop.hop as usize;
            let at = time(&route.hops[place]);
            if at > horizon {
                break;
            }
            let index = stop.device as usize;
            self.now = at;
            if stop.processed {
                self.settle_before(index, id);
            }
            let controller = &mut self.nodes[index].device.controller;
            if !controller.stays(stop.port_changes, end) {
                route.refuse(controller.port_changes() != stop.port_changes);
                return place;
            }
            if !stop.processed {
                continue;
            }
            controller.process_on_path(self.frames.frame_mut(slot), at.back_ns(wire_ns), at);
            if self.defers_settling {
                self.settle_later(index, id);
            } else {
                self.settle(index);
            }
            horizon = self.horizon(link);
            let controller = &self.nodes[index].device.controller;
            if !controller.stays(stop.port_changes, end) {
                route.refuse(controller.port_changes() != stop.port_changes);
                return place + 1;
            }
        }
        match end <= horizon {
            true => route.hops.len() - 1,
            false => route.hops.partition_point(|hop| time(hop) <= horizon),
        }
    }

    /// Time up to which a frame of an interface can move without another event.
    fn horizon(&self, link: HostLink) -> SimTime {
        let horizon = self.limit.min(self.queue.next_in(Lane::Any).back_ns(1));
        if !self.until_received {
            return horizon;
        }
        // The receiver of the first frame may change the segment at that time.
        let other = if link == HostLink::Main { HostLink::Redundant } else { HostLink::Main };
        let entry = other.entry_lane().map_or(SimTime::NEVER, |lane| self.queue.next_in(lane));
        let route = &self.routes[other as usize];
        let there = if route.wiring == Some(self.wiring) { route.length_ns() } else { 0 };
        horizon.min(self.queue.next_in(Lane::Exit)).min(SimTime(entry.0.saturating_add(there)))
    }

    /// Finds the path of frames of an interface, if it consists of cables without faults and returns to an interface.
    fn find_route(&mut self, link: HostLink) {
        let mut route = core::mem::take(&mut self.routes[link as usize]);
        route.hops.clear();
        route.stops.clear();
        route.since = SimTime::ZERO;
        route.wiring = self.walk(link, &mut route).map(|()| self.wiring);
        self.routes[link as usize] = route;
    }

    fn walk(&self, link: HostLink, route: &mut Route) -> Option<()> {
        let mut leg_id = self.hosts[link as usize].out?;
        let mut after_ns = 0u64;
        // A frame enters every port of every device at most once.
        for _ in 0..=4 * self.nodes.len() {
            let leg = &self.legs[leg_id.index()];
            route.since = route.since.max(leg.steady_since()?);
            let hop = route.hops.len() as u32;
            route.hops.push(Hop { leg: leg_id, after_ns });
            let (index, port) = match leg.to {
                Endpoint::Host(_) => return (hop > 0).then_some(()),
                Endpoint::Device(device, port) => (device.0, port),
            };
            let node = &self.nodes[index];
            route.since = route.since.max(node.last_loop_change);
            let InternalPath { exit, processed, port_changes } = node.device.controller.internal_path(port)?;
            let device = index as u32;
            if processed || !route.stops.iter().rev().any(|stop| stop.device == device) {
                route.stops.push(Stop { hop, device, port_changes, processed });
            }
            leg_id = node.out[exit.index()]?;
            let delay_ns = u64::try_from(self.options.passage(&node.device, processed).as_nanos()).ok()?;
            after_ns = after_ns.checked_add(delay_ns)?.checked_add(self.legs[leg_id.index()].delay_ns)?;
        }
        None
    }
}
