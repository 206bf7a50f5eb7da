//! Propagation delays that are written during process data exchange, compared with the true delays.
//!
//! A run brings a random segment to a state with known delays, cuts and repairs its cables, and checks every written
//! delay in every cycle. The true delays follow from the times at which the processing units received one frame, which
//! only the simulator has. A delay is right, or it is not written and a reason is reported ([`Outcome`]).

pub mod idle;

use std::collections::BTreeMap;
use std::time::Duration;

use ringcat::{Event, JunctionConnection, JunctionMode, Options, SubDeviceId};
use ringcat_engine::main_device::RawDatagram;
use ringcat_sim::cable::{CableId, DeviceIndex, Endpoint};
use ringcat_sim::controller::Wander;
use ringcat_sim::description::DeviceDescription;
use ringcat_sim::frame::Port::{self, A, B, C, D};
use ringcat_sim::network::Network;
use ringcat_sim::time::SimTime;
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::map;

use crate::clocks::{clocked, config, delay, wired, with_clocks};
use crate::dice::Dice;
use crate::segments::{MAIN, REDUNDANT, at};
use crate::world::{Mark, World};

/// Maximum error of a delay for each hop to the reference.
pub const HOP_NS: i64 = 20;
/// Cycles until delays have to be right again, or the reason for missing ones reported.
const LIMIT_CYCLES: u64 = 1_500;
/// Cycles before the first check of the delays.
const LOOK_CYCLES: u64 = 60;
/// Cycles in which the delays must stay right.
const CALM_CYCLES: u64 = 20;

/// Cycles in which the set of hidden delays must not change: the next measurement may find further delays.
const STEADY_CYCLES: u64 = 200;

/// Shape of a segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// A ring of two links with this many SubDevices.
    Ring(usize),
    /// A ring behind a junction, with this many members, and one SubDevice before and one behind it.
    LocalRing(usize),
    /// A tree with branches and rings behind junctions, with one link or two.
    Tree,
    /// The same with forks and other SubDevices without a clock.
    Gaps,
}

/// Results of changes of a segment.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// Cables that were cut or repaired.
    pub changes: u64,
    /// Delays that were written meanwhile.
    pub written: u64,
    /// Changes after which all delays were right.
    pub right: u64,
    /// Changes after which some delays were not written, by reported reason.
    pub not_written: BTreeMap<String, u64>,
    /// Changes after which delays were hidden by forks without a clock, and reported as hidden.
    pub hidden: BTreeMap<usize, u64>,
    /// Delays that were written and wrong, or not written without a reason.
    pub wrong: Vec<String>,
    /// Largest error of a written delay, in nanoseconds for each hop.
    pub largest_ns: f64,
}

impl Outcome {
    /// Adds another outcome.
    pub fn add(&mut self, other: Outcome) {
        (self.changes, self.written) = (self.changes + other.changes, self.written + other.written);
        self.right += other.right;
        other.not_written.into_iter().for_each(|(reason, count)| *self.not_written.entry(reason).or_default() += count);
        other.hidden.into_iter().for_each(|(count, times)| *self.hidden.entry(count).or_default() += times);
        self.wrong.extend(other.wrong);
        self.largest_ns = self.largest_ns.max(other.largest_ns);
    }
}

/// Cables of a segment, those that may be cut, and the number of devices.
struct Plan {
    cables: Vec<(Endpoint, Endpoint)>,
    cut: Vec<usize>,
    devices: usize,
    /// Closing cables of rings behind junctions.
    connections: Vec<JunctionConnection>,
}

impl Plan {
    fn new(shape: Shape, dice: &mut Dice) -> Plan {
        let mut plan = Plan { cables: Vec::new(), cut: Vec::new(), devices: 0, connections: Vec::new() };
        match shape {
            Shape::Ring(count) => {
                let end = plan.chain(MAIN, count);
                plan.connect(end, REDUNDANT);
                plan.cut = (0..plan.cables.len()).collect();
            }
            Shape::LocalRing(members) => {
                let first = plan.hang(MAIN);
                let junction = plan.hang(at(first, B));
                let begin = plan.cables.len();
                plan.local_ring(junction, members);
                plan.cut = (begin..plan.cables.len()).collect();
                plan.hang(at(junction, C));
            }
            Shape::Tree | Shape::Gaps => plan.tree(dice),
        }
        plan
    }

