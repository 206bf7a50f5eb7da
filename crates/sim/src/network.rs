//! A segment in virtual time: devices, the cables between them and the interfaces of the MainDevice, or of two of them
//! (protocol 2, 9.1, 11.3, 11.4).
//!
//! Input: frames of the MainDevice ([`Network::send`]), the time up to which the segment runs ([`Network::advance`]),
//! and faults. Output: the returned frames, with the time of their last bit ([`Network::receive`]), and the devices for
//! inspection. There is no other clock and no randomness except the seed: the same calls give the same run, bit for
//! bit.
//!
//! # Model
//!
//! An event is the arrival of a frame's *last* bit at an end of a cable. Controllers cut through, so the next arrival
//! is this time plus the delay of the hop plus that of the cable; the time of the first bit follows from the frame's
//! length at 100 Mbit/s. A frame is lost if the cable had no signal at any moment from the entry of its first bit to
//! the exit of its last bit; if the receiver has seen its beginning, the frame continues as a damaged frame (protocol
//! 2.5). Both ends of a cable detect a lost or a new signal after a detection delay; until then frames sent there are
//! lost. A frame is lost if a port on its path through a device opens or closes while it passes (protocol 2.2).

pub mod builder;
mod cabling;
mod event;
mod fast_path;
mod faults;
pub mod host_log;
mod hosts;
mod options;
mod pool;
mod random;
mod route;
mod signals;
pub mod statistics;
mod traffic;

use core::time::Duration;

use crate::cable::{CableId, CableSpec, DeviceIndex, Direction, Endpoint, Host, HostLink, Leg, LegId};
use crate::device::Device;
use crate::fault::Fault;
use crate::host::HostInterface;
use crate::host::machine::Machine;
use crate::queue::EventQueue;
use crate::segment::{Segment, SegmentError};
use crate::time::SimTime;
use event::Event;
use host_log::HostLog;
use pool::{FramePool, Slot};
use route::Route;
use statistics::Statistics;

pub use crate::host::machine::HostCondition;
pub use options::{Beyond, DatagramLimit, NetworkOptions};
pub(crate) use random::Random;

/// A device with its connections in the segment.
#[derive(Debug)]
struct Node {
    device: Device,
    /// The outgoing direction of the cable at each port.
    out: [Option<LegId>; 4],
    /// Time at which each port last opened or closed because of a link change.
    loop_changed_at: [SimTime; 4],
    /// The latest of these times: avoids the check of each port for most frames.
    last_loop_change: SimTime,
    /// The time of the earliest wake-up event of the device.
    wake_at: SimTime,
    /// The schedule counter of the controller for this wake-up.
    arranged: Option<u32>,
    /// The frame to which the device has not reacted yet, during [`Network::advance_until_quiet`].
    unsettled_by: Option<u64>,
}

/// A cable.
#[derive(Debug)]
struct Cable {
    spec: CableSpec,
    cut: bool,
    /// Counter of signal changes, so that outdated detections are recognised.
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
    hosts: [HostInterface; HostLink::COUNT],
    machines: [Machine; Host::COUNT],
    host_log: Option<HostLog>,
    frames: FramePool,
    scheduled: Vec<Option<Fault>>,
    random: Random,
    statistics: Statistics,
    /// Counter of changes of cables, links and power.
    wiring: u32,
    /// The routes of frames of both interfaces of the first MainDevice.
    routes: [Route; 2],
    /// Time limit of the running call.
    limit: SimTime,
    /// Whether the running call also ends at the first received frame.
    until_received: bool,
    /// Time of the last hop on the fast path.
    fast_path_until: SimTime,
    /// Whether devices react only after the frames have left the segment.
    defers_settling: bool,
    /// Devices that have not reacted yet.
    unsettled: Vec<u32>,
}

impl Network {
    /// A segment of these devices and cables. It starts at time zero at power-on, with all links up.
    ///
    /// # Errors
    /// A cable that ends at a missing device or port, or at a port with another cable.
    pub fn new(devices: Vec<Device>, cables: Vec<CableSpec>, options: NetworkOptions) -> Result<Network, SegmentError> {
        let out = cabling::plug(&devices, &cables)?;
        let legs = cables.iter().flat_map(|cable| {
            let delay_ns = u64::try_from(cable.delay.as_nanos()).unwrap_or(u64::MAX);
            [Leg::new(cable.b, delay_ns), Leg::new(cable.a, delay_ns)]
        });
        let host = |out: Option<LegId>| HostInterface::new(out, options.transmit_queue, options.receive_queue);
        let mut network = Network {
            now: SimTime::ZERO,
            queue: EventQueue::with_capacity(devices.len() + options.transmit_queue),
            hosts: out.hosts.map(host),
            machines: [const { Machine::new() }; Host::COUNT],
            host_log: None,
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
            fast_path_until: SimTime::ZERO,
            options,
            defers_settling: false,
            unsettled: Vec::new(),
        };
        network.start();
        Ok(network)
    }

