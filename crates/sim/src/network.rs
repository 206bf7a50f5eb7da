//! A segment in virtual time: devices, the cables between them and the two interfaces of the MainDevice (issue 2,
//! part 3; protocol 2, 9.1, 11.3, 11.4).
//!
//! Input: frames of the MainDevice ([`Network::send`]), the time up to which the segment runs ([`Network::advance`]),
//! and faults. Output: the frames that come back, with the time of their last bit ([`Network::receive`]), and the
//! devices themselves for inspection. There is no other clock and no other randomness than the seed: the same calls
//! give the same run, bit for bit.
//!
//! # Model
//!
//! An event is the arrival of a frame's *last* bit at an end of a cable. Controllers cut through, so the next arrival
//! is this one, plus the delay of the hop, plus that of the cable; when the first bit passed follows from the frame's
//! length at 100 Mbit/s. A frame is lost if the cable, from the first bit's entry to the last bit's exit, was dead at
//! any moment; where the receiver saw its beginning it travels on as a damaged frame (protocol 2.5). Both ends of a
//! cable notice a lost or a new signal after a detection delay; until then frames sent there are lost. A frame on whose
//! way through a device a port opens or closes is lost (protocol 2.2).

pub mod builder;
mod cabling;
mod event;
mod faults;
mod flight;
mod options;
mod pool;
mod random;
mod route;
mod signals;
pub mod statistics;
mod traffic;

use core::time::Duration;

use crate::cable::{CableId, CableSpec, DeviceIndex, Direction, Endpoint, HostLink, Leg, LegId};
use crate::device::Device;
use crate::fault::Fault;
use crate::host::{HostInterface, Received};
use crate::queue::EventQueue;
use crate::segment::{Segment, SegmentError};
use crate::time::SimTime;
use event::Event;
use pool::{FramePool, Slot};
use route::Route;
use statistics::Statistics;

pub use options::{Beyond, DatagramLimit, NetworkOptions};
pub(crate) use random::Random;

/// A device with its place in the segment.
#[derive(Debug)]
struct Node {
    device: Device,
    /// The direction of the cable that leads away from each port.
    out: [Option<LegId>; 4],
    /// When each port last opened or closed because its link came or went.
    loop_changed_at: [SimTime; 4],
    /// The latest of these: spares most frames the look at each.
    last_loop_change: SimTime,
    /// The earliest event that will wake the device.
    wake_at: SimTime,
    /// The controller's schedule that this was arranged for.
    arranged: Option<u32>,
    /// The frame that the device has not reacted to yet, during a leap.
    unsettled_by: Option<u64>,
}

/// A cable.
#[derive(Debug)]
struct Cable {
    spec: CableSpec,
    cut: bool,
    /// Counts changes of the signal, so that a detection knows whether it is out of date.
    epoch: u32,
}

/// A segment.
#[derive(Debug)]
pub struct Network {
    now: SimTime,
    options: NetworkOptions,
    queue: EventQueue<Event>,
    nodes: Vec<Node>,
    cables: Vec<Cable>,
    legs: Vec<Leg>,
    hosts: [HostInterface; 2],
    frames: FramePool,
    scheduled: Vec<Option<Fault>>,
    random: Random,
    statistics: Statistics,
    /// Counts changes of cables, links and power.
    wiring: u32,
    /// The ways of frames of both interfaces.
    routes: [Route; 2],
    /// Time goes on to here before the caller has a say again,
    limit: SimTime,
    /// or only to the first frame that arrives.
    until_received: bool,
    /// The last hop of a flight.
    flown_to: SimTime,
    /// Time leaps: devices react when the frames have left the segment.
    leaping: bool,
    /// Devices that have not reacted yet.
    unsettled: Vec<u32>,
}