    fn connect(&mut self, one: Endpoint, other: Endpoint) {
        self.cables.push((one, other));
    }

    fn hang(&mut self, from: Endpoint) -> usize {
        self.connect(from, at(self.devices, A));
        self.devices += 1;
        self.devices - 1
    }

    /// A row of this many devices; returns its last port.
    fn chain(&mut self, from: Endpoint, count: usize) -> Endpoint {
        (0..count).fold(from, |from, _| at(self.hang(from), B))
    }

    fn local_ring(&mut self, junction: usize, members: usize) {
        let end = self.chain(at(junction, D), members);
        self.connect(end, at(junction, B));
        let port = |port: Port| port.index() as u8;
        let tail = self.devices - 1;
        self.connections.push(JunctionConnection::new(SubDeviceId(junction), port(B), SubDeviceId(tail), port(B)));
    }

    /// A trunk with branches and rings behind junctions; the trunk may be closed to a ring of two links.
    fn tree(&mut self, dice: &mut Dice) {
        let mut end = MAIN;
        for _ in 0..2 + dice.below(5) {
            let device = self.hang(end);
            end = match dice.below(4) {
                0 => {
                    self.local_ring(device, 1 + dice.below(12) as usize);
                    at(device, C)
                }
                1 => {
                    self.branch(at(device, D), dice, 2);
                    at(device, B)
                }
                _ => at(device, B),
            };
            end = if dice.one_in(3) { self.chain(end, dice.below(8) as usize) } else { end };
        }
        if dice.one_in(2) {
            self.connect(end, REDUNDANT);
        }
        self.cut = (1..self.cables.len()).collect();
    }

    fn branch(&mut self, from: Endpoint, dice: &mut Dice, depth: u32) {
        let mut end = from;
        for _ in 0..1 + dice.below(4) {
            let device = self.hang(end);
            end = at(device, B);
            if depth > 0 && dice.one_in(4) {
                self.branch(at(device, D), dice, depth - 1);
            } else if dice.one_in(5) {
                self.local_ring(device, 1 + dice.below(6) as usize);
                end = at(device, C);
            }
        }
    }
}

/// Clocks of a run: ideal for a third of the seeds; a third of the others latch any frame.
fn devices(count: usize, dice: &mut Dice) -> Vec<DeviceDescription> {
    let is_ideal = dice.one_in(3);
    let any = dice.one_in(3);
    let mut all = clocked(count, 50);
    for device in &mut all {
        device.latches_any_frame = any;
        if is_ideal {
            (device.clock_drift_ppb, device.clock_wander) = (0, Wander::default());
            device.receive_jitter = Duration::ZERO;
        }
    }
    all
}

/// Some SubDevices of a segment with gaps have no clock; at least one has a clock.
fn remove_clocks(shape: Shape, devices: &mut [DeviceDescription], dice: &mut Dice) {
    if shape == Shape::Gaps {
        let keeps = dice.below(devices.len() as u64) as usize;
        let without = devices.iter_mut().enumerate().filter(|(number, _)| *number != keeps);
        without.filter(|_| dice.one_in(3)).for_each(|(_, device)| device.dc = None);
    }
}