    /// A segment from a file.
    ///
    /// # Errors
    /// As [`Network::new`].
    pub fn from_description(segment: Segment) -> Result<Network, SegmentError> {
        let devices = segment.devices.into_iter().map(Device::new).collect();
        let mut network = Network::new(devices, segment.cables, segment.options)?;
        for (at, fault) in segment.faults {
            network.schedule(SimTime::ZERO + at, fault);
        }
        Ok(network)
    }

    /// The time up to which all events have been processed.
    pub fn now(&self) -> SimTime {
        self.now
    }

    /// Time of the next event, if there is one.
    pub fn next_event(&self) -> Option<SimTime> {
        self.queue.next_at()
    }

    /// Processes all events up to and including `to`.
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

    /// Processes all events up to and including the time at which a frame has arrived at an interface of a host without
    /// a program of its own that runs ([`Network::run_program`]), or at which a host begins or ceases to run, or `to`
    /// if neither happens; does nothing if a frame is waiting already.
    pub fn advance_until_received(&mut self, to: SimTime) {
        self.until_received = true;
        self.limit = to;
        self.settle_all();
        let mut follows = None;
        let hosts = self.host_changes();
        while !self.is_received() && self.host_changes() == hosts {
            let due = match follows.take() {
                Some((at, event)) => self.queue.push_pop(at, event, to),
                None => self.queue.pop_until(to),
            };
            let Some((at, event)) = due else { break };
            self.now = at;
            follows = self.handle(event);
        }
        self.until_received = false;
        let to = if self.is_received() || self.host_changes() != hosts { self.now } else { to };
        self.advance(to);
    }

    /// Processes all events, in their order and at their times, until no frame is left in the segment: the time
    /// advances to the exit of the last frame, but not beyond `limit`.
    ///
    /// The devices react to the frames that have passed them in [`Network::settle_all`], or when the next frame reaches
    /// them. Callers that need responses as soon as possible receive the frames first.
    pub fn advance_until_quiet(&mut self, limit: SimTime) {
        self.defers_settling = true;
        self.pass_all_frames(limit);
        self.defers_settling = false;
    }

    fn pass_all_frames(&mut self, limit: SimTime) {
        self.limit = limit;
        let mut follows = None;
        while self.frames.under_way() > 0 || self.is_program_due() {
            let due = match follows.take() {
                Some((at, event)) => self.queue.push_pop(at, event, limit),
                None => self.queue.pop_until(limit),
            };
            let Some((at, event)) = due else { break };
            self.now = at;
            follows = self.handle(event);
        }
        self.now = self.now.max(self.fast_path_until);
    }

    /// Advances the time.
    pub fn advance_by(&mut self, time: Duration) {
        self.advance(self.now + time);
    }

    /// Processes an event and returns the next hop of a frame, if that follows at once.
    fn handle(&mut self, event: Event) -> Option<(SimTime, Event)> {
        match event {
            Event::Entry { slot, link, leg } => return self.enter(slot, link, leg),
            Event::Arrival { slot, leg, faults_applied } => return self.arrive(slot, leg, faults_applied),
            Event::Detection { leg, epoch } => self.detect(leg, epoch),
            Event::Wake { device } => self.wake(device as usize),
            Event::Fault { number } => self.apply_scheduled(number as usize),
            Event::Reaction { host } => self.react(host),
        }
        None
    }

    /// A device.
    ///
    /// # Panics
    /// When there is no device with this number.
    pub fn device(&self, device: DeviceIndex) -> &Device {
        &self.nodes[device.0].device
    }

    /// A device to be changed from outside at the current time; it evaluates the changes before time advances.
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

    /// The cable at this endpoint.
    pub fn cable_at(&self, endpoint: Endpoint) -> Option<CableId> {
        let out = match endpoint {
            Endpoint::Device(device, port) => self.nodes.get(device.0)?.out[port.index()],
            Endpoint::Host(link) => self.hosts[link as usize].out,
        };
        out.map(LegId::cable)
    }

    /// The first cable that connects two devices.
    pub fn cable_between(&self, one: DeviceIndex, other: DeviceIndex) -> Option<CableId> {
        let is = |endpoint: Endpoint, wanted| matches!(endpoint, Endpoint::Device(device, _) if device == wanted);
        let joins = |spec: &CableSpec| is(spec.a, one) && is(spec.b, other) || is(spec.a, other) && is(spec.b, one);
        self.cables().position(joins).map(CableId)
    }

    /// Counters since the beginning.
    pub fn statistics(&self) -> &Statistics {
        &self.statistics
    }

    /// The options of the segment.
    pub fn options(&self) -> &NetworkOptions {
        &self.options
    }

    fn leg_mut(&mut self, cable: CableId, direction: Direction) -> &mut Leg {
        &mut self.legs[LegId::new(cable, direction).index()]
    }
}