impl Network {
    /// A segment of these devices and cables. It begins at time zero with the power just switched on and all links up.
    ///
    /// # Errors
    /// A cable that ends at a device or port that does not exist, or where another cable is plugged in.
    pub fn new(devices: Vec<Device>, cables: Vec<CableSpec>, options: NetworkOptions) -> Result<Network, SegmentError> {
        let out = cabling::plug(&devices, &cables)?;
        let legs = cables.iter().flat_map(|cable| {
            let delay_ns = u64::try_from(cable.delay.as_nanos()).unwrap_or(u64::MAX);
            [Leg::new(cable.b, delay_ns), Leg::new(cable.a, delay_ns)]
        });
        let host = |link: HostLink| {
            HostInterface::new(out.hosts[link as usize], options.transmit_queue, options.receive_queue)
        };
        let mut network = Network {
            now: SimTime::ZERO,
            queue: EventQueue::with_capacity(devices.len() + options.transmit_queue),
            hosts: HostLink::ALL.map(host),
            legs: legs.collect(),
            cables: cables.into_iter().map(|spec| Cable { spec, cut: false, epoch: 0 }).collect(),
            nodes: devices.into_iter().zip(out.devices).map(|(device, out)| Node::new(device, out)).collect(),
            frames: FramePool::default(),
            scheduled: Vec::new(),
            random: Random::new(options.seed),
            statistics: Statistics::default(),
            wiring: 0,
            routes: Default::default(),
            limit: SimTime::ZERO,
            until_received: false,
            flown_to: SimTime::ZERO,
            options,
            leaping: false,
            unsettled: Vec::new(),
        };
        network.start();
        Ok(network)
    }

    /// A segment as a file describes it.
    ///
    /// # Errors
    /// As [`Network::new`].
    pub fn from_description(segment: Segment) -> Result<Network, SegmentError> {
        let devices = segment.devices.into_iter().map(Device::new).collect();
        Network::new(devices, segment.cables, segment.options)
    }

    /// The time up to which everything has happened.
    pub fn now(&self) -> SimTime {
        self.now
    }

    /// When the next thing happens, if anything does.
    pub fn next_event(&self) -> Option<SimTime> {
        self.queue.next_at()
    }

    /// Lets everything happen that is due up to and including `to`.
    pub fn advance(&mut self, to: SimTime) {
        self.limit = to;
        self.settle_all();
        let mut due = self.queue.pop_until(to);
        while let Some((at, event)) = due {
            debug_assert!(at >= self.now, "time goes back from {} to {at}", self.now);
            self.now = at;
            due = match self.handle(event) {
                Some((at, event)) => self.queue.push_pop(at, event, to),
                None => self.queue.pop_until(to),
            };
        }
        self.now = self.now.max(to);
    }

    /// Lets everything happen that is due up to and including the moment at which a frame has arrived at an interface,
    /// or `to` if none does; or nothing, if one is waiting there already.
    pub fn advance_until_received(&mut self, to: SimTime) {
        let waits = |network: &Network| network.hosts.iter().any(|host| !host.received.is_empty());
        self.until_received = true;
        self.limit = to;
        self.settle_all();
        let mut follows = None;
        while !waits(self) {
            let due = match follows.take() {
                Some((at, event)) => self.queue.push_pop(at, event, to),
                None => self.queue.pop_until(to),
            };
            let Some((at, event)) = due else { break };
            self.now = at;
            follows = self.handle(event);
        }
        self.until_received = false;
        let to = if waits(self) { self.now } else { to };
        self.advance(to);
    }

    /// Processes all events, in their order and at their times, until no frame is left in the segment: the time
    /// advances to the moment at which the last one has left, but not beyond `limit`.
    ///
    /// The devices react to the frames that have passed them with [`Network::settle_all`], or when the next frame
    /// reaches them: callers that need responses as soon as possible take the frames first.
    pub fn advance_until_quiet(&mut self, limit: SimTime) {
        self.leaping = true;
        self.pass_all_frames(limit);
        self.leaping = false;
    }

    fn pass_all_frames(&mut self, limit: SimTime) {
        self.limit = limit;
        let mut follows = None;
        while self.frames.under_way() > 0 {
            let due = match follows.take() {
                Some((at, event)) => self.queue.push_pop(at, event, limit),
                None => self.queue.pop_until(limit),
            };
            let Some((at, event)) = due else { break };
            self.now = at;
            follows = self.handle(event);
        }
        self.now = self.now.max(self.flown_to);
    }