/// Runs a seed: a segment of this shape with this many changes.
///
/// # Panics
/// When the segment does not come up.
pub fn run(shape: Shape, seed: u64, changes: u64) -> Outcome {
    let mut dice = Dice::new(seed);
    let plan = Plan::new(shape, &mut dice);
    let mut devices = devices(plan.devices, &mut dice);
    remove_clocks(shape, &mut devices, &mut dice);
    let network = wired(devices, &plan.cables);
    let junctions = if plan.connections.is_empty() { JunctionMode::Disabled } else { JunctionMode::Strict };
    let options = Options::default().with_junctions(junctions);
    let config = config().with_drift_distributions(500);
    let mut world = World::with_junctions(seed, network, &options, |scan| with_clocks(scan, config), &plan.connections)
        .unwrap_or_else(|error| panic!("seed {seed}, {shape:?}: {error}"));
    world.until(Duration::from_secs(8), "everything in OP", World::all_in_op);
    let mut outcome = Outcome::default();
    let what = |text: &str| format!("{shape:?}, seed {seed}, {text}");
    Watch::new(&world, world.beginning()).settle(&mut world, &mut outcome, &what("at the start"));
    for _ in 0..changes.div_ceil(2) {
        let cable = *dice.pick(&plan.cut);
        world.run_cycles(dice.below(10));
        for heal in [false, true] {
            let watch = Watch::new(&world, world.mark());
            let (act, name) =
                if heal { (World::heal as fn(&mut World, CableId), "heal") } else { (World::cut as _, "cut") };
            act(&mut world, CableId(cable));
            watch.settle(&mut world, &mut outcome, &what(&format!("{name} {cable}")));
        }
    }
    outcome
}

/// Checks the delays written after a change.
struct Watch {
    since: Mark,
    before: Vec<u32>,
    written: Vec<Written>,
}

/// A value that was written.
struct Written {
    device: usize,
    value: u32,
    /// SubDevices with hidden delays at this time: other delays are not relative to them.
    hidden: Vec<usize>,
}

impl Watch {
    fn new(world: &World, since: Mark) -> Watch {
        let before = delays(world.network());
        Watch { since, written: Vec::new(), before }
    }

    fn cycle(&mut self, world: &mut World) {
        world.cycle();
        let now = delays(world.network());
        for (device, value) in now.iter().copied().enumerate().filter(|(device, now)| self.before[*device] != *now) {
            self.written.push(Written { device, value, hidden: hidden(world) });
        }
        self.before = now;
    }

    /// Runs until all delays are right and stay right, or the reason for missing ones is reported.
    fn settle(mut self, world: &mut World, outcome: &mut Outcome, what: &str) {
        (0..LOOK_CYCLES).for_each(|_| self.cycle(world));
        let mut cycles = LOOK_CYCLES;
        let all = loop {
            let all = truth(world);
            let now = delays(world.network());
            let hidden = hidden(world);
            let truth = from_known(&all, &hidden);
            // A hidden delay may keep its former register value: it is reported as invalid.
            if truth.iter().all(|place| hidden.contains(&place.device) || !place.is_wrong(now[place.device])) {
                let calm = if hidden.is_empty() { CALM_CYCLES } else { STEADY_CYCLES };
                (0..calm).for_each(|_| self.cycle(world));
                if self::hidden(world) != hidden && cycles < LIMIT_CYCLES {
                    cycles += calm;
                    continue;
                }
                outcome.right += 1;
                *outcome.hidden.entry(hidden.len()).or_default() += 1;
                break all;
            }
            if cycles >= LIMIT_CYCLES {
                self.explain(world, outcome, what, &truth);
                break all;
            }
            (0..CALM_CYCLES).for_each(|_| self.cycle(world));
            cycles += CALM_CYCLES;
        };
        outcome.changes += 1;
        for Written { device, value, hidden } in &self.written {
            for place in from_known(&all, hidden).iter().filter(|place| place.device == *device) {
                outcome.written += 1;
                outcome.largest_ns = outcome.largest_ns.max(place.error(*value).abs() as f64 / place.hops as f64);
                if place.is_wrong(*value) || hidden.contains(device) {
                    let text = format!("device {device}: expected {} ns, {value} was written", place.delay_ns);
                    outcome.wrong.push(format!("{what}: {text}"));
                }
            }
        }
    }

