//! The way of frames through a segment in which nothing else happens: found once, then flown in one go.
//!
//! Hop by hop ([`super::traffic`]) a frame costs the same at every device, also where it only passes by on its way back.
//! As long as cables and ports stay as they are, all frames of an interface take the same way, and it is known
//! beforehand at which devices they meet a processing unit. A frame that cannot change that by itself then goes from one
//! processing unit to the next, and on to the end, at the times that hop by hop would give. What it does to a device is
//! done by the same code.
//!
//! Frames of the same kind that enter behind it, or at the other end, may do so meanwhile: they do not overtake it, each processing unit
//! belongs to the way of one interface, and a frame that only passes by leaves no trace. Anything else that is due, in
//! the segment or in a device, ends the flight there, and the frame goes on hop by hop. The same holds for the limit of
//! the caller, who may look at the devices or change the segment then.

use ringcat_wire::command::Command;
use ringcat_wire::register::map;

use super::{Event, Network, Slot};
use crate::cable::{Endpoint, HostLink, LegId};
use crate::controller::Way;
use crate::frame::{Fcs, FrameKind, SimFrame};
use crate::queue::Lane;
use crate::time::SimTime;

/// The arrival of a frame at the end of a leg.
#[derive(Clone, Copy, Debug)]
struct Hop {
    leg: LegId,
    /// Time since the frame entered the first device.
    after_ns: u64,
}

/// A hop that has to be looked at: the first one into a device, or one through its processing unit.
#[derive(Clone, Copy, Debug)]
struct Stop {
    /// Place among the hops.
    hop: u32,
    device: u32,
    /// The device's ports are as they were found while this has not changed.
    port_changes: u32,
    processed: bool,
}

/// The way of frames from an interface of the MainDevice.
#[derive(Debug, Default)]
pub(super) struct Route {
    /// State of the wiring that it was found in; `None` where there is no way, or it has to be found anew.
    wiring: Option<u32>,
    /// Frames whose first bit comes later than this are not met by what has happened before.
    since: SimTime,
    /// All hops, that into the interface at the end included.
    hops: Vec<Hop>,
    stops: Vec<Stop>,
}

impl Route {
    /// It has to be found anew, if the ports of a device are not as they were.
    fn refuse(&mut self, changed: bool) {
        if changed {
            self.wiring = None;
        }
    }

    fn length_ns(&self) -> u64 {
        self.hops.last().map_or(0, |hop| hop.after_ns)
    }
}

impl Network {
    /// A frame has come to the end of the first cable.
    pub(super) fn enter(&mut self, slot: Slot, link: HostLink, leg: LegId) -> Option<(SimTime, Event)> {
        if self.options.compiled {
            let frame = self.frames.frame(slot);
            let first_bit = self.now.back_ns(frame.first_to_last_bit_ns());
            if self.routes[link as usize].wiring != Some(self.wiring) {
                self.find_route(link);
            }
            let route = &self.routes[link as usize];
            // What is due at this very time has its own order.
            let alone = self.horizon(link) >= self.now;
            if alone && route.wiring == Some(self.wiring) && first_bit >= route.since {
                return self.fly(slot, link);
            }
        }
        self.arrive(slot, leg, false)
    }

    /// Something about cables, links or power has changed.
    pub(super) fn wiring_changed(&mut self) {
        self.wiring = self.wiring.wrapping_add(1);
    }

    /// Takes a frame as far along its route as nothing else happens. Returns its next hop, if that is not the end.
    fn fly(&mut self, slot: Slot, link: HostLink) -> Option<(SimTime, Event)> {
        let mut route = core::mem::take(&mut self.routes[link as usize]);
        let entered = self.now;
        let place = self.follow(slot, link, &mut route);
        self.now = entered;
        let last = route.hops.len() - 1;
        let place = place.min(last);
        let time = |hop: Hop| SimTime(entered.0.saturating_add(hop.after_ns));
        let Hop { leg, .. } = route.hops[place];
        let at = time(route.hops[place]);
        self.flown_to = self.flown_to.max(time(route.hops[place.saturating_sub(1)]));
        self.statistics.hops += place as u64;
        self.routes[link as usize] = route;
        let arrival = Event::Arrival { slot, leg, meddled: false };
        if place < last {
            return Some((at, arrival));
        }
        self.queue.push(Lane::Exit, at, arrival);
        None
    }

    /// Does everything up to the hop whose place it returns.
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
            controller.process_on_way(self.frames.frame_mut(slot), at.back_ns(wire_ns), at);
            if self.leaping {
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

    /// Up to here a frame of an interface can go without meeting anything else.
    fn horizon(&self, link: HostLink) -> SimTime {
        let horizon = self.limit.min(self.queue.next_in(Lane::Any).back_ns(1));
        if !self.until_received {
            return horizon;
        }
        // Whoever gets the first frame may change the segment then.
        let other = if link == HostLink::Main { HostLink::Redundant } else { HostLink::Main };
        let entry = self.queue.next_in(other.entry_lane());
        let route = &self.routes[other as usize];
        let there = if route.wiring == Some(self.wiring) { route.length_ns() } else { 0 };
        horizon.min(self.queue.next_in(Lane::Exit)).min(SimTime(entry.0.saturating_add(there)))
    }

    /// Finds the way of frames of an interface, if it leads through healthy cables and back to an interface.
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
        // Every port of every device is entered once at most.
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
            let Way { exit, processed, port_changes } = node.device.controller.way(port)?;
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

/// Whether a frame leaves all ports as they are and latches no receive times: it writes no register by its address. (Where
/// it can do so by FMMUs there is no [`Way`].)
pub(super) fn leaves_ways(frame: &SimFrame) -> bool {
    let harmless = |header: &[u8]| {
        let address = u16::from_le_bytes([header[4], header[5]]);
        match Command::from_code(header[0]) {
            Command::Nop | Command::Aprd | Command::Fprd | Command::Brd => true,
            Command::Lrd | Command::Lwr | Command::Lrw => true,
            Command::Apwr | Command::Fpwr | Command::Bwr => address >= map::USER_RAM.0,
            Command::Armw | Command::Frmw => address == map::DC_SYSTEM_TIME.0,
            Command::Aprw | Command::Fprw | Command::Brw | Command::Reserved(_) => false,
        }
    };
    let datagrams = || {
        frame.datagrams.iter().map(|place| {
            let header = usize::from(place.header);
            frame.bytes.get(header..header + 6)
        })
    };
    frame.kind == FrameKind::Datagrams
        && frame.fcs == Fcs::Good
        && !frame.malformed
        && datagrams().all(|header| header.is_some_and(harmless))
}