    /// Lets the time pass.
    pub fn advance_by(&mut self, time: Duration) {
        self.advance(self.now + time);
    }

    /// What happens, and what follows from it at once if it is the next hop of a frame.
    fn handle(&mut self, event: Event) -> Option<(SimTime, Event)> {
        match event {
            Event::Entry { slot, link, leg } => return self.enter(slot, link, leg),
            Event::Arrival { slot, leg, meddled } => return self.arrive(slot, leg, meddled),
            Event::Detection { leg, epoch } => self.detect(leg, epoch),
            Event::Wake { device } => self.wake(device as usize),
            Event::Fault { number } => self.strike(number as usize),
        }
        None
    }

    /// Sends a frame (without check sequence) on an interface, padded to the shortest that Ethernet allows. It leaves
    /// behind those that are queued there. On an interface without carrier it is lost.
    pub fn send(&mut self, link: HostLink, bytes: &[u8]) {
        self.transmit(link, bytes);
    }

    /// The next frame that arrived on an interface with a good check sequence.
    pub fn receive(&mut self, link: HostLink) -> Option<Received> {
        self.hosts[link as usize].received.pop_front()
    }

    /// Gives the buffer of a received frame back, so that sending does not need a new one.
    pub fn give_back(&mut self, bytes: Vec<u8>) {
        self.frames.give_back(bytes);
    }

    /// Whether the interface has link, as far as it has noticed.
    pub fn carrier(&self, link: HostLink) -> bool {
        self.hosts[link as usize].out.is_some_and(|out| self.legs[out.reverse().index()].detected)
    }

    /// A device.
    ///
    /// # Panics
    /// When there is no device with this number.
    pub fn device(&self, device: DeviceIndex) -> &Device {
        &self.nodes[device.0].device
    }

    /// A device, to be changed from outside at the present time; it looks at what has changed before time goes on.
    ///
    /// # Panics
    /// When there is no device with this number.
    pub fn device_mut(&mut self, device: DeviceIndex) -> &mut Device {
        self.wake_at(device.0, self.now);
        self.wiring_changed();
        &mut self.nodes[device.0].device
    }

    /// All devices in the order of their numbers.
    pub fn devices(&self) -> impl ExactSizeIterator<Item = &Device> {
        self.nodes.iter().map(|node| &node.device)
    }

    /// All cables in the order of their numbers.
    pub fn cables(&self) -> impl ExactSizeIterator<Item = &CableSpec> {
        self.cables.iter().map(|cable| &cable.spec)
    }

    /// The cable that is plugged in there.
    pub fn cable_at(&self, endpoint: Endpoint) -> Option<CableId> {
        let out = match endpoint {
            Endpoint::Device(device, port) => self.nodes.get(device.0)?.out[port.index()],
            Endpoint::Host(link) => self.hosts[link as usize].out,
        };
        out.map(LegId::cable)
    }

    /// The first cable that joins two devices.
    pub fn cable_between(&self, one: DeviceIndex, other: DeviceIndex) -> Option<CableId> {
        let is = |endpoint: Endpoint, wanted| matches!(endpoint, Endpoint::Device(device, _) if device == wanted);
        let joins = |spec: &CableSpec| is(spec.a, one) && is(spec.b, other) || is(spec.a, other) && is(spec.b, one);
        self.cables().position(joins).map(CableId)
    }

    /// The cable of an interface of the MainDevice.
    pub fn host_cable(&self, link: HostLink) -> Option<CableId> {
        self.cable_at(Endpoint::Host(link))
    }

    /// Counters since the beginning.
    pub fn statistics(&self) -> &Statistics {
        &self.statistics
    }

    /// The options it was made with.
    pub fn options(&self) -> &NetworkOptions {
        &self.options
    }

    fn leg_mut(&mut self, cable: CableId, direction: Direction) -> &mut Leg {
        &mut self.legs[LegId::new(cable, direction).index()]
    }
}