    /// Delays that are not right at the end: they were not written, for a reported reason.
    fn explain(&self, world: &World, outcome: &mut Outcome, what: &str, truth: &[Place]) {
        let reason = world.events(self.since).iter().rev().find_map(|timed| match &timed.event {
            Event::ClocksFailed { reason } => Some(reason.clone()),
            _ => None,
        });
        match reason {
            Some(reason) => *outcome.not_written.entry(reason).or_default() += 1,
            None => {
                let now = delays(world.network());
                let wrong = truth.iter().filter(|place| place.is_wrong(now[place.device]));
                let text: Vec<String> = wrong
                    .map(|place| format!("{}: {} instead of {}", place.device, now[place.device], place.delay_ns))
                    .collect();
                outcome.wrong.push(format!("{what}: not written, and no reason: {}", text.join(", ")));
            }
        }
    }
}

/// A device that processed the frame.
#[derive(Clone, Copy, Debug)]
struct Place {
    device: usize,
    /// Link of the processed frame.
    frame: u64,
    /// Delay from the first processing unit.
    delay_ns: i64,
    /// Number of processing units before it.
    number: i64,
    hops: i64,
}

impl Place {
    fn error(&self, written: u32) -> i64 {
        i64::from(written as i32) - self.delay_ns
    }

    fn is_wrong(&self, written: u32) -> bool {
        self.error(written).abs() > HOP_NS * self.hops
    }
}

/// Devices that are reported with unknown delays.
fn hidden(world: &World) -> Vec<usize> {
    let clocks = world.application().engine().clocks();
    let hidden = clocks.iter().filter(|clock| clock.hidden.is_some_and(|hidden| !hidden.is_estimated));
    let stations: Vec<u16> = hidden.map(|clock| clock.station.0).collect();
    (0..world.network().devices().len()).filter(|device| stations.contains(&world.station_of(*device))).collect()
}

fn delays(network: &Network) -> Vec<u32> {
    (0..network.devices().len()).map(|device| delay(network, device)).collect()
}

/// The same from the first one on its link whose delay is known.
fn from_known(truth: &[Place], hidden: &[usize]) -> Vec<Place> {
    let known = |place: &&Place| !hidden.contains(&place.device);
    let since = |place: &Place| {
        let first = truth.iter().filter(known).find(|first| first.frame == place.frame).unwrap_or(place);
        let hops = (place.number - first.number).abs().max(1);
        Place { delay_ns: place.delay_ns - first.delay_ns, hops, ..*place }
    };
    truth.iter().map(since).collect()
}

/// Receive times of a frame at the processing units with a clock, relative to the first one on its link.
fn truth(world: &mut World) -> Vec<Place> {
    let before = latched(world.network());
    let work = world.application_mut().engine_mut().start_datagrams(vec![spread_broadcast()]);
    let _ = world.finish(Duration::from_secs(1), work);
    places(world.network(), &before)
}

/// The datagram at which all SubDevices latch their receive times.
fn spread_broadcast() -> RawDatagram {
    RawDatagram::new(Command::Bwr, Target::Broadcast(map::DC_RECEIVE_TIME), vec![0; 4])
}

/// The frame that each device has latched, and when.
fn latched(network: &Network) -> Vec<Option<(u64, SimTime)>> {
    network.devices().map(|device| device.controller.latched()).collect()
}

/// The devices that have latched another frame than before.
fn places(network: &Network, before: &[Option<(u64, SimTime)>]) -> Vec<Place> {
    let mut met: Vec<(u64, u64, usize)> = Vec::new();
    for (device, (now, before)) in latched(network).into_iter().zip(before).enumerate() {
        let of = network.device(DeviceIndex(device));
        // Unreachable devices keep their delay, devices without power lose it.
        let counts = now != *before && of.controller.is_powered() && of.description.dc.is_some();
        if let Some((frame, at)) = now.filter(|_| counts) {
            met.push((frame, at.0, device));
        }
    }
    met.sort_unstable();
    let mut places: Vec<Place> = Vec::new();
    let mut first = (0, 0, 0);
    for (number, (frame, at, device)) in met.into_iter().enumerate() {
        if number == 0 || frame != first.0 {
            first = (frame, at, number);
        }
        let number = (number - first.2) as i64;
        places.push(Place { device, frame, delay_ns: (at - first.1) as i64, number, hops: number.max(1) });
    }
    places
}
